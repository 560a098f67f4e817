"""Tell from the pictures alone whether a pair is rectified: how far matching points lie on different rows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument

# Fewer matches than this can be one repeated glare; no number is given then.
MIN_MATCHES = 30
# A match must beat the second best by this factor (the ratio usual for SIFT).
DISTINCT_RATIO = 0.75
# Points that fit one epipolar geometry; a rectified pair and a raw one both have such a geometry.
EPIPOLAR_PX = 1.5
MAX_FEATURES = 4000
# Half of OpenCV's default: wet tissue has little contrast, and wrong matches fall to the tests that follow.
CONTRAST = 0.02


@dataclass(frozen=True)
class VerticalDisparity:
    """Vertical disparity of matching points in px: median and 95th percentile of its size, and how many matches.

    Both are None when fewer than `MIN_MATCHES` matches survived: the pair cannot be judged.
    """

    median_px: float | None
    p95_px: float | None
    matches: int


def vertical_disparity(left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8]) -> VerticalDisparity:
    """Match features between two uint8 pictures [H,W] or [H,W,3] (RGB or BGR) and compare their rows.

    Takes about a second at 1280x1024. Raises `InvalidArgument` for anything that is no pair of pictures.
    """
    import cv2

    views = [_gray(name, picture) for name, picture in (("left", left), ("right", right))]
    detector = cv2.SIFT.create(nfeatures=MAX_FEATURES, contrastThreshold=CONTRAST)
    (left_points, left_words), (right_points, right_words) = (detector.detectAndCompute(view, None) for view in views)
    if left_words is None or right_words is None or min(len(left_words), len(right_words)) < MIN_MATCHES:
        return VerticalDisparity(None, None, 0)
    pairs = _mutual_matches(left_words, right_words)
    a = np.array([left_points[i].pt for i, _ in pairs]).reshape(-1, 2)
    b = np.array([right_points[j].pt for _, j in pairs]).reshape(-1, 2)
    if len(pairs) >= MIN_MATCHES:
        _, inliers = cv2.findFundamentalMat(a, b, cv2.FM_RANSAC, EPIPOLAR_PX, 0.999)
        kept = np.zeros(len(pairs), bool) if inliers is None else inliers.ravel().astype(bool)
        a, b = a[kept], b[kept]
    if len(a) < MIN_MATCHES:
        return VerticalDisparity(None, None, len(a))
    rows = np.abs(a[:, 1] - b[:, 1])
    return VerticalDisparity(float(np.median(rows)), float(np.percentile(rows, 95)), len(a))


def _gray(name: str, picture: Any) -> npt.NDArray[np.uint8]:
    if not isinstance(picture, np.ndarray) or picture.dtype != np.uint8 or picture.size == 0:
        seen = getattr(picture, "dtype", type(picture).__name__)
        raise InvalidArgument(name, "must be a uint8 picture that is not empty", seen)
    if picture.ndim == 3 and picture.shape[2] == 3:
        # Green has the finest grain in an endoscope's picture, and needs no word on the channel order.
        return np.ascontiguousarray(picture[:, :, 1])
    if picture.ndim == 3 and picture.shape[2] == 1:
        picture = picture[:, :, 0]
    if picture.ndim != 2:
        raise InvalidArgument(name, "must be [H, W], [H, W, 1] or [H, W, 3]", picture.shape)
    return np.ascontiguousarray(picture)


def _mutual_matches(left_words: Any, right_words: Any) -> list[tuple[int, int]]:
    """Return index pairs that choose each other and are distinct from the second choice."""
    import cv2

    matcher = cv2.BFMatcher(cv2.NORM_L2)
    forward = _distinct(matcher.knnMatch(left_words, right_words, k=2))
    backward = _distinct(matcher.knnMatch(right_words, left_words, k=2))
    return [(i, j) for i, j in forward.items() if backward.get(j) == i]


def _distinct(candidates: Any) -> dict[int, int]:
    return {
        best.queryIdx: best.trainIdx
        for best, second in (pair for pair in candidates if len(pair) == 2)
        if best.distance < DISTINCT_RATIO * second.distance
    }
