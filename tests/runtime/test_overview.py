import hashlib
import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration, errors
from endosdk.io.pictures import read_frame
from endosdk.runtime.overview import colour_map, overview, robust_range
from endosdk.runtime.result_files import write_record, write_result
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

EXAMPLES = ROOT / "examples" / "data"


@pytest.fixture(scope="module")
def predicted():
    left, right = shifted_pair(96, 160, 12)
    rig = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))
    return left, DepthEstimator(TINY_MODEL, calibration=rig).predict(left, right)


def test_colours_follow_the_values_and_nan_is_gray():
    values = np.array([[0.0, 0.5, 1.0, np.nan]])
    picture = colour_map(values, 0.0, 1.0)
    low, _, high, none = picture[0].astype(int)
    assert low[2] > low[1]  # Viridis runs from blue
    assert high[1] > high[2]  # to yellow
    assert np.ptp(none) < 10


@pytest.mark.parametrize("family", ["value", "trust", "error"])
def test_colours_grow_brighter_evenly(family):
    ramp = colour_map(np.linspace(0, 1, 33, dtype=np.float32)[None], 0.0, 1.0, family)
    lightness = cv2.cvtColor(ramp, cv2.COLOR_RGB2LAB)[0, :, 0].astype(int)
    assert (np.diff(lightness) > 0).all()
    assert np.diff(lightness).max() < 3 * np.diff(lightness).mean()


def test_range_ignores_outliers_and_survives_emptiness():
    values = np.append(np.linspace(10, 20, 1000), [1e6, np.nan])
    low, high = robust_range(values)
    assert 10 <= low < 11
    assert 19 < high <= 20.1
    assert robust_range(np.full(3, np.nan)) == (0.0, 1.0)


def test_overview_shows_the_left_view_and_the_depth(predicted):
    left, result = predicted
    picture = overview(left, result)
    assert picture.dtype == np.uint8
    panels = [
        (y, x) for y in range(picture.shape[0] - 96) for x in (12,) if (picture[y : y + 96, x : x + 160] == left).all()
    ]
    assert len(panels) == 1


def test_no_end_of_one_panel_is_taken_for_an_end_of_another():
    ends = [
        colour_map(np.array([[0.0, 1.0]]), 0.0, 1.0, family)[0].astype(int) for family in ("value", "trust", "error")
    ]
    brightest = [end[1] for end in ends]
    for one in range(3):
        for other in range(one):
            assert np.abs(brightest[one] - brightest[other]).max() > 40


def test_truth_adds_the_error_beside_the_answer(predicted):
    left, result = predicted
    without = overview(left, result)
    truth = np.where(np.arange(160) < 80, result.disparity, result.disparity + 4).astype(np.float32)
    picture = overview(left, result, truth)
    assert picture.shape[0] == without.shape[0]
    panel = picture[without.shape[0] // 2 + 34 :, without.shape[1] + 12 :][:96, :160]
    valid = result.reasons == 0
    right, wrong = valid & (np.arange(160) < 80), valid & (np.arange(160) >= 80)
    assert (panel[right] == colour_map(np.zeros((1, 1)), 0.0, 1.0, "error")[0, 0]).all()
    assert (panel[wrong].sum(axis=1) > 600).all()
    assert (np.ptp(panel[~valid].astype(int), axis=1) < 10).all()  # gray: no answer, no error


def test_files_hold_what_the_result_holds(predicted, tmp_path):
    left, result = predicted
    files = write_result(tmp_path / "new" / "folder", left, result)
    read = {name: cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for name, path in files.items() if path.suffix == ".png"}
    valid = result.reasons == 0
    assert valid.any() and not valid.all()
    assert np.allclose(read["disparity.png"][valid] / 256, result.disparity[valid], atol=1 / 512)
    assert np.allclose(read["depth.png"][valid] / 10, result.depth[valid], atol=0.051)
    assert not read["disparity.png"][~valid].any() and not read["depth.png"][~valid].any()
    assert np.array_equal(read["reasons.png"], result.reasons)
    assert np.allclose(read["confidence.png"] / 255, result.confidence, atol=1 / 510 + 1e-6)
    assert np.array_equal(np.load(files["depth.npy"]), result.depth, equal_nan=True)
    sigma = np.load(files["sigma.npy"])
    assert sigma.dtype == np.float32 and np.array_equal(sigma, result.sigma, equal_nan=True)
    assert np.array_equal(np.isnan(sigma), ~valid)
    assert np.array_equal(read_frame(files["left_rectified.png"]), left)


def test_disparities_that_the_picture_cannot_hold_have_a_file_of_their_own(predicted, tmp_path, caplog):
    left, result = predicted
    disparity = result.disparity.copy()
    rows, columns = np.nonzero(result.reasons == 0)
    disparity[rows[:5], columns[:5]] = 255.99, 256.5, 300.0, -4.0, 0.0
    far = replace(result, maps=result.maps._replace(disparity=disparity))
    with caplog.at_level("WARNING", "endosdk"):
        files = write_result(tmp_path, left, far)
    assert "the 4 disparities over 256 px or below 0" in caplog.text
    picture = cv2.imread(str(files["disparity.png"]), cv2.IMREAD_UNCHANGED)
    fits = round(256 * float(disparity[rows[5], columns[5]]))
    assert list(picture[rows[:6], columns[:6]]) == [65533, 0, 0, 0, 0, fits]
    wanted = np.where(result.reasons == 0, disparity, np.nan)
    np.testing.assert_array_equal(np.load(files["disparity.npy"]), wanted)
    assert "disparity.npy" not in write_result(tmp_path, left, result) and not (tmp_path / "disparity.npy").exists()


def pictures(folder):
    """Two files that stand for the pictures of a pair, in folders of their own."""
    found = folder / "a" / "l.png", folder / "b" / "r.png"
    for path, side in zip(found, ("left", "right"), strict=True):
        path.parent.mkdir(exist_ok=True)
        path.write_text(side)
    return found


def test_no_calibration_leaves_no_file_in_mm_and_none_of_an_earlier_result(predicted, tmp_path):
    left, calibrated = predicted
    out, given = tmp_path / "out", pictures(tmp_path)
    files = write_result(out, left, calibrated)
    write_record(out, calibrated, files, given)
    result = DepthEstimator(TINY_MODEL).predict(*shifted_pair(96, 160, 12))
    files = write_result(out, left, result)
    names = {"overview.png", "disparity.png", "confidence.png", "reasons.png"}
    assert {path.name for path in out.iterdir()} == names
    record = json.loads(write_record(out, result, files, given).read_text())
    assert record["geometry"] is record["calibration_sha256"] is record["median_depth_mm"] is None
    assert record["files"].keys() == names


def test_points_follow_from_the_files_alone(tmp_path):
    """A pixel of the raw view is elsewhere; with what the files say, each pixel becomes its point."""
    rig = StereoCalibration.load(EXAMPLES / "rig.json")
    pair = [read_frame(EXAMPLES / "demo" / f"{side}.png") for side in ("left", "right")]
    estimator = DepthEstimator("fast", calibration=rig)
    result = estimator.predict(*pair)
    left = estimator.rectify(*pair)[0]
    out = tmp_path / "out"
    files = write_result(out, left, result)
    record = json.loads(write_record(out, result, files, pictures(tmp_path)).read_text())
    hashes = {side: hashlib.sha256(side.encode()).hexdigest() for side in ("left", "right")}
    assert record["inputs_sha256"] == hashes
    assert (record["left"], record["right"], record["status"]) == ("l.png", "r.png", result.status.name)
    assert record["valid_share"] == pytest.approx(result.valid_share, abs=1e-4)
    assert record["model"] == {name: getattr(result.model, name) for name in ("name", "version", "sha256")}
    assert record["calibration_sha256"] == rig.sha256
    assert record["size"] == [960, 720]
    shown = read_frame(out / "left_rectified.png")
    assert np.array_equal(shown, left) and not np.array_equal(shown, pair[0])
    g, depth = record["geometry"], np.load(out / "depth.npy")
    rows, columns = np.indices(depth.shape)
    x, y = (columns - g["cx"]) * depth / g["focal_px"], (rows - g["cy"]) * depth / g["focal_y_px"]
    assert np.isfinite(depth).mean() > 0.5
    np.testing.assert_allclose(np.stack([x, y, depth], -1), result.points(), rtol=1e-4, atol=1e-4)
    far = g["focal_px"] * g["baseline_mm"] / (result.disparity + g["doffs"])
    np.testing.assert_allclose(depth[np.isfinite(depth)], far[np.isfinite(depth)], rtol=1e-4)
    for name, sha256 in record["files"].items():
        assert hashlib.sha256((out / name).read_bytes()).hexdigest() == sha256
    assert {path.name for path in out.iterdir()} == {*record["files"], "result.json"}


@pytest.mark.parametrize("picture", [np.zeros((95, 160, 3), np.uint8), np.zeros((96, 160, 3), np.uint16)])
def test_a_picture_that_the_maps_do_not_lie_over_is_refused(predicted, tmp_path, picture):
    with pytest.raises(errors.InvalidArgument, match=r"left: must be uint8 \(96, 160, 3\), as the maps; got uint"):
        write_result(tmp_path, picture, predicted[1])


def test_unwritable_folder_is_refused(predicted, tmp_path):
    left, result = predicted
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(errors.StorageFailed):
        write_result(tmp_path / "file", left, result)
