"""Depth over the raw left view, which is what a monitor shows."""

from __future__ import annotations

import numpy as np

from endosdk.calibration.rig import StereoCalibration, check_calibration
from endosdk.errors import InvalidArgument
from endosdk.measure.geometry import raw_to_rectified
from endosdk.measure.lengths import check_result
from endosdk.runtime.maps import FloatMap
from endosdk.runtime.result import DepthResult


class RawLeftView:
    """Puts the maps of results over the raw left view of one rig.

    Make it once for a rig and keep it: it finds the rectified pixel of every raw one, which takes as long as many
    frames do. It never changes, so threads may share it. The border of a raw view lies outside the rectified one
    as a rule, and has no depth there.
    """

    def __init__(self, calibration: StereoCalibration) -> None:
        self._calibration_sha256 = check_calibration(calibration).sha256
        geometry = calibration.rectification()
        rows, columns = np.indices((calibration.height, calibration.width))
        # No number where the lens model has no ray for a raw pixel; the comparisons below are then false.
        found = raw_to_rectified(calibration, np.stack([columns, rows], axis=-1))
        nearest = np.rint(found)
        inside = np.all((nearest >= 0) & (nearest < (geometry.width, geometry.height)), axis=-1)
        x, y = np.where(np.expand_dims(inside, -1), nearest, 0).astype(np.intp).transpose(2, 0, 1)
        self._source = y * geometry.width + x
        # The third column of R1 is the raw axis in the rectified frame: a point's part along it is its raw depth.
        sight = (found - (geometry.cx, geometry.cy)) / (geometry.focal_px, geometry.focal_y_px)
        share = sight @ geometry.R1[:2, 2] + geometry.R1[2, 2]
        self._share = np.where(inside, share, np.nan).astype(np.float32)

    def depth(self, result: DepthResult) -> FloatMap:
        """Return the depth of every raw left pixel along the optical axis of the raw left camera, mm, float32 [H, W].

        Each pixel has the depth of the rectified pixel that is nearest to it, turned into the raw camera: the axes of
        the two cameras differ by the rotation of the rectification, and `DepthResult.depth` is along the rectified one.
        NaN where that pixel has no depth, and outside the rectified view. Raises `CalibrationRequired` for a result
        without a calibration, and `InvalidArgument` for one of another rig.
        """
        check_result(result)
        return self._seen(result, result.depth)

    def sigma(self, result: DepthResult) -> FloatMap:
        """Return the expected absolute error of `depth`, mm, float32 [H, W]; NaN and errors as for `depth`."""
        check_result(result)
        return self._seen(result, result.sigma)

    def _seen(self, result: DepthResult, values: FloatMap) -> FloatMap:
        if result.calibration_sha256 != self._calibration_sha256:
            rule = f"must be of the rig of this view, whose SHA-256 is {self._calibration_sha256}"
            raise InvalidArgument("result", rule, result.calibration_sha256)
        return np.asarray(values.ravel()[self._source] * self._share)
