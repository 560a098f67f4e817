"""Rectification and packing against OpenCV and the numpy twin, in every instruction set."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk import _core
from tests.conftest import textured_picture
from tests.core_rigs import Rig, every_isa, random_rig
from tests.reference import resampling

pytestmark = pytest.mark.usefixtures("restored_settings")

ORDERS = ("rgb", "bgr", "gray")


def pictures(width: int, height: int, order: str, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    pair = [textured_picture(height, width, seed + side) for side in range(2)]
    if order == "gray":
        pair = [np.ascontiguousarray(picture[..., 1]) for picture in pair]
    return pair[0], pair[1]


def rectify(
    rectifier: _core.Rectifier, left: np.ndarray, right: np.ndarray, order: str, height: int, width: int
) -> tuple[np.ndarray, np.ndarray]:
    # Filled with a value that no picture has everywhere: what is left unwritten shows.
    out = np.full((2, 3, height, width), 77, np.uint8)
    rectifier.rectify(left, right, out[0], out[1], order)
    return out[0], out[1]


def assert_close(ours: np.ndarray, expected: np.ndarray) -> None:
    difference = np.abs(ours.astype(float) - expected)
    assert np.mean(difference <= 1) >= 0.999
    assert difference.max() <= 3


@every_isa
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("model", "coefficients"), [("pinhole", 5), ("pinhole", 8), ("fisheye", 4)])
@pytest.mark.parametrize("alpha", [0.0, 1.0])
def test_rectify_equals_opencv_and_twin(isa: str, order: str, model: str, coefficients: int, alpha: float) -> None:
    _core.set_isa(isa)
    width, height = 324, 243
    rig = random_rig(5, coefficients, model, (width, height))
    frames = pictures(width, height, order)
    ours = rectify(rig.rectifier(alpha), *frames, order, height, width)
    for frame, view, result in zip(frames, rig.views(alpha), ours, strict=True):
        map_x, map_y = _core.undistort_map(*view, width, height)
        opencv = cv2.remap(frame, map_x, map_y, cv2.INTER_LINEAR)
        assert_close(result, resampling.planar(opencv, order, height, width))
        twin_map = resampling.source_map(*view, (width, height))
        twin = resampling.remap(frame.reshape(height, width, -1), *twin_map)
        assert_close(result, resampling.planar(twin, order, height, width))


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("size", [(1, 1), (2, 3), (7, 5), (9, 33), (61, 40), (131, 67)])
def test_sets_threads_and_odd_sizes_agree(isa: str, threads: int, order: str, size: tuple[int, int]) -> None:
    width, height = size
    K = np.array([[max(width, 4.0), 0, width / 2 - 0.4], [0, max(width, 4.0), height / 2 - 0.6], [0, 0, 1]])
    D = np.array([-0.15, 0.05, 0.001, -0.002])
    angle = cv2.Rodrigues(np.array([0.01, -0.02, 0.05]))[0]
    P = np.hstack([K, np.zeros((3, 1))])
    views = ("pinhole", K, D, angle, P), ("pinhole", K, D, angle.T, P)
    rectifier = _core.Rectifier(width, height, width + 2, height + 1, *views)
    frames = pictures(width, height, order)
    _core.set_isa("plain")
    _core.set_threads(1)
    expected = rectify(rectifier, *frames, order, height + 6, width + 7)
    _core.set_isa(isa)
    _core.set_threads(threads)
    ours = rectify(rectifier, *frames, order, height + 6, width + 7)
    np.testing.assert_array_equal(ours, expected)
    for frame, view, result in zip(frames, views, ours, strict=True):
        twin_map = resampling.source_map(*view, (width + 2, height + 1))
        twin = resampling.remap(frame.reshape(height, width, -1), *twin_map)
        difference = np.abs(result - resampling.planar(twin, order, height + 6, width + 7))
        assert np.mean(difference <= 1.0) >= 0.98
        assert difference.max() <= 4


@every_isa
@pytest.mark.parametrize("order", ORDERS)
def test_strided_rows_also_backwards(isa: str, order: str) -> None:
    _core.set_isa(isa)
    rig = random_rig(2)
    width, height = rig.size
    left, right = pictures(width, height, order)
    expected = rectify(rig.rectifier(), left, right, order, height, width)
    wide = np.full((height, width + 9, *left.shape[2:]), 255, np.uint8)
    wide[:, 4 : 4 + width] = left
    upside_down = np.ascontiguousarray(right[::-1])[::-1]
    ours = rectify(rig.rectifier(), wide[:, 4 : 4 + width], upside_down, order, height, width)
    np.testing.assert_array_equal(ours, expected)


def test_black_outside_and_pad_repeats_the_edge() -> None:
    rig = random_rig(4)
    width, height = rig.size
    out_left, _ = rectify(rig.rectifier(1.0), *pictures(width, height, "rgb"), "rgb", height + 8, width + 8)
    invalid = rig.rectifier(1.0).valid_left == 0
    assert 0 < invalid.mean() < 0.5
    assert (out_left[:, :height, :width][:, invalid].max(axis=0) == 0).mean() > 0.7
    picture = out_left[:, :height, :width]
    np.testing.assert_array_equal(out_left, np.pad(picture, ((0, 0), (0, 8), (0, 8)), mode="edge"))


def test_valid_masks_tell_where_the_source_lies_inside() -> None:
    rig = random_rig(6)
    rectifier = rig.rectifier(0.7)
    for mask, view in zip((rectifier.valid_left, rectifier.valid_right), rig.views(0.7), strict=True):
        twin = resampling.valid_mask(*resampling.source_map(*view, rig.size), *rig.size)
        assert mask.dtype == np.uint8
        np.testing.assert_array_equal(mask, twin)
        assert 0 < mask.mean() < 1
    assert rig.rectifier(0.0).valid_left.mean() > 0.99


def test_a_lens_that_folds_back_is_not_valid_beyond_the_fold() -> None:
    K = np.array([[60.0, 0, 80], [0, 60.0, 60], [0, 0, 1]])
    P = np.hstack([K, np.zeros((3, 1))])
    view = ("pinhole", K, np.array([-0.5, 0, 0, 0]), np.eye(3), P)
    rectifier = _core.Rectifier(160, 120, 160, 120, view, view)
    x, y = np.meshgrid(np.arange(160), np.arange(120))
    radius = np.hypot((x - 80) / 60, (y - 60) / 60)
    fold = np.sqrt(1 / 1.5)  # where r - 0.5 r^3 stops rising
    mask = rectifier.valid_left.astype(bool)
    assert not mask[radius > fold + 0.01].any()
    assert mask[radius < fold - 0.01].all()


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("size", [(1, 1), (3, 2), (16, 4), (17, 9), (100, 37)])
def test_pack_equals_twin(isa: str, threads: int, order: str, size: tuple[int, int]) -> None:
    _core.set_isa(isa)
    _core.set_threads(threads)
    left, right = pictures(*size, order)
    strided = np.repeat(left, 2, axis=0)[::2]
    out = np.full((2, 3, size[1] + 5, size[0] + 3), 77, np.uint8)
    _core.pack(strided, right, out[0], out[1], order)
    for frame, result in zip((left, right), out, strict=True):
        np.testing.assert_array_equal(result, resampling.planar(frame, order, size[1] + 5, size[0] + 3))


def test_gray_may_have_a_channel_axis() -> None:
    left, right = pictures(20, 10, "gray")
    flat, deep = np.zeros((2, 2, 3, 10, 20), np.uint8)
    _core.pack(left, right, flat[0], flat[1], "gray")
    _core.pack(left[..., None], right[..., None], deep[0], deep[1], "gray")
    np.testing.assert_array_equal(flat, deep)


def frame(*shape: int, dtype: type = np.uint8) -> np.ndarray:
    return np.zeros(shape, dtype)


def read_only(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


BAD_PAIRS = [
    ({"left": frame(12, 16, 3, dtype=np.float32)}, "left: must be uint8; got float32"),
    ({"left": frame(12, 16, 4)}, "left: must have 3 channels"),
    ({"left": frame(12, 16)}, "left: must have 3 channels"),
    ({"left": frame(1, 12, 16, 3)}, "left: must have shape [height, width, channels]; got (1, 12, 16, 3)"),
    ({"left": frame(0, 16, 3)}, "left: must not be empty"),
    ({"left": frame(12, 32, 3)[:, ::2]}, "left: pixels of a row must be contiguous"),
    ({"left": np.broadcast_to(frame(1, 16, 3), (12, 16, 3))}, "left: rows must not overlap"),
    ({"right": frame(11, 16, 3)}, "right: must"),
    ({"order": "gray"}, "left: must have 1 channels"),
    ({"order": "hsv"}, "order: must be rgb, bgr or gray; got hsv"),
    ({"out_left": frame(3, 12, 16, dtype=np.int8)}, "out_left: must be uint8; got int8"),
    ({"out_left": frame(12, 16, 3)}, "out_left: must have shape [3, height, width]; got (12, 16, 3)"),
    ({"out_right": frame(3, 11, 16)}, "out_right: must be at least 16x12; got 16x11"),
    ({"out_right": frame(3, 12, 32)[:, :, ::2]}, "out_right: must be C-contiguous"),
    ({"out_right": read_only(frame(3, 12, 16))}, "out_right: must be writable"),
]


@pytest.mark.parametrize(("change", "message"), BAD_PAIRS)
@pytest.mark.parametrize("call", ["rectify", "pack"])
def test_bad_arrays_are_named_and_leave_the_object_usable(call: str, change: dict, message: str) -> None:
    rectifier = random_rig(0, size=(16, 12)).rectifier()
    function = rectifier.rectify if call == "rectify" else _core.pack
    good = {
        "left": frame(12, 16, 3),
        "right": frame(12, 16, 3),
        "out_left": frame(3, 12, 16),
        "out_right": frame(3, 12, 16),
        "order": "rgb",
    }
    with pytest.raises(ValueError, match="; got ") as caught:
        function(**(good | change))
    assert str(caught.value).startswith(message)
    function(**good)


def test_a_frame_of_another_size_is_refused() -> None:
    rectifier = random_rig(0, size=(16, 12)).rectifier()
    with pytest.raises(ValueError, match="left: must be 16x12; got 17x12"):
        rectifier.rectify(frame(12, 17, 3), frame(12, 17, 3), frame(3, 12, 16), frame(3, 12, 16), "rgb")


def bad_view(**change: np.ndarray) -> tuple:
    K = np.array([[20.0, 0, 8], [0, 20.0, 6], [0, 0, 1]])
    view = {"model": "pinhole", "K": K, "D": np.zeros(4), "R": np.eye(3), "P": np.hstack([K, np.zeros((3, 1))])}
    return tuple((view | change).values())


@pytest.mark.parametrize(
    ("sizes", "change", "message"),
    [
        ((0, 12, 16, 12), {}, "size: must be 1x1 to 32767x32767; got 0x12"),
        ((16, 12, 40000, 12), {}, "out size: must be 1x1 to 32767x32767; got 40000x12"),
        ((16, 12, 16, 12), {"P": np.zeros((3, 4))}, "left projection: the focal lengths must be positive"),
        ((16, 12, 16, 12), {"P": np.full((3, 4), np.nan)}, "left projection: every value must be finite"),
        ((16, 12, 16, 12), {"P": np.eye(3)}, "left projection: must hold 12 numbers"),
        ((16, 12, 16, 12), {"P": np.ones((3, 4))}, "left projection: must be [[f, 0, cx, t]"),
        ((16, 12, 16, 12), {"R": 2 * np.eye(3)}, "left rotation: must be orthonormal"),
        ((16, 12, 16, 12), {"K": np.zeros((3, 3))}, "left matrix: must be"),
    ],
)
def test_bad_geometry_is_named(sizes: tuple[int, ...], change: dict, message: str) -> None:
    with pytest.raises(ValueError, match="; got ") as caught:
        _core.Rectifier(*sizes, bad_view(**change), bad_view())
    assert str(caught.value).startswith(message)


def test_one_rectifier_serves_two_threads() -> None:
    from concurrent.futures import ThreadPoolExecutor

    rig: Rig = random_rig(8, size=(320, 240))
    rectifier = rig.rectifier()
    frames = pictures(320, 240, "rgb")
    expected = rectify(rectifier, *frames, "rgb", 240, 320)
    with ThreadPoolExecutor(2) as pool:
        results = list(pool.map(lambda _: rectify(rectifier, *frames, "rgb", 240, 320), range(40)))
    for result in results:
        np.testing.assert_array_equal(result, expected)


@every_isa
@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize(("out_size", "factor"), [((162, 121), 2), ((120, 90), 2), ((100, 75), 3), ((81, 60), 4)])
def test_a_much_smaller_picture_is_made_of_the_mean_of_blocks(
    isa: str, order: str, out_size: tuple, factor: int
) -> None:
    _core.set_isa(isa)
    width, height = 325, 243
    rig = random_rig(5, 5, "pinhole", (width, height))
    frames = pictures(width, height, order)
    small = [
        (*view[:4], view[4] * np.array([[out_size[0] / width], [out_size[1] / height], [1]])) for view in rig.views(0.0)
    ]
    ours = rectify(_core.Rectifier(width, height, *out_size, *small), *frames, order, out_size[1], out_size[0])
    for frame, (model, matrix, *rest), result in zip(frames, small, ours, strict=True):
        reduced = resampling.reduce(frame.reshape(height, width, -1), factor)
        matrix = matrix / [[factor], [factor], [1]]
        matrix[:2, 2] -= 0.5 * (factor - 1) / factor  # the first pixel lies in the middle of the first block
        twin_map = resampling.source_map(model, matrix, *rest, out_size)
        twin = resampling.remap(reduced, *twin_map, whole=(width / factor, height / factor))
        assert_close(result, resampling.planar(twin, order, out_size[1], out_size[0]))


@every_isa
@pytest.mark.parametrize(
    ("size", "out_size"),
    [
        ((1600, 1200), (480, 360)),
        ((191, 107), (48, 27)),
        ((20, 15), (30, 22)),
        ((100, 75), (70, 53)),
        ((17, 9), (8, 4)),
    ],
)
def test_a_picture_that_is_only_resized_keeps_its_border(isa: str, size: tuple, out_size: tuple) -> None:
    _core.set_isa(isa)
    width, height = size
    K = np.array([[float(width), 0, (width - 1) / 2], [0, width, (height - 1) / 2], [0, 0, 1]])
    P = np.hstack([K, np.zeros((3, 1))])
    P[:2, 2] += 0.5
    P[:2] *= np.array([[out_size[0] / width], [out_size[1] / height]])
    P[:2, 2] -= 0.5
    view = ("pinhole", K, np.zeros(0), np.eye(3), P)
    white = np.full((height, width, 3), 255, np.uint8)
    rectifier = _core.Rectifier(width, height, *out_size, view, view, True)
    left, right = rectify(rectifier, white, white, "rgb", out_size[1], out_size[0])
    assert left.min() == right.min() == 255


def test_a_fine_pattern_becomes_its_mean_and_not_another_pattern() -> None:
    # Columns of black and white: taking every second pixel would show one or the other.
    stripes = np.zeros((120, 160, 3), np.uint8)
    stripes[:, ::2] = 255
    view = ("pinhole", np.array([[200.0, 0, 79.5], [0, 200, 59.5], [0, 0, 1]]), np.zeros(5), np.eye(3))
    half = np.array([[100.0, 0, 39.5, 0], [0, 100, 29.5, 0], [0, 0, 1, 0]])
    left, _ = rectify(_core.Rectifier(160, 120, 80, 60, (*view, half), (*view, half)), stripes, stripes, "rgb", 60, 80)
    assert np.abs(left[:, 2:-2, 2:-2].astype(int) - 128).max() <= 1
