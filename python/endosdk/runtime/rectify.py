"""From two camera frames to the padded planar RGB pictures that the session reads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.calibration.rig import RectifiedGeometry, StereoCalibration
from endosdk.errors import CalibrationSizeMismatch, InvalidArgument

Frame = npt.NDArray[np.uint8]

# Principal points closer together than this, px, put the end of the range so far away that no endoscope sees it.
HARMLESS_DOFFS = 0.5

CHANNEL_ORDERS = ("rgb", "bgr")


def check_pair(left: object, right: object) -> tuple[Frame, Frame]:
    """Return both frames as arrays the kernels accept; refuse what is no uint8 picture or no pair."""
    pair = _check_frame("left", left), _check_frame("right", right)
    if pair[0].shape != pair[1].shape:
        raise InvalidArgument("right", f"must have the shape of left, {pair[0].shape}", pair[1].shape)
    return pair


class RectifyStage:
    """Rectifies raw frames of one size, or only repacks frames that are rectified already.

    ``frame_size`` is (width, height) of the frames; ``network_size``, likewise, of the pictures written, before
    padding. Both stay readable, the second as ``size``.

    A rectified rig whose principal points lie apart sees what is beyond ``focal_px * baseline_mm / doffs`` at negative
    disparities, which no network finds. Its right view is moved by doffs: ``right_shift``, px of the frame.
    """

    def __init__(
        self,
        frame_size: tuple[int, int],
        calibration: StereoCalibration | None,
        network_size: tuple[int, int],
    ) -> None:
        if calibration is not None and frame_size != (calibration.width, calibration.height):
            raise CalibrationSizeMismatch(
                "calibration",
                f"must be for frames of {frame_size[0]}x{frame_size[1]} (see StereoCalibration.scaled and .cropped)",
                f"{calibration.width}x{calibration.height}",
            )
        self.frame_size = frame_size
        self.size = network_size
        self.valid_left: Frame | None = None
        self.valid_right: Frame | None = None
        self._rectifier: _core.Rectifier | None = None
        self.right_shift = _shift(calibration)
        moves = calibration is not None and (not calibration.is_rectified or self.right_shift > 0)
        if not moves and self.size == frame_size:
            return
        source = calibration if moves and calibration else _identity(frame_size)
        geometry = _shifted(source.rectification(), self.right_shift)
        self._rectifier = _rectifier(source, geometry.scaled(*self.size), whole_border=not moves)
        if moves:
            # The masks belong to the maps that are returned, which keep the size of the frames.
            full = self._rectifier if self.size == frame_size else _rectifier(source, geometry, whole_border=False)
            self.valid_left, self.valid_right = full.valid_left, full.valid_right

    def __call__(self, left: Frame, right: Frame, out_left: Frame, out_right: Frame, order: str) -> None:
        """Write planar RGB uint8 [3, Hp, Wp] into ``out_left`` and ``out_right``; the pad repeats the last pixels."""
        order = "gray" if left.ndim == 2 or left.shape[2] == 1 else order
        if self._rectifier is None:
            _core.pack(left, right, out_left, out_right, order)
        else:
            self._rectifier.rectify(left, right, out_left, out_right, order)


def _shift(calibration: StereoCalibration | None) -> float:
    if calibration is None or not calibration.is_rectified:
        return 0.0
    doffs = calibration.rectification().doffs
    return doffs if doffs > HARMLESS_DOFFS else 0.0


def _shifted(geometry: RectifiedGeometry, shift: float) -> RectifiedGeometry:
    right = geometry.P2.copy()
    right[0, 2] -= shift
    return replace(geometry, P2=right)


def _check_frame(name: str, frame: object) -> Frame:
    if not isinstance(frame, np.ndarray):
        raise InvalidArgument(name, "must be a NumPy array", type(frame).__name__)
    if frame.dtype != np.uint8:
        raise InvalidArgument(name, "must be uint8, 0..255", frame.dtype)
    if frame.ndim not in (2, 3) or (frame.ndim == 3 and frame.shape[2] not in (1, 3)):
        raise InvalidArgument(name, "must be [H, W], [H, W, 1] or [H, W, 3]", frame.shape)
    if frame.size == 0:
        raise InvalidArgument(name, "must not be empty", frame.shape)
    # Kernels take any row pitch but need the pixels of a row side by side.
    pixel_bytes = 1 if frame.ndim == 2 else frame.shape[2]
    packed = frame.strides[1] == pixel_bytes and (frame.ndim == 2 or frame.strides[2] == 1)
    return frame if packed and frame.strides[0] > 0 else np.ascontiguousarray(frame)


def _identity(size: tuple[int, int]) -> StereoCalibration:
    # Any focal length and baseline do: only the change of size is used.
    return StereoCalibration.rectified(focal_px=float(max(size)), baseline_mm=1.0, size=size)


def _rectifier(calibration: StereoCalibration, geometry: RectifiedGeometry, *, whole_border: bool) -> _core.Rectifier:
    c, g = calibration, geometry
    return _core.Rectifier(
        c.width,
        c.height,
        g.width,
        g.height,
        (c.model, c.left_matrix, c.left_distortion, g.R1, g.P1),
        (c.model, c.right_matrix, c.right_distortion, g.R2, g.P2),
        whole_border,
    )
