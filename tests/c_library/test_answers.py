"""The same frames give the same answers by the C library as by the Python package."""

from __future__ import annotations

import ctypes
import hashlib
import json
import logging
import math
from pathlib import Path

import numpy as np
import pytest

import endosdk
from endosdk.datasets.dataset import read_disparity
from endosdk.io.pictures import read_frame
from endosdk.runtime.models import shipped_models
from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.core.test_pose_error import RIG, cycles_pair, turned
from tests.rigs import fisheye_rig, raw_rig

DEMO = ROOT / "examples" / "data" / "demo"
RIGS = {
    "no rig": lambda: None,
    "raw": raw_rig,
    "fisheye": fisheye_rig,
    "stated field of view": lambda: raw_rig(
        left_field_of_view=(310, 230, 260, 220), right_field_of_view=(325.5, 240, 250, 235)
    ),
    "rectified": lambda: endosdk.StereoCalibration.rectified(520.0, 4.5, (640, 480), doffs=3.5),
}


@pytest.mark.parametrize("name", ["fast-fp32", "accurate-fp32"])
def test_functions_of_files_give_the_same_bytes(library, name):
    """A file computed by the bodies of its functions differs in its last digits."""
    model = shipped_models()[name]
    left, right = shifted_pair(245, 331, 11)
    with endosdk.DepthEstimator(model, network_size=(256, 192)) as python:
        expected = python.predict(left, right)
    estimator = c.CEstimator(library, model, None, network_width=256, network_height=192)
    _, maps = estimator.predict(left, right, maps=("disparity", "confidence"))
    estimator.close()
    np.testing.assert_array_equal(maps["disparity"], expected.disparity)
    np.testing.assert_array_equal(maps["confidence"], expected.confidence)


@pytest.mark.parametrize("rig_name", RIGS)
@pytest.mark.parametrize(
    ("size", "network_size"), [((640, 480), None), ((640, 480), (320, 200)), ((331, 245), None)], ids=str
)
def test_same_maps_as_python(library, rig_name, size, network_size):
    rig = RIGS[rig_name]()
    if rig is not None and size != (rig.width, rig.height):
        rig = rig.scaled(*size)
    left, right = shifted_pair(size[1], size[0], 11)
    left[40:60, 50:90] = 255  # glare
    python = endosdk.DepthEstimator(TINY_MODEL, calibration=rig, network_size=network_size)
    expected = python.predict(left, right)
    width, height = network_size or (0, 0)
    estimator = c.CEstimator(library, TINY_MODEL, rig, network_width=width, network_height=height)
    names = tuple(c.MAPS) if rig else ("disparity", "confidence", "reasons", "disparity_u16")
    result, maps = estimator.predict(left, right, maps=names)
    estimator.close()
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=1e-4)
    np.testing.assert_allclose(maps["confidence"], expected.confidence, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(maps["reasons"], expected.reasons)
    assert (maps["reasons"] & endosdk.Reason.SATURATED).any()
    assert result.valid_share == expected.valid_share
    assert result.quality == expected.status
    assert result.causes == sum(1 << cause for cause in expected.causes)
    measures = {cause: measure for cause, measure in enumerate(result.measures) if not np.isnan(measure)}
    assert measures == pytest.approx(expected.measures, rel=1e-6)
    valid = expected.reasons == 0
    steps = np.where(valid, np.round(256 * expected.disparity), 0)
    assert np.abs(maps["disparity_u16"] - steps).max() <= 1
    if rig is None:
        return
    np.testing.assert_allclose(maps["depth"], expected.depth, rtol=1e-6)
    np.testing.assert_allclose(maps["sigma"], expected.sigma, rtol=1e-6)
    tenths = np.where(valid & (expected.depth < 6553.5), 10 * np.nan_to_num(expected.depth), 0)
    assert np.abs(maps["depth_u16"] - tenths).max() <= 0.51 + 1e-6 * 65535


def test_sigma_of_a_rig_that_moved_needs_no_depth(library):
    left, right = cycles_pair(2)
    estimator = c.CEstimator(library, shipped_models()["fast-320"], RIG)
    result, maps = estimator.predict(left, turned(right, (0.0, 0.0, 0.8)))
    assert result.causes & 1 << endosdk.Cause.RIG_MOVED
    _, alone = estimator.predict(left, turned(right, (0.0, 0.0, 0.8)), maps=("sigma",))
    estimator.close()
    np.testing.assert_array_equal(alone["sigma"], maps["sigma"])


@pytest.mark.parametrize("temporal", [False, True])
def test_same_stream_as_python(library, temporal):
    pairs = [shifted_pair(480, 640, shift) for shift in (5, 11, 8, 3, 14, 9, 2)]
    rig = raw_rig()
    expected = [
        result.disparity.copy()
        for result in endosdk.DepthEstimator(TINY_MODEL, calibration=rig).stream(pairs, temporal=temporal)
    ]
    estimator = c.CEstimator(library, TINY_MODEL, rig, threads=2)
    found = [(result.frame, maps["disparity"].copy()) for result, maps in estimator.stream(pairs, temporal=temporal)]
    estimator.close()
    assert [frame for frame, _ in found] == list(range(1, len(pairs) + 1))
    for (_, disparity), wanted in zip(found, expected, strict=True):
        np.testing.assert_allclose(disparity, wanted, rtol=0, atol=1e-4)


@pytest.mark.parametrize("order", ["bgr", "gray"])
def test_same_maps_for_other_pixels(library, order):
    left, right = shifted_pair(120, 200, 7)
    if order == "gray":
        left, right = (np.ascontiguousarray(view[:, :, 1]) for view in (left, right))
    channel_order = "rgb" if order == "gray" else order
    expected = endosdk.DepthEstimator(TINY_MODEL, channel_order=channel_order).predict(left, right)
    estimator = c.CEstimator(library, TINY_MODEL)
    _, maps = estimator.predict(left, right, channel_order, maps=("disparity", "reasons"))
    estimator.close()
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(maps["reasons"], expected.reasons)


@pytest.mark.parametrize(("disparity", "network_size"), [(31, (0, 0)), (62, (120, 60))], ids=str)
def test_same_end_of_the_range_as_python(library, disparity, network_size):
    left, right = shifted_pair(120, 240, disparity)
    python = endosdk.DepthEstimator(TINY_MODEL, network_size=network_size if any(network_size) else None)
    expected = python.predict(left, right).reasons
    width, height = network_size
    estimator = c.CEstimator(library, TINY_MODEL, network_width=width, network_height=height)
    _, maps = estimator.predict(left, right, maps=("reasons",))
    estimator.close()
    np.testing.assert_array_equal(maps["reasons"], expected)
    assert np.mean((expected & endosdk.Reason.OUT_OF_RANGE) != 0) > 0.4


@pytest.mark.parametrize("network_width", [None, 120])
def test_no_answer_is_nearer_than_the_diagnostics_say(library, network_width):
    left, right = shifted_pair(120, 240, 29)
    left[:, 120:], right[:, 120:] = shifted_pair(120, 120, 31)
    rig = endosdk.StereoCalibration.rectified(210.0, 4.5, (240, 120), doffs=2.0)
    size = {} if network_width is None else {"network_width": network_width, "network_height": network_width // 2}
    # Whatever the confidence: a pair with few valid pixels would have no depth at all.
    estimator = c.CEstimator(library, TINY_MODEL, rig, min_confidence=0.0, **size)
    _, maps = estimator.predict(left, right)
    nearest = json.loads(estimator.diagnostics())["nearest_depth_mm"]
    estimator.close()
    assert nearest == pytest.approx(210.0 * 4.5 / ((31 - 0.5) * (240 / (network_width or 240))), rel=1e-6)
    assert np.nanmin(maps["depth"]) >= nearest * (1 - 1e-6)


LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int32, ctypes.c_char_p)


@pytest.mark.parametrize("nearest_mm", [0.0, 20.5, 32.0])
def test_how_near_a_rig_sees_is_said_in_pythons_words(library, caplog, nearest_mm):
    lines = []
    rig = endosdk.StereoCalibration.rectified(210.0, 9.0, (240, 120))
    log = LOG(lambda _, level, line: lines.append((logging.WARNING if level == 2 else logging.INFO, line.decode())))
    options = {"log": ctypes.cast(log, ctypes.c_void_p), "log_level": 3, "min_depth_mm": nearest_mm}
    c.CEstimator(library, TINY_MODEL, rig, network_width=120, network_height=60, **options).close()
    lines = [line for line in lines if line[1].startswith("nearest depth this model sees on this rig: 31 mm")]
    with caplog.at_level(logging.INFO, "endosdk.rigs"):
        endosdk.DepthEstimator(
            TINY_MODEL, calibration=rig, network_size=(120, 60), depth_range_mm=(nearest_mm, math.inf)
        )
    assert lines == [(line.levelno, line.message) for line in caplog.records if line.name == "endosdk.rigs"]
    assert len(lines) == 1


@pytest.mark.parametrize("name", sorted(shipped_models()))
def test_shipped_models_find_the_truth_and_pythons_maps(library, name):
    path = shipped_models()[name]
    rig = endosdk.StereoCalibration.load(DEMO.parent / "rig.json")
    left, right = (read_frame(DEMO / f"{side}.png") for side in ("left", "right"))
    estimator = c.CEstimator(library, path, rig, model_sha256=hashlib.sha256(path.read_bytes()).hexdigest().encode())
    estimator.self_test()
    result, maps = estimator.predict(left, right)
    again = estimator.predict(left, right)[1]
    estimator.close()
    expected = endosdk.DepthEstimator(path, calibration=rig).predict(left, right)
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=1e-4)
    np.testing.assert_array_equal(maps["reasons"], expected.reasons)
    for map_name, values in maps.items():
        assert values.tobytes() == again[map_name].tobytes(), map_name
    truth = read_disparity(DEMO / "disparity.png")
    assert result.quality == endosdk.Status.OK
    assert np.nanmedian(np.abs(maps["disparity"] - truth)[maps["reasons"] == 0]) < 0.5


@pytest.mark.parametrize("rig_name", [name for name in RIGS if name != "no rig"])
def test_same_geometry_and_hash_as_python(library, rig_name):
    rig = RIGS[rig_name]()
    expected = rig.rectification()
    estimator = c.CEstimator(library, TINY_MODEL, rig)
    geometry = estimator.geometry()
    report = json.loads(estimator.diagnostics())
    estimator.close()
    assert bool(geometry.rectifies) is not rig.is_rectified
    for name in ("focal_px", "baseline_mm", "cx", "cy", "doffs"):
        assert getattr(geometry, name) == pytest.approx(getattr(expected, name), rel=1e-9, abs=1e-9), name
    assert report["calibration_sha256"] == rig.sha256
    assert report["model"]["sha256"] == endosdk.DepthEstimator(TINY_MODEL).model.sha256
    assert report["onnxruntime_telemetry"] == "off"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="threads are listed in /proc on Linux alone")
def test_the_threads_of_a_stream_are_known_by_name(library):
    estimator = c.CEstimator(library, TINY_MODEL, raw_rig(), threads=2)
    names = set()
    for _ in estimator.stream([shifted_pair(480, 640, 5)] * 3):
        names |= {(task / "comm").read_text().strip() for task in Path("/proc/self/task").iterdir()}
    estimator.close()
    assert "endosdk-stream" in names
