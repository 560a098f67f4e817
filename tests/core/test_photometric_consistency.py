"""Whether two views agree where they were matched: against the numpy twin, and what it does to wrong pairs."""

from __future__ import annotations

import functools

import cv2
import numpy as np
import pytest

import endosdk
from endosdk import Cause, DepthEstimator, Status, _core
from tests.conftest import TINY_MODEL, noisy, shifted_pair
from tests.core.test_pose_error import RIG, cycles_pair
from tests.core_rigs import every_isa
from tests.reference import matched_views, resampling, view_measures
from tests.rigs import raw_rig


@pytest.fixture(autouse=True)
def restore_threads():
    threads = _core.threads()
    yield
    _core.set_threads(threads)


def confidence_of(
    disparity: np.ndarray,
    confidence: np.ndarray,
    left: np.ndarray,
    right: np.ndarray,
    height: int,
    width: int,
) -> np.ndarray:
    """The confidence map of a frame that the network saw as it is, at the resolution of the grids' cells."""
    stride = left.shape[2] // disparity.shape[1]
    shape = (height, width)
    maps = [np.empty(shape, np.float32), np.empty(shape, np.float32), np.empty(shape, np.uint8)]
    fields = {"disparity": disparity, "confidence": confidence, "scale": (1 / stride, 1 / stride)}
    views = {"left": left, "right": right}
    _core.postprocess(fields | views, dict(zip(("disparity", "confidence", "reasons"), maps, strict=True)))
    return maps[1]


def padded(frame: np.ndarray, multiple: int) -> np.ndarray:
    height, width = (-(-side // multiple) * multiple for side in frame.shape[:2])
    return np.ascontiguousarray(resampling.planar(frame, "rgb", height, width))


@functools.cache
def spoilt_frame(height, width, stride):
    """Disparity, confidence and views of a partly wrong frame, and what the slow twin says: once for all threads."""
    rng = np.random.default_rng(height)
    left, right = shifted_pair(height, width, 6)
    right[:, width // 2 :] = rng.integers(0, 256, right[:, width // 2 :].shape)  # another scene
    left[: height // 4, : width // 3] = 77  # flat
    views = padded(left, 8), padded(right, 8)
    grid = views[0].shape[1] // stride, views[0].shape[2] // stride
    disparity = (6 + rng.normal(0, 0.6, grid)).astype(np.float32)
    wild = rng.choice(disparity.size, min(disparity.size, 5), replace=False)
    disparity.reshape(-1)[wild] = [np.nan, np.inf, -np.inf, -3.0, 1e9][: len(wild)]
    confidence = rng.uniform(0.2, 1, grid).astype(np.float32)
    expected, _ = matched_views.supported_confidence(disparity, confidence, *views, height, width)
    for array in (disparity, confidence, *views, expected):
        array.flags.writeable = False
    return disparity, confidence, views, expected


@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(
    ("height", "width", "stride"), [(64, 96, 1), (90, 131, 8), (200, 620, 4), (9, 20, 2), (1, 1, 1)]
)
def test_equals_twin(height, width, stride, threads):
    disparity, confidence, views, expected = spoilt_frame(height, width, stride)
    _core.set_threads(threads)
    seen = confidence_of(disparity, confidence, *views, height, width)
    twin = resampling.resize_bilinear(expected, height, width, 1 / stride, 1 / stride, 1.0)
    np.testing.assert_allclose(seen, twin, atol=1e-3)  # variances are small differences of large float32
    if height > 16:
        assert 0.05 < np.mean(expected == 0) < 0.95


def test_equals_twin_in_a_circular_field_of_view():
    height, width, stride = 180, 240, 4
    rows, columns = np.indices((height, width))
    views = []
    for view, x in zip(shifted_pair(height, width, 9), (118, 125), strict=True):
        inside = np.hypot(columns - x, rows - 92) < 85
        views.append(padded(np.where(inside[..., None], np.maximum(view, 40), 5).astype(np.uint8), 8))
    grid = views[0].shape[1] // stride, views[0].shape[2] // stride
    disparity = (9 + np.random.default_rng(1).normal(0, 1.2, grid)).astype(np.float32)
    confidence = np.full_like(disparity, 0.7)
    expected, _ = matched_views.supported_confidence(disparity, confidence, *views, height, width)
    twin = resampling.resize_bilinear(expected, height, width, 1 / stride, 1 / stride, 1.0)
    np.testing.assert_allclose(confidence_of(disparity, confidence, *views, height, width), twin, atol=1e-3)
    assert 0.05 < np.mean(expected < 0.5) < 0.95  # noisy disparities jump


@every_isa
def test_every_set_of_kernels_gives_the_same_bytes(isa, restored_settings):
    left, right = shifted_pair(150, 250, 9)
    views = padded(left, 8), padded(right, 8)
    rng = np.random.default_rng(3)
    grid = views[0].shape[1] // 4, views[0].shape[2] // 4
    disparity, confidence = (rng.normal(9, 1, grid).astype(np.float32), rng.uniform(0, 1, grid).astype(np.float32))
    disparity[5, 5:8] = np.nan, np.inf, -4
    seen = []
    for name in ("plain", isa):
        _core.set_isa(name)
        seen.append(confidence_of(disparity, confidence, *views, 150, 250))
    np.testing.assert_array_equal(seen[0], seen[1])


@pytest.mark.parametrize("wrong", ["another moment", "covered", "swapped", "misaligned", "black", "noise"])
def test_views_that_do_not_belong_together_have_no_answer(wrong):
    left, right = shifted_pair(180, 240, 9)
    rng = np.random.default_rng(1)
    if wrong == "another moment":
        right = shifted_pair(180, 240, 9, seed=5)[1]
    elif wrong == "covered":
        right[:] = 3
    elif wrong == "swapped":
        left, right = right, left
    elif wrong == "misaligned":
        right = np.roll(right, 25, axis=0)
    elif wrong == "black":
        left[:], right[:] = 0, 0
    else:
        left, right = rng.integers(0, 256, (2, *left.shape)).astype(np.uint8)
    views = padded(left, 8), padded(right, 8)
    disparity = np.full((views[0].shape[1] // 4, views[0].shape[2] // 4), 9, np.float32)
    confidence = np.ones_like(disparity)
    seen = confidence_of(disparity, confidence, *views, 180, 240)
    assert np.mean(seen > 0) < 0.05


def test_one_view_is_known_though_a_bit_or_some_noise_differs():
    left, _ = shifted_pair(120, 200, 9)
    wide = np.zeros((120, 260, 3), np.uint8)
    wide[:, :200] = left
    farthest = _core.farthest_displacement

    def apart(*views: np.ndarray) -> float:
        return _core.displacement_of_frames(*views)[0]

    assert apart(left, left.copy()) == 0
    assert apart(left, wide[:, :200]) == 0  # another row pitch
    assert apart(left, left[:, :199]) == farthest
    assert apart(left, np.ascontiguousarray(left[..., 0])) == farthest
    assert apart(np.full_like(left, 7), left) == farthest
    assert np.isnan(apart(np.full_like(left, 7), np.full_like(left, 7)))
    other = left.copy()
    other[::7, ::5] ^= 1
    noise = np.random.default_rng(0).normal(0, 8, left.shape)
    for one in (other, np.clip(left + noise, 0, 255).astype(np.uint8), (left * 0.98 + 3).astype(np.uint8)):
        assert 0 <= apart(left, one) < _core.displacement_of_one_view
    for moved in (1, 2, 9, 40):
        assert apart(left, shifted_pair(120, 200, moved)[1]) > _core.displacement_of_one_view


def test_stripes_that_both_views_show_are_one_view():
    """Nothing changes along the rows, so nothing tells how far apart the views are."""
    stripes = np.repeat((np.arange(240) // 5 * 37 % 200).astype(np.uint8)[:, None, None], 320, axis=1).repeat(3, axis=2)
    other = np.ascontiguousarray(stripes)
    other[0, 0] ^= 1
    views = np.ascontiguousarray(stripes), other
    assert _core.displacement_of_frames(*views) == view_measures.displacement_of_frames(*views) == (0.0, 0.0)


@pytest.mark.parametrize(
    "shape", [(120, 200), (90, 960, 3), (150, 1500, 3), (160, 1920, 3), (240, 3000, 3), (300, 3900, 3)]
)
def test_displacement_equals_twin(shape):
    left, _ = shifted_pair(*shape[:2], 9)
    rng = np.random.default_rng(4)
    for moved in (0, 1, 5):
        right = np.roll(left, moved, axis=1) * 0.8 + rng.normal(10, 3, left.shape)
        views = [np.clip(view, 0, 255).astype(np.uint8) for view in (left, right)]
        if len(shape) == 2:
            views = [np.ascontiguousarray(view[..., 1]) for view in views]
        expected = view_measures.displacement_of_frames(*views)
        assert _core.displacement_of_frames(*views) == pytest.approx(expected, rel=1e-3, abs=1e-3)


def under_text(view: np.ndarray) -> np.ndarray:
    """A view under the lines of an on-screen display, which has more texture than tissue."""
    shown = view.copy()
    for line in range(12):
        place = (30, 70 + 54 * line)
        cv2.putText(shown, "PATIENT 01 12:34 ZOOM x1.1 IRIS", place, cv2.FONT_HERSHEY_SIMPLEX, 1.1, (255,) * 3, 2)
    return shown


def test_text_over_both_views_is_no_view_shown_twice():
    left, right = cycles_pair(0)
    textured, rest = _core.displacement_of_frames(under_text(left), under_text(right))
    assert textured < _core.displacement_of_one_view
    assert rest > _core.rest_of_one_view
    with DepthEstimator("fast", calibration=RIG) as estimator:
        assert Cause.SAME_VIEW_TWICE not in estimator.predict(under_text(left), under_text(right)).causes
        noise = np.random.default_rng(0).normal(0, 12, left.shape)
        noisy = np.clip(left + noise, 0, 255).astype(np.uint8)
        assert Cause.SAME_VIEW_TWICE in estimator.predict(left, noisy).causes
        assert Cause.SAME_VIEW_TWICE in estimator.predict(under_text(left), under_text(noisy)).causes


def test_shading_alone_is_no_texture() -> None:
    rows, columns = np.indices((720, 960))
    light = 40 + 140 * np.exp(-((columns - 480) ** 2 + (rows - 360) ** 2) / (2 * 290.0**2))
    noise = np.random.default_rng(0)
    views = [np.repeat((light + noise.normal(0, 1.5, light.shape))[..., None], 3, axis=2) for _ in range(2)]
    with DepthEstimator("fast", calibration=RIG) as estimator:
        result = estimator.predict(*(np.clip(view, 0, 255).astype(np.uint8) for view in views))
    assert result.status is Status.INVALID
    assert Cause.LOW_TEXTURE in result.causes


def test_exposure_and_colour_of_a_camera_do_not_matter():
    left, right = shifted_pair(180, 240, 9)
    right = (0.3 * right + 20).astype(np.uint8)
    right[..., [0, 2]] = 0
    views = padded(left, 8), padded(right, 8)
    disparity = np.full((views[0].shape[1] // 4, views[0].shape[2] // 4), 9, np.float32)
    seen = confidence_of(disparity, np.ones_like(disparity), *views, 180, 240)
    assert np.mean(seen > 0.9999) > 0.95


@pytest.mark.parametrize("levels", [4, 8, 12])
def test_noise_does_not_take_the_answer_from_a_right_pair(levels):
    pair = shifted_pair(180, 240, 9)
    views = [padded(noisy(view, levels, seed), 8) for seed, view in enumerate(pair)]
    disparity = np.full((views[0].shape[1] // 2, views[0].shape[2] // 2), 9, np.float32)
    seen = confidence_of(disparity, np.ones_like(disparity), *views, 180, 240)
    assert np.mean(seen[:, 12:] > 0.5) > 0.97


def test_flat_surfaces_keep_their_confidence():
    left, right = shifted_pair(180, 240, 9)
    left[60:120, 80:160], right[60:120, 71:151] = 90, 90
    views = padded(noisy(left, 3, 1), 8), padded(noisy(right, 3, 2), 8)
    disparity = np.full((views[0].shape[1] // 2, views[0].shape[2] // 2), 9, np.float32)
    seen = confidence_of(disparity, np.ones_like(disparity), *views, 180, 240)
    assert seen[75:105, 95:145].min() > 0.5


def test_wrong_disparities_lose_their_confidence_pixel_by_pixel():
    left, right = shifted_pair(180, 240, 9)
    views = padded(left, 8), padded(right, 8)
    disparity = np.full((views[0].shape[1] // 2, views[0].shape[2] // 2), 9, np.float32)
    disparity[40:60, 60:90] = 25
    seen = confidence_of(disparity, np.full_like(disparity, 0.999), *views, 180, 240)
    valid = seen >= _core.default_min_confidence
    assert np.mean(valid[80:120, 120:180]) < 0.4
    right_ones = np.ones(seen.shape, bool)
    right_ones[70:130, 110:190] = False
    assert np.mean(valid[right_ones]) > 0.97


def test_a_jump_of_the_disparity_lowers_the_odds_and_a_slope_does_not():
    frames = shifted_pair(180, 240, 9)
    for frame in frames:
        frame[80:] = 90  # without texture, only the disparity counts
    views = [padded(frame, 8) for frame in frames]
    jump = np.full((views[0].shape[1] // 2, views[0].shape[2] // 2), 9, np.float32)
    slope = jump.copy()
    jump[45:, 60:] = 25
    slope[45:] += np.linspace(0, 16, jump.shape[1], dtype=np.float32)
    of_jump, of_slope = (confidence_of(map_, np.full_like(map_, 0.8), *views, 180, 240)[130] for map_ in (jump, slope))
    assert of_jump[120] < 0.1 < 0.95 < of_jump[60]
    assert of_slope[16:-16].min() > 0.9


def test_a_right_view_of_another_shape_is_refused():
    grid = np.ones((8, 8), np.float32)
    view = np.zeros((3, 32, 32), np.uint8)
    with pytest.raises(ValueError, match="right_image: must have the shape of image; got 16x32"):
        confidence_of(grid, grid, view, np.zeros((3, 32, 16), np.uint8), 32, 32)


def test_one_camera_connected_twice_is_found_before_the_lens_maps_make_it_two():
    left, _ = shifted_pair(96, 160, 9)
    estimator = endosdk.DepthEstimator(TINY_MODEL, calibration=raw_rig().scaled(160, 96))
    views = estimator.rectify(left, left)
    assert not np.array_equal(*views)
    result = estimator.predict(left, left)
    assert result.status == endosdk.Status.INVALID
    assert result.valid_share == 0
    assert [r.status for r in estimator.stream([(left, left)])] == [endosdk.Status.INVALID]


def test_a_covered_camera_makes_the_frame_invalid():
    left, right = shifted_pair(96, 160, 9)
    estimator = endosdk.DepthEstimator(TINY_MODEL)
    assert estimator.predict(left, right).status == endosdk.Status.OK
    for pair in ((left, np.zeros_like(right)), (np.zeros_like(left), right), (left, left)):
        result = estimator.predict(*pair)
        assert result.status == endosdk.Status.INVALID
        assert np.mean((result.reasons & endosdk.Reason.LOW_CONFIDENCE) != 0) > 0.9
    assert estimator.predict(left, right).status == endosdk.Status.OK
