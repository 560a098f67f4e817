"""What is left across the rows: against the numpy twin, and against rotations that are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, StereoCalibration, _core
from endosdk.errors import CalibrationRequired
from endosdk.runtime.models import read_model
from endosdk.runtime.session import StereoSession
from tests.conftest import ROOT, shifted_pair
from tests.core_rigs import every_isa
from tests.reference import pose_error, postprocess, resampling

CYCLES = ROOT / "datasets" / "endosim-gi-cycles" / "test"
RIG = StereoCalibration.rectified(400.0, 10.0, (960, 720))
PATTERN = (400.0, 400.0, 479.5, 359.5, 0.0)


def turned(view: np.ndarray, rotation_deg: tuple[float, float, float]) -> np.ndarray:
    """The picture of a camera of `RIG` that turned about its own centre."""
    import cv2

    matrix = RIG.right_matrix
    turn = cv2.Rodrigues(np.radians(np.array(rotation_deg)))[0]
    warp = matrix @ turn @ np.linalg.inv(matrix)
    return np.asarray(cv2.warpPerspective(view, warp, (960, 720), flags=cv2.INTER_CUBIC))


def zoomed(view: np.ndarray, scale: float) -> np.ndarray:
    """The picture of a camera of `RIG` with another focal length."""
    import cv2

    warp = np.array([[scale, 0, (1 - scale) * 479.5], [0, scale, (1 - scale) * 359.5]])
    return np.asarray(cv2.warpAffine(view, warp, (960, 720), flags=cv2.INTER_CUBIC))


def cycles_pair(number: int) -> tuple[np.ndarray, np.ndarray]:
    import cv2

    folder = sorted(CYCLES.iterdir())[number]
    left, right = (cv2.imread(str(folder / f"{side}.jpg")) for side in ("left", "right"))
    return np.ascontiguousarray(left[..., ::-1]), np.ascontiguousarray(right[..., ::-1])


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
def test_equals_twin(isa: str, threads: int, restored_settings: None) -> None:
    import cv2

    rng = np.random.default_rng(3)
    left, right = shifted_pair(150, 240, 9)
    warp = np.array([[1.0, 0.0, 0.0], [0.004, 1.0, 0.3]])
    right = cv2.warpAffine(right, warp, (240, 150), borderMode=cv2.BORDER_REPLICATE)
    left[20:40, 50:90] = 255  # glare tells nothing
    views = [resampling.planar(view, "rgb", 152, 240).astype(np.uint8) for view in (left, right)]
    disparity = (9 + rng.normal(0, 0.3, (152, 240))).astype(np.float32)
    disparity[50, 60:64] = np.nan, np.inf, -3, 1e9
    confidence = rng.uniform(0.49, 1, disparity.shape).astype(np.float32)
    arguments = (disparity, confidence, *views, (240, 150), (2.0, 2.0), (400.0, 410.0, 239.5, 150.0, 1.5))
    _core.set_isa("plain")
    plain = _core.rig_error(*arguments)
    _core.set_isa(isa)
    _core.set_threads(threads)
    seen = _core.rig_error(*arguments)
    assert seen == plain
    expected = pose_error.rig_error(*arguments)
    assert seen is not None and expected is not None
    np.testing.assert_allclose(seen[0], expected[0], atol=3e-5)
    np.testing.assert_allclose(np.reshape(seen[1], (6, 6)), expected[1], rtol=0.05, atol=1e-7)
    assert abs(expected[0][0]) > 1e-3  # there was something to find


def test_nothing_is_measured_where_nothing_can_be() -> None:
    flat = np.full((3, 120, 160), 90, np.uint8)
    grid = np.full((120, 160), 5, np.float32)
    assert _core.rig_error(grid, np.ones_like(grid), flat, flat, (160, 120), (1.0, 1.0), PATTERN) is None
    small = flat[:, :8, :8].copy()
    cells = np.ones((8, 8), np.float32)
    assert _core.rig_error(cells, cells, small, small, (8, 8), (1.0, 1.0), PATTERN) is None


def errors_over(pairs: range, rotation: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Errors and standard errors of all angles, degrees, one row a pair."""
    errors, standard = [], []
    with DepthEstimator("fast", calibration=RIG) as estimator:
        for number in pairs:
            left, right = cycles_pair(number)
            rig = estimator.predict(left, turned(right, rotation)).rig
            assert rig is not None and rig.rotation_deg is not None and rig.rotation_se_deg is not None
            errors.append(np.subtract(rig.rotation_deg, rotation))
            standard.append(rig.rotation_se_deg)
    return np.array(errors), np.array(standard)


@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (0.5, -0.3, 0.4)])
def test_one_frame_tells_the_rotation(rotation: tuple[float, float, float]) -> None:
    errors, standard = errors_over(range(3), rotation)
    assert standard.max() < 0.06
    assert (np.abs(errors) < 4 * standard).all() and np.sqrt(np.mean(errors**2)) < 0.08


@pytest.mark.parametrize(
    "rotation", [(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5), (0.2, -0.3, 0.25)]
)
def test_standard_errors_are_honest(rotation: tuple[float, float, float]) -> None:
    errors, standard = errors_over(range(0, 60, 2), rotation)
    assert np.median(standard, axis=0).max() < 0.04 and np.sqrt(np.mean(errors**2, axis=0)).max() < 0.06
    within = [np.mean(np.abs(errors) < k * standard) for k in (1, 2)]
    assert 0.5 < within[0] < 0.95 and within[1] > 0.9
    mean = np.abs(errors.mean(axis=0))  # 30 frames of different scenes
    assert (mean < 0.02).all()


def test_a_darker_view_turns_no_rig() -> None:
    found = []
    with DepthEstimator("fast-320", calibration=RIG) as estimator:
        for number in range(0, 60, 12):
            left, right = cycles_pair(number)
            rigs = [estimator.predict(left, (gain * right).astype(np.uint8)).rig for gain in (1.0, 0.35)]
            found.append([rig.rotation_deg for rig in rigs if rig is not None])
    change = np.array(found)[:, 1] - np.array(found)[:, 0]
    assert np.abs(change).max() < 0.05 and np.sqrt(np.mean(change**2)) < 0.02


def test_a_rig_that_moved_is_named_and_sigma_grows() -> None:
    left, right = cycles_pair(0)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        clean = estimator.predict(left, right)
        moved = estimator.predict(left, turned(right, (0.0, 0.6, 0.0)))
    assert _core.Cause.RIG_MOVED not in clean.causes
    assert moved.causes[_core.Cause.RIG_MOVED] == pytest.approx(0.6, abs=0.08)
    both = (clean.reasons == 0) & (moved.reasons == 0)
    # Yaw of 0.6 degree is 4.2 px and more; that of the network alone is a fraction of one.
    expected = clean.depth[both] ** 2 / 4000 * 400 * math.radians(0.55)
    assert np.median(moved.sigma[both] / expected) > 0.8
    assert np.median(clean.sigma[both]) < 0.5 * np.median(moved.sigma[both])


def test_views_of_different_scale_are_named_and_sigma_grows() -> None:
    left, right = cycles_pair(0)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        clean = estimator.predict(left, right)
        larger = estimator.predict(left, zoomed(right, 1.01))
    with DepthEstimator("fast") as without:
        unknown = without.predict(left, zoomed(right, 0.99))
    assert clean.measures[_core.Cause.SCALES_DIFFER] == 0
    for frame in (larger, unknown):
        assert frame.causes[_core.Cause.SCALES_DIFFER] == pytest.approx(1, abs=0.15)
        assert frame.status == _core.Status.DEGRADED
    border = np.s_[:, 850:]
    both = (clean.reasons[border] == 0) & (larger.reasons[border] == 0)
    assert np.median(larger.sigma[border][both] / clean.sigma[border][both]) > 3


def test_with_a_longer_lens_a_smaller_turn_counts() -> None:
    """0.15 degree moves the picture by 1 px with `RIG`, and by 2.3 px with a lens 2.2 times as long."""
    import cv2

    def enlarged(view: np.ndarray) -> np.ndarray:
        return np.asarray(cv2.resize(view[196:523, 262:698], (960, 720), interpolation=cv2.INTER_CUBIC))

    left, right = cycles_pair(0)
    longer = StereoCalibration.rectified(400.0 * 960 / 436, 10.0, (960, 720))
    lower = turned(right, (0.15, 0.0, 0.0))
    with DepthEstimator("fast", calibration=RIG) as estimator:
        harmless = estimator.predict(left, lower)
    with DepthEstimator("fast", calibration=longer) as estimator:
        clean = estimator.predict(enlarged(left), enlarged(right))
        moved = estimator.predict(enlarged(left), enlarged(lower))
    assert _core.Cause.RIG_MOVED not in {**harmless.causes, **clean.causes}
    assert harmless.measures[_core.Cause.RIG_MOVED] == pytest.approx(0.15, abs=0.03)
    assert moved.causes[_core.Cause.RIG_MOVED] == pytest.approx(0.15, abs=0.03)


@every_isa
@pytest.mark.parametrize("scale", [1.0, 0.99])
def test_what_a_rig_adds_to_sigma_equals_twin(isa: str, scale: float, restored_settings: None) -> None:
    left, right = cycles_pair(0)
    _core.set_isa(isa)
    session = StereoSession(read_model("fast"), threads=1)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        estimator.predict(left, zoomed(turned(right, (0.3, -0.4, 0.2)), scale))
        run = NetworkRun(session, 360, 480)
        _core.pack(*estimator.rectified_pair(), run.left, run.right, "rgb")
    run()
    shape = (480, 360), (2.0, 2.0), PATTERN
    found_error = _core.rig_error(run.disparity, run.confidence, run.left, run.right, *shape)
    assert found_error is not None
    pose, covariance = found_error[:2]
    errors = np.sqrt(np.diag(np.reshape(covariance, (6, 6))))
    scale = 0.5 / session.info.output_stride
    fields = {"disparity": run.disparity, "confidence": run.confidence, "left": run.left}
    fields |= {"right": run.right, "scale": (scale, scale), "view_scale": (0.5, 0.5), "gain": 2.0}
    fields |= {"focal_px": 400.0, "baseline_mm": 10.0}
    sigmas = []
    for more in ({}, {"pattern": PATTERN}):
        maps = {name: np.empty((720, 960), np.float32) for name in ("disparity", "confidence", "depth", "sigma")}
        maps["reasons"] = np.empty((720, 960), np.uint8)
        _core.postprocess(fields | more, maps)
        sigmas.append(maps["sigma"])
    network, found = sigmas
    valid = maps["reasons"] == 0
    expected = postprocess.rig_sigma(
        maps["depth"], network, np.array(pose), errors, focal_baseline=4000.0, pattern=PATTERN
    )
    np.testing.assert_allclose(found[valid], expected[valid], rtol=1e-3)
    assert np.median(expected[valid] / network[valid]) > 2


def test_without_a_calibration_the_rows_alone_are_told() -> None:
    left, right = cycles_pair(0)
    lower = np.roll(right, 3, axis=0)
    with DepthEstimator("fast") as estimator:
        clean, off = estimator.predict(left, right), estimator.predict(left, lower)
        with pytest.raises(CalibrationRequired, match="follow_rig"):
            estimator.stream([(left, right)], follow_rig=True)
    assert clean.rig is not None and clean.rig.vertical_disparity_px < 0.2 and clean.rig.rotation_deg is None
    assert off.rig is not None and off.rig.vertical_disparity_px == pytest.approx(3.0, abs=0.2)
    assert off.causes[_core.Cause.NOT_RECTIFIED] == pytest.approx(3.0, abs=0.2)
    assert _core.Cause.NOT_RECTIFIED not in clean.causes


def test_a_stream_flags_drift_and_follows_it() -> None:
    views = [cycles_pair(number) for number in (1, 2, 4)]
    pairs = [(left, turned(right, (0.0, 0.25, 0.15))) for left, right in views]
    with DepthEstimator("fast", calibration=RIG) as estimator:
        seen = [result.rig for result in estimator.stream(pairs * 44, follow_rig=True, reuse=True)]
    assert all(rig is not None for rig in seen)
    first, last = seen[0], seen[-1]
    assert last.drifted and first.corrected_deg == (0.0, 0.0, 0.0)
    assert last.corrected_deg == pytest.approx((0.0, 0.25, 0.15), abs=0.06)
    assert last.steady_rotation_deg == pytest.approx((0.0, 0.25, 0.15), abs=0.06)
    assert np.linalg.norm(last.rotation_deg) < 0.3 * np.linalg.norm(first.rotation_deg)
    steps = {rig.corrected_deg for rig in seen}
    assert len(steps) >= 4  # slowly: a tenth of a degree at a time


def test_a_picture_that_stands_still_makes_a_rotation_hardly_more_certain() -> None:
    left, right = cycles_pair(1)
    pair = left, turned(right, (0.0, 0.25, 0.15))
    with DepthEstimator("fast", calibration=RIG) as estimator:
        rigs = [result.rig for result in estimator.stream([pair] * 60, reuse=True)]
    first, last = rigs[0], rigs[-1]
    assert first is not None and last is not None
    assert min(last.steady_rotation_se_deg) > 0.8 * min(first.rotation_se_deg)
    assert last.steady_rotation_deg == pytest.approx(first.rotation_deg, abs=0.01)


def test_pairs_that_tell_nothing_of_the_rig_leave_the_steady_rotation_as_it_is() -> None:
    left, right = cycles_pair(1)
    bent = turned(right, (0.0, 0.25, 0.15))
    noise = [np.random.default_rng(seed).integers(-2, 3, left.shape) for seed in range(4)]
    moving = [np.clip(left + grain, 0, 255).astype(np.uint8) for grain in noise]
    cases = {
        "one view twice": [(view, view) for view in moving],
        "right stands still": [(view, bent) for view in moving],
    }
    with DepthEstimator("fast", calibration=RIG) as estimator:
        for frames in cases.values():
            seen = [result.rig for result in estimator.stream([(left, bent), *frames])]
            steady = [rig.steady_rotation_deg for rig in seen if rig is not None]
            assert len(steady) == 5 and len(set(steady)) == 1
            assert steady[0] == pytest.approx((0.0, 0.25, 0.15), abs=0.1)
        others = [
            rig for result in estimator.stream([(left, bent), (moving[0], np.roll(bent, 1, 1))]) if (rig := result.rig)
        ]
        assert others[0].steady_rotation_deg != others[1].steady_rotation_deg


def test_a_turned_calibration_undoes_the_turn() -> None:
    left, right = cycles_pair(2)
    rotation = (0.3, -0.2, 0.4)
    with DepthEstimator("fast", calibration=RIG.turned(rotation)) as estimator:
        rig = estimator.predict(left, turned(right, rotation)).rig
    assert rig is not None and rig.rotation_deg == pytest.approx((0.0, 0.0, 0.0), abs=0.08)
