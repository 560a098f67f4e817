"""The calibration of a stereo rig, and the rectified geometry that follows from it.

Lengths are millimetres, image coordinates put (0, 0) at the centre of the first pixel, and matrices follow OpenCV:
a point of the left camera becomes ``rotation @ point + translation`` in the right camera, so the translation's x is
negative when the right camera sits to the right.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, get_args

import numpy as np

from endosdk import _core
from endosdk.calibration.rectified_geometry import Matrix, RectifiedGeometry, scale_rows, shift_centre
from endosdk.calibration.rules import (
    CameraModel,
    Ellipse,
    check_alpha,
    check_camera_matrix,
    check_crop,
    check_distortion,
    check_field_of_view,
    check_plausible_baseline,
    check_principal_point,
    check_rotation,
    check_size,
    check_translation,
    finite_array,
    number,
)
from endosdk.errors import CalibrationUnreadable, InvalidArgument, InvalidCalibration

if TYPE_CHECKING:
    from endosdk.calibration.files.stated import StatedRig

MODELS = get_args(CameraModel)


@dataclass(frozen=True, eq=False)
class StereoCalibration:
    """Two cameras and how they stand to each other; lengths in mm, arrays float64 and read-only.

    ``left_matrix`` and ``right_matrix`` are [3,3]; distortions hold 0, 4, 5 or 8 Brown-Conrady coefficients for
    ``pinhole`` and 0 or 4 for ``fisheye``; ``rotation`` is [3,3] and ``translation`` [3], left to right. Fields of view
    are the ellipses that the optics fill, middle x, y and half axes along x and y, px of the raw frame; where one is
    None, it is found in each picture. Raises `InvalidCalibration` when the numbers cannot describe a rig with the right
    camera on the right.
    """

    width: int
    height: int
    left_matrix: Matrix
    right_matrix: Matrix
    left_distortion: Matrix
    right_distortion: Matrix
    rotation: Matrix
    translation: Matrix
    model: CameraModel = "pinhole"
    left_field_of_view: Ellipse | None = None
    right_field_of_view: Ellipse | None = None

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise InvalidCalibration("model", f"must be one of {', '.join(MODELS)}", repr(self.model))
        width, height = check_size("size", (self.width, self.height))
        checked: dict[str, Any] = {
            "width": width,
            "height": height,
            "left_matrix": check_camera_matrix("left_matrix", self.left_matrix),
            "right_matrix": check_camera_matrix("right_matrix", self.right_matrix),
            "left_distortion": check_distortion("left_distortion", self.left_distortion, self.model),
            "right_distortion": check_distortion("right_distortion", self.right_distortion, self.model),
            "rotation": check_rotation("rotation", self.rotation),
            "translation": check_translation("translation", self.translation),
            "left_field_of_view": check_field_of_view("left_field_of_view", self.left_field_of_view, (width, height)),
            "right_field_of_view": check_field_of_view(
                "right_field_of_view", self.right_field_of_view, (width, height)
            ),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        check_plausible_baseline(self.baseline_mm)

    def __repr__(self) -> str:
        """One line for people: matrices are not printed."""
        kind = f"{self.model}, rectified" if self.is_rectified else self.model
        return (
            f"<StereoCalibration {self.width}x{self.height}, {kind}: focal length {self.left_matrix[0, 0]:.1f} px, "
            f"baseline {self.baseline_mm:.2f} mm, SHA-256 {self.sha256[:12]}...>"
        )

    @classmethod
    def load(
        cls,
        path: str | Path | Sequence[str | Path],
        *,
        size: tuple[int, int] | None = None,
        layout: str | None = None,
        units: str | None = None,
    ) -> StereoCalibration:
        """Read a calibration file, a folder or a (left, right) pair of files.

        The layout is recognised from the content; ``layout`` names one of ``calibration.files.LAYOUTS`` instead.
        ``size`` is (width, height) for layouts that hold none, and must agree with a file that does. ``units`` is
        "mm", "cm" or "m" when the file's lengths are not in the unit of its layout (ROS, Kalibr and FoundationStereo
        are in metres, the others in mm). Raises `CalibrationUnreadable`, `CalibrationSizeMismatch` or
        `InvalidCalibration`.
        """
        from endosdk.calibration import files

        return cls._checked(files.read(path, size=size, layout=layout, units=units))

    @classmethod
    def _checked(cls, stated: StatedRig) -> StereoCalibration:
        """Build from what files state; errors name the file."""
        try:
            calibration = cls(**stated.fields)
        except (InvalidArgument, InvalidCalibration) as error:  # the first: a width or a height
            unit = f", read in {stated.unit}; pass units= if the file is in mm, cm or m"
            rule = error.rule + (unit if error.argument == "baseline" else "")
            raise InvalidCalibration(f"{stated.source}: {error.argument}", rule, error.value) from error
        if stated.size_given:
            for side, matrix in (("left", calibration.left_matrix), ("right", calibration.right_matrix)):
                check_principal_point(side, matrix, (calibration.width, calibration.height), stated.source)
        if stated.sha256 not in (None, calibration.sha256):
            rule = f"must be the hash of the content, {calibration.sha256}; remove it if the file was edited on purpose"
            raise CalibrationUnreadable(f"{stated.source}: sha256", rule, stated.sha256)
        return calibration

    @classmethod
    def rectified(
        cls,
        focal_px: float,
        baseline_mm: float,
        size: tuple[int, int],
        cx: float | None = None,
        cy: float | None = None,
        doffs: float = 0.0,
    ) -> StereoCalibration:
        """Describe pairs that are already rectified; the principal point defaults to the middle of the picture.

        ``doffs`` is the right camera's cx minus the left camera's, in pixels. Where it is positive, surfaces beyond
        ``focal_px * baseline_mm / doffs`` have negative disparities, which networks do not find: `DepthEstimator` shows
        them the right view moved by ``doffs``.
        """
        width, height = check_size("size", size)
        baseline = number("baseline_mm", baseline_mm)
        if not baseline > 0:
            raise InvalidCalibration("baseline_mm", "must be positive", baseline)
        focal = number("focal_px", focal_px)
        left = np.array(
            [
                [focal, 0.0, (width - 1) / 2 if cx is None else number("cx", cx)],
                [0.0, focal, (height - 1) / 2 if cy is None else number("cy", cy)],
                [0.0, 0.0, 1.0],
            ]
        )
        right = left.copy()
        right[0, 2] += number("doffs", doffs)
        none = np.zeros(0)
        return cls(width, height, left, right, none, none, np.eye(3), np.array([-baseline, 0.0, 0.0]))

    @property
    def baseline_mm(self) -> float:
        """Distance between the two camera centres, in mm."""
        return float(np.linalg.norm(self.translation))

    @property
    def is_rectified(self) -> bool:
        """Whether pictures of this rig need no rectification: no distortion, parallel axes, equal rows and focal."""
        return _core.is_rectified(self.numbers())

    def numbers(self) -> tuple[Any, ...]:
        """Return the rig as the core takes it."""
        left, right = (self.left_matrix, self.left_distortion), (self.right_matrix, self.right_distortion)
        fields = (field or (0.0, 0.0, 0.0, 0.0) for field in (self.left_field_of_view, self.right_field_of_view))
        return self.model, self.width, self.height, *left, *right, self.rotation, self.translation, *fields

    def content(self) -> dict[str, Any]:
        """Return every field as JSON values; what `sha256` is taken of and `save` writes."""
        return {
            "units": "mm",
            "model": self.model,
            "width": self.width,
            "height": self.height,
            "left": _camera(self.left_matrix, self.left_distortion, self.left_field_of_view),
            "right": _camera(self.right_matrix, self.right_distortion, self.right_field_of_view),
            "rotation": self.rotation.tolist(),
            "translation": self.translation.tolist(),
        }

    @cached_property
    def sha256(self) -> str:
        """Hash of the content, independent of the file it came from, so that a result can be traced to its rig."""
        canonical = json.dumps(self.content(), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(canonical.encode()).hexdigest()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, StereoCalibration):
            return NotImplemented
        return self.content() == other.content()

    def __hash__(self) -> int:
        return hash((self.width, self.height, self.model, self.left_matrix.tobytes(), self.translation.tobytes()))

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        """Copy and pickle through the constructor, because arrays come back from a pickle writable."""
        return type(self), tuple(getattr(self, part.name) for part in fields(self))

    def save(self, path: str | Path) -> list[Path]:
        """Write endosdk's own layout, YAML or JSON by the name's ending; what is read back is equal.

        A name that ends in ``.opencv.yaml``, ``.ros.yaml`` or ``.kalibr.yaml`` asks for the layout of that program; ROS
        has two files. None of them holds a field of view: the log ``endosdk`` warns where one is stated. Returns the
        files written. Raises `StorageFailed`, and InvalidArgument for another ending, or for Kalibr's with more than
        four coefficients of distortion.
        """
        from endosdk.calibration.files import exports, native

        exports.check_name("path", path)
        writer = exports.writer_of(Path(path))
        if writer is not None:
            return exports.write_export(writer, self, Path(path))
        native.write(self.content(), self.sha256, Path(path))
        return [Path(path)]

    def scaled(self, width: int, height: int) -> Self:
        """Return the calibration of the same pictures resized to ``width`` x ``height``."""
        new_width, new_height = check_size("size", (width, height))
        scale = new_width / self.width, new_height / self.height
        return replace(
            self,
            width=new_width,
            height=new_height,
            left_matrix=scale_rows(self.left_matrix, *scale),
            right_matrix=scale_rows(self.right_matrix, *scale),
            left_field_of_view=_scaled(self.left_field_of_view, *scale),
            right_field_of_view=_scaled(self.right_field_of_view, *scale),
        )

    def cropped(self, x: int, y: int, width: int, height: int) -> Self:
        """Return the calibration of the window at (x, y) that is cut out of both pictures."""
        x, y, width, height = check_crop((x, y, width, height), (self.width, self.height))
        return replace(
            self,
            width=width,
            height=height,
            left_matrix=shift_centre(self.left_matrix, x, y),
            right_matrix=shift_centre(self.right_matrix, x, y),
            left_field_of_view=_shifted(self.left_field_of_view, x, y),
            right_field_of_view=_shifted(self.right_field_of_view, x, y),
        )

    def turned(self, rotation_deg: Sequence[float]) -> Self:
        """Return the calibration after the right camera turned about its own centre.

        ``rotation_deg`` is a rotation vector about x, y and z of the rectified frame, degrees, as
        `DepthResult.rig` states it: that of the points that the camera sees. It turned the other way itself.
        """
        vector = np.radians(finite_array("rotation_deg", rotation_deg, (3,)))
        frame = self.rectification().R2
        turn = frame.T @ _core.rotation_matrix(vector) @ frame
        return replace(self, rotation=turn @ self.rotation, translation=turn @ self.translation)

    def rectification(self, size: tuple[int, int] | None = None, alpha: float = 0.0) -> RectifiedGeometry:
        """Return the geometry of the rectified pair, equal to OpenCV's ``stereoRectify`` with zero disparity.

        ``size`` is the rectified (width, height), by default that of the raw pictures; another size is the same view
        resampled. ``alpha`` 0 keeps only pixels that both sources cover, 1 keeps every source pixel, -1 leaves the
        choice to OpenCV's rule. A pair that is already rectified stays as it is. Two departures from OpenCV: where it
        would enlarge a view more than 1.5 times for an ``alpha`` of 0, as that of cropped frames, the principal point
        moves instead; and pixels that are over 5 % from square, as in half-width video, keep their form, where its
        square ones would show half of the scene.
        """
        left_turn, right_turn, left_view, right_view = _core.rig_geometry(self.numbers(), check_alpha(alpha))
        geometry = RectifiedGeometry(left_turn, right_turn, left_view, right_view, self.width, self.height)
        return geometry if size is None else geometry.scaled(*check_size("size", size))


def check_calibration(calibration: object) -> StereoCalibration:
    """Return what is a calibration. Raises InvalidArgument for anything else."""
    if not isinstance(calibration, StereoCalibration):
        raise InvalidArgument("calibration", "must be a StereoCalibration", type(calibration).__name__)
    return calibration


def _camera(matrix: Matrix, distortion: Matrix, field: Ellipse | None) -> dict[str, Any]:
    stated = {} if field is None else {"field_of_view": list(field)}
    return {"matrix": matrix.tolist(), "distortion": distortion.tolist(), **stated}


def _scaled(field: Ellipse | None, scale_x: float, scale_y: float) -> Ellipse | None:
    if field is None:
        return None
    x, y, across, down = field
    return (x + 0.5) * scale_x - 0.5, (y + 0.5) * scale_y - 0.5, across * scale_x, down * scale_y


def _shifted(field: Ellipse | None, x: int, y: int) -> Ellipse | None:
    return None if field is None else (field[0] - x, field[1] - y, field[2], field[3])
