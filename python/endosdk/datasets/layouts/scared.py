"""SCARED: porcine abdomen with truth from structured light (Allan et al., 2021).

``dataset_N/keyframe_M/``, or ``test_dataset_N/keyframe_M/``, holds ``Left_Image.png``, ``Right_Image.png``,
``endoscope_calibration.yaml`` and ``left_depth_map.tiff``: for each pixel of the raw left view the point it shows, x,
y, z in mm in the left camera. Where ``data/scene_points.tar.gz`` has been unpacked in ``data/``, with or without a
folder of its own, the frames of ``data/rgb.mp4`` (left view above the right one) are samples too. Their points come
from the keyframe by the camera's motion and are less exact.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration
from endosdk.datasets.dataset import Sample, read_colours
from endosdk.datasets.layouts.public import PublicReader
from endosdk.errors import DatasetInvalid
from endosdk.io.bounded_read import Refused
from endosdk.io.picture_bytes import read_picture

_SET_NAME = re.compile(r"dataset_?(\d+)")
_TRAIN_SETS = range(1, 8)
_TEST_SETS = (8, 9)  # those that the challenge was judged on
_SAME_SURFACE_PX = 0.5


class ScaredReader(PublicReader):
    """Keyframes and unpacked video frames, rectified here, with the truth brought to the rectified left view."""

    layout = "scared"
    splits = ("train", "test")
    default_split = "test"
    pattern = "dataset_N/keyframe_M/left_depth_map.tiff, N 1 to 7 for train, 8 and 9 for test"

    def find(self) -> dict[str, tuple[Path, ...]]:
        """List the frames of the sets of this split: 1 to 7 for training, 8 and 9 for testing."""
        found: dict[str, tuple[Path, ...]] = {}
        for folder in sorted(self.root.glob("*dataset*/keyframe*")):
            named = _SET_NAME.search(folder.parent.name)
            if named is None or int(named[1]) not in (*_TRAIN_SETS, *_TEST_SETS):
                rule = "must hold dataset_1 to dataset_7 for train, and dataset_8 and dataset_9 for test"
                raise DatasetInvalid("dataset", rule, folder.parent)
            if int(named[1]) not in (_TEST_SETS if self.split == "test" else _TRAIN_SETS):
                continue
            name, calibration = f"{folder.parent.name}/{folder.name}", folder / "endoscope_calibration.yaml"
            if (folder / "left_depth_map.tiff").exists():
                views = folder / "Left_Image.png", folder / "Right_Image.png"
                found[name] = (*views, folder / "left_depth_map.tiff", calibration)
            video = folder / "data" / "rgb.mp4"
            for points in sorted((folder / "data").rglob("scene_points*.tiff")):
                found[f"{name}/{points.stem.removeprefix('scene_points')}"] = (video, points, calibration)
        return found

    def film(self, index: int) -> str:
        """Name the keyframe around which a sample was filmed."""
        return "/".join(self.ids[index].split("/")[:2])

    def read(self, sample_id: str, files: tuple[Path, ...]) -> Sample:
        """Read and rectify one frame."""
        *views, cloud, calibration = files
        points = _read_points(cloud)
        if len(views) == 2:
            left, right = (read_colours(view) for view in views)
        else:
            left, right = _video_frame(views[0], int(sample_id.rsplit("/", 1)[1]))
            points = points[: points.shape[0] // 2]  # those of the right view lie below
        if points.shape[:2] != left.shape[:2]:
            raise DatasetInvalid("sample", f"{cloud.name} must be as large as the left view", points.shape[:2])
        rig = StereoCalibration.load(calibration, size=(left.shape[1], left.shape[0]))
        geometry = rig.rectification()
        left_map, right_map = _maps(rig, geometry)
        return Sample(
            id=sample_id,
            left=_sampled(left, left_map),
            right=_sampled(right, right_map),
            disparity=_true_disparity(points, geometry, left_map),
            disparity_right=None,
            occlusion=None,
            focal_px=geometry.focal_px,
            baseline_mm=geometry.baseline_mm,
            doffs=geometry.doffs,
            info={"layout": self.layout},
        )


def _read_points(path: Path) -> NDArray[np.float32]:
    try:
        points = read_picture(path, "IMREAD_UNCHANGED")
    except Refused as error:
        raise DatasetInvalid("sample", f"{path.name} {error.rule}", f"{error.value} in {path}") from error
    if points.dtype != np.float32 or points.ndim != 3 or points.shape[2] != 3:
        raise DatasetInvalid("sample", f"{path.name} must be a float32 picture of x, y, z", path)
    return np.asarray(points[..., ::-1])  # OpenCV turns the order of channels


def _video_frame(path: Path, index: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    import cv2

    video = cv2.VideoCapture(str(path))
    try:
        video.set(cv2.CAP_PROP_POS_FRAMES, index)
        there, frame = video.read()
    finally:
        video.release()
    if not there:
        raise DatasetInvalid("sample", f"{path.name} must be a video with frame {index}", path)
    colours = np.ascontiguousarray(np.asarray(frame, dtype=np.uint8)[..., ::-1])
    half = colours.shape[0] // 2
    return colours[:half], colours[half:]


def _maps(rig: StereoCalibration, geometry: RectifiedGeometry) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return where in its raw view each rectified pixel looks, left and right: float32 [H, W, 2], column then row."""
    import cv2

    size = (geometry.width, geometry.height)
    cameras = (
        (rig.left_matrix, rig.left_distortion, geometry.R1, geometry.P1),
        (rig.right_matrix, rig.right_distortion, geometry.R2, geometry.P2),
    )
    left, right = (np.stack(cv2.initUndistortRectifyMap(*camera, size, cv2.CV_32FC1), -1) for camera in cameras)
    return left.astype(np.float32, copy=False), right.astype(np.float32, copy=False)


def _sampled(view: NDArray[np.uint8], where: NDArray[np.float32]) -> NDArray[np.uint8]:
    import cv2

    return np.asarray(cv2.remap(view, where[..., 0], where[..., 1], cv2.INTER_LINEAR), dtype=np.uint8)


def _true_disparity(
    points: NDArray[np.float32], geometry: RectifiedGeometry, where: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Disparity [H, W] in the rectified left view of the points that the raw one shows; NaN where there is none.

    On one surface it is interpolated between pixels; across an edge, where a mean would be a surface that is not
    there, the nearest pixel's value is taken.
    """
    import cv2

    depth = points @ geometry.R1[2].astype(np.float32)
    known = np.isfinite(depth) & (depth > 0)
    raw = np.full(depth.shape, np.nan, np.float32)
    raw[known] = geometry.disparity_of(depth[known])
    smooth, nearest = (
        cv2.remap(raw, where[..., 0], where[..., 1], mode, borderMode=cv2.BORDER_CONSTANT, borderValue=(np.nan,) * 4)
        for mode in (cv2.INTER_LINEAR, cv2.INTER_NEAREST)
    )
    with np.errstate(invalid="ignore"):
        one_surface = np.abs(smooth - nearest) < _SAME_SURFACE_PX
    return np.where(one_surface, smooth, nearest).astype(np.float32)
