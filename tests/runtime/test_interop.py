"""Results for other libraries, where these are installed."""

import builtins

import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration
from endosdk.errors import CalibrationRequired, DependencyMissing, InvalidArgument
from tests.conftest import TINY_MODEL, shifted_pair

RIG = StereoCalibration.rectified(focal_px=200.0, baseline_mm=5.0, size=(160, 96))


@pytest.fixture(scope="module")
def predicted():
    left, right = shifted_pair(96, 160, 10)
    return left, DepthEstimator(str(TINY_MODEL), calibration=RIG).predict(left, right)


def test_open3d_gets_the_points_and_their_colours(predicted):
    pytest.importorskip("open3d", reason="no open3d: pip install open3d")
    left, result = predicted
    cloud = result.to_open3d(left)
    known = np.isfinite(result.depth)
    assert np.asarray(cloud.points) == pytest.approx(result.points()[known], rel=1e-6)
    assert np.asarray(cloud.colors) * 255 == pytest.approx(left[known], abs=1e-6)


def test_rerun_gets_a_recording(predicted, tmp_path):
    rerun = pytest.importorskip("rerun", reason="no rerun: pip install rerun-sdk")
    left, result = predicted
    rerun.init("endosdk-test")
    rerun.save(tmp_path / "r.rrd")
    rerun.set_time("frame", sequence=0)
    result.to_rerun(left)
    rerun.disconnect()
    content = (tmp_path / "r.rrd").read_bytes()
    assert content.startswith(b"RRF")
    assert len(content) > 4 * np.isfinite(result.depth).sum()


def test_what_does_not_fit_is_refused(predicted):
    left, result = predicted
    with pytest.raises(InvalidArgument, match="left"):
        result.to_open3d(left[:-1])
    with pytest.raises(CalibrationRequired):
        DepthEstimator(str(TINY_MODEL)).predict(left, left).to_rerun()


@pytest.mark.parametrize("name", ["open3d", "rerun"])
def test_a_library_that_is_missing_is_named(predicted, monkeypatch, name):
    real = builtins.__import__

    def without(wanted, *words, **more):
        if wanted == name:
            raise ImportError(wanted)
        return real(wanted, *words, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(DependencyMissing, match="pip install"):
        getattr(predicted[1], f"to_{name}")()
