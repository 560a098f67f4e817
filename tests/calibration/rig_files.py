"""What the tests of all layouts share: the rig that was written, and whether it came back."""

from __future__ import annotations

import numpy as np

from endosdk.calibration.rig import StereoCalibration
from tests.rigs import raw_rig

load = StereoCalibration.load
RIG = raw_rig()
SIZE = (RIG.width, RIG.height)


def assert_same_rig(seen: StereoCalibration, expected: StereoCalibration) -> None:
    assert (seen.width, seen.height, seen.model) == (expected.width, expected.height, expected.model)
    for name in ("left_matrix", "right_matrix", "left_distortion", "right_distortion", "rotation", "translation"):
        np.testing.assert_allclose(getattr(seen, name), getattr(expected, name), rtol=1e-12, atol=1e-12, err_msg=name)
