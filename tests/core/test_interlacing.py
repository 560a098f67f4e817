"""Frames of an interlaced camera are called that, and no others."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk import Cause, DepthEstimator, Status, _core
from endosdk.io.pictures import read_frame
from tests.conftest import textured_picture
from tests.core.test_pose_error import RIG, cycles_pair
from tests.reference.interlacing import combed_share

LIMIT = _core.cause_facts[Cause.INTERLACED]["degraded"]


def two_moments(view: np.ndarray, px: int) -> np.ndarray:
    """A frame whose odd rows were taken after the camera had moved by so many px along the rows."""
    frame = view.copy()
    frame[1::2] = np.roll(view, px, axis=1)[1::2]
    return frame


@pytest.mark.parametrize("shape", [(160, 240), (486, 720, 3), (480, 640), (1080, 1920, 3)])
@pytest.mark.parametrize("moved", [0, 3, 12])
def test_share_equals_twin(shape, moved):
    view = textured_picture(*shape[:2])
    frame = two_moments(view if len(shape) == 3 else np.ascontiguousarray(view[..., 1]), moved)
    wide = np.zeros((shape[0], shape[1] + 7, *shape[2:]), np.uint8)
    wide[:, : shape[1]] = frame
    assert _core.combed_share(frame) == _core.combed_share(wide[:, : shape[1]]) == pytest.approx(combed_share(frame))


def test_frames_that_are_too_small_are_not_judged():
    for height, width in ((159, 240), (160, 239)):
        assert np.isnan(_core.combed_share(np.zeros((height, width, 3), np.uint8)))


def test_a_camera_that_moves_between_two_fields_is_named():
    left, right = cycles_pair(0)
    with DepthEstimator("fast", calibration=RIG) as estimator:
        still = estimator.predict(left, right)
        moving = estimator.predict(two_moments(left, 6), two_moments(right, 6))
        one = estimator.predict(left, two_moments(right, 6))
    assert Cause.INTERLACED not in still.causes and still.measures[Cause.INTERLACED] == 0
    for result in (moving, one):
        assert result.status == Status.DEGRADED
        assert result.causes[Cause.INTERLACED] > 2 * LIMIT


def spoilt(view: np.ndarray) -> list[np.ndarray]:
    """What rows of one moment may look like: noise, sharpening, compression, blur, text."""
    rng = np.random.default_rng(0)
    _, packed = cv2.imencode(".jpg", view, [cv2.IMWRITE_JPEG_QUALITY, 20])
    text = view.copy()
    for y in range(30, view.shape[0], 30):
        cv2.putText(text, "PATIENT 01 12:34 ZOOM x1.1", (20, y), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (255,) * 3, 1)
    return [
        np.clip(view + rng.normal(0, 20, view.shape), 0, 255).astype(np.uint8),
        cv2.addWeighted(view, 3, cv2.GaussianBlur(view, (0, 0), 1), -2, 0),
        cv2.imdecode(packed, cv2.IMREAD_COLOR),
        cv2.GaussianBlur(view, (0, 0), 3),
        text,
    ]


def test_frames_of_one_moment_are_not():
    for number in range(3):
        for view in cycles_pair(number):
            assert all(_core.combed_share(frame) < LIMIT / 4 for frame in (view, *spoilt(view)))


def test_real_frames(shared_data):
    """Two of the five pairs of this laparoscope, which is interlaced, show that it moved."""
    frames = {path.name: path for path in (shared_data / "chessboard").glob("*/*.png")}
    combed = {name for name, path in frames.items() if _core.combed_share(read_frame(path)) >= LIMIT}
    assert combed == {f"{side}-{number}.png" for side in ("left", "right") for number in (1095, 4848)}
    still = [*(shared_data / "scared_rectified").glob("*.png"), *(shared_data / "hamlyn_phantom").glob("*_[LR]_*.png")]
    assert len(still) == 4
    assert max(_core.combed_share(read_frame(path)) for path in still) == 0
