"""The temporal filter: against its numpy twin, on what moves, and on what it must leave alone."""

from __future__ import annotations

import functools

import cv2
import numpy as np
import pytest

from endosdk import _core
from tests.reference.temporal import TemporalFilter

pytestmark = pytest.mark.usefixtures("restored_settings")

HEIGHT, WIDTH, STRIDE = 180, 240, 2


def texture(seed: int, height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """A smooth random picture, grey levels 40..200, with room around it to move."""
    noise = np.random.default_rng(seed).normal(size=(height + 80, width + 80)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    return np.clip(120 + 40 * smooth / smooth.std(), 40, 200)


def frame(
    seed: int, shift: tuple[float, float] = (0, 0), tool: int | None = None, size: tuple[int, int] = (HEIGHT, WIDTH)
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """View uint8 [3, H, W], true disparity, noisy disparity and confidence of a slanted wall, and a bright rod."""
    rng = np.random.default_rng(seed)
    height, width = size
    wall = texture(7, height, width)
    y, x = np.mgrid[:height, :width].astype(np.float32)
    view = cv2.remap(wall, x + 40 + shift[0], y + 40 + shift[1], cv2.INTER_LINEAR)
    cells = np.mgrid[: height // STRIDE, : width // STRIDE].astype(np.float32)
    true = 20 + 0.05 * (cells[1] + shift[0] / STRIDE) + 0.03 * (cells[0] + shift[1] / STRIDE)
    if tool is not None:
        view[:, tool : tool + 24] = 235 + 10 * np.sin(y[:, tool : tool + 24] / 5)
        true[:, tool // STRIDE : tool // STRIDE + 12] = 45
    view = np.clip(view + rng.normal(0, 2, view.shape) + 0.5, 0, 255).astype(np.uint8)
    disparity = (true + rng.normal(0, 0.15, true.shape)).astype(np.float32)
    confidence = np.clip(rng.normal(0.9, 0.03, true.shape), 0, 1).astype(np.float32)
    return np.stack([view // 2, view, view // 3]), true, disparity, confidence


def smoothed(
    compiled: _core.TemporalFilter, shot: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray], stride: int = STRIDE
) -> np.ndarray:
    view, _, disparity, confidence = shot
    out = disparity.copy()
    compiled.smooth(np.ascontiguousarray(view), view.shape[:0:-1], out, confidence, 1 / stride)
    return out


Shot = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


@functools.cache
def moving_scene(size: tuple[int, int]) -> list[tuple[Shot, np.ndarray]]:
    """Three frames, each with what the slow twin makes of it: once for all numbers of threads."""
    twin, found = TemporalFilter(), []
    for number in range(3):
        shot = frame(number, (3.3 * number, -1.7 * number), tool=None if size[1] < 100 else 20 + 15 * number, size=size)
        view, _, disparity, confidence = shot
        expected = np.array(twin.smooth(view, view.shape[:0:-1], disparity, confidence, 1 / STRIDE))
        for array in (*shot, expected):
            array.flags.writeable = False
        found.append((shot, expected))
    return found


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (46, 62), (20, 16)])
def test_equals_its_twin_frame_after_frame(size: tuple[int, int], threads: int) -> None:
    _core.set_threads(threads)
    compiled = _core.TemporalFilter()
    for shot, expected in moving_scene(size):
        np.testing.assert_allclose(smoothed(compiled, shot), expected, atol=2e-3)


def test_a_first_frame_stays_as_it_is() -> None:
    compiled = _core.TemporalFilter()
    np.testing.assert_array_equal(smoothed(compiled, frame(0)), frame(0)[2])
    assert not np.array_equal(smoothed(compiled, frame(1)), frame(1)[2])


def test_noise_of_a_still_scene_falls_to_less_than_half() -> None:
    compiled = _core.TemporalFilter()
    shots = [frame(number) for number in range(16)]
    found = np.array([smoothed(compiled, shot) for shot in shots])[6:]
    raw = np.array([shot[2] for shot in shots])[6:]
    assert found.std(axis=0).mean() < 0.45 * raw.std(axis=0).mean()
    assert np.abs(found - shots[0][1]).mean() < 0.6 * np.abs(raw - shots[0][1]).mean()


def test_a_moving_wall_is_followed() -> None:
    """The wall moves 5 px a frame: without compensation the slope alone would be an error of 0.2 px and more."""
    compiled = _core.TemporalFilter()
    errors = []
    for number in range(8):
        shot = frame(number, (5.0 * number, 2.0 * number))
        errors.append((smoothed(compiled, shot) - shot[1])[8:-8, 8:-8])
    assert np.abs(errors[4:]).mean() < 0.5 * np.abs(shot[2] - shot[1]).mean()
    assert abs(np.mean(errors[4:])) < 0.02


def test_nothing_trails_behind_a_tool() -> None:
    compiled = _core.TemporalFilter()
    for number in range(8):
        shot = frame(number, tool=20 + 18 * number)
        found = smoothed(compiled, shot)
    uncovered = found[:, 63:72]  # where the tool was in the frame before the last
    assert np.abs(uncovered - shot[1][:, 63:72]).max() < 1.0


def test_nothing_lags_behind_a_tool_that_comes_nearer() -> None:
    """Its disparity grows by 1 px a frame, which its picture does not tell; averages alone would lag by 9 px."""
    compiled = _core.TemporalFilter()
    behind = []
    for number in range(12):
        view, true, disparity, confidence = frame(number, tool=100)
        disparity[:, 50:62] += number
        true[:, 50:62] += number
        behind.append(np.mean((true - smoothed(compiled, (view, true, disparity, confidence)))[:, 52:60]))
    assert np.abs(behind).max() < 0.9


def test_another_scene_is_not_mixed_in() -> None:
    compiled = _core.TemporalFilter()
    smoothed(compiled, frame(0))
    _, true, disparity, confidence = frame(1)
    other = np.stack([texture(99)[:HEIGHT, :WIDTH].astype(np.uint8)] * 3), true, disparity + 9, confidence
    np.testing.assert_array_equal(smoothed(compiled, other), other[2])


def test_another_size_begins_anew() -> None:
    compiled = _core.TemporalFilter()
    smoothed(compiled, frame(0))
    other = frame(1, size=(90, 120))
    np.testing.assert_array_equal(smoothed(compiled, other), other[2])


def test_what_is_no_number_is_left_alone() -> None:
    compiled = _core.TemporalFilter()
    for number in range(3):
        shot = frame(number)
        shot[2][10:20, 10:20] = np.nan
        found = smoothed(compiled, shot)
    assert np.isnan(found[10:20, 10:20]).all()
    assert np.isfinite(found[40:]).all()
