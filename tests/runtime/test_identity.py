"""Results say what they were computed with and how old they are; the runtime's file can be pinned."""

from __future__ import annotations

import copy
import hashlib
import logging
import math
import pickle
import threading
import time
from pathlib import Path

import onnxruntime
import pytest

import endosdk
from endosdk import Cause, DepthEstimator, Status, errors
from endosdk.runtime import runtime_file
from tests.conftest import TINY_MODEL, shifted_pair

PAIR = shifted_pair(96, 160, 9)
SECOND = 1_000_000_000


def test_a_result_says_all_that_it_was_computed_with():
    estimator = DepthEstimator(TINY_MODEL)
    result = estimator.predict(*PAIR)
    identity, report = result.identity, estimator.diagnostics()
    assert identity.endosdk == endosdk.__version__
    assert (identity.model, identity.model_version) == (result.model.name, result.model.version)
    assert identity.model_sha256 == hashlib.sha256(TINY_MODEL.read_bytes()).hexdigest()
    assert identity.calibration_sha256 == ""
    assert identity.runtime == onnxruntime.__version__
    assert identity.provider == "CPUExecutionProvider"
    assert identity.device == report["device"] != ""
    assert identity.runtime_sha256 == report["onnxruntime_sha256"]
    assert hashlib.sha256(Path(report["onnxruntime_library"]).read_bytes()).hexdigest() == identity.runtime_sha256


def test_identities_are_equal_where_all_of_them_is():
    pair = shifted_pair(96, 160, 10)
    first, again = (DepthEstimator(TINY_MODEL).predict(*pair).identity for _ in range(2))
    with_rig = endosdk.StereoCalibration.rectified(200.0, 5.0, (160, 96))
    other = DepthEstimator(TINY_MODEL, calibration=with_rig).predict(*pair).identity
    assert first == again == pickle.loads(pickle.dumps(first)) and hash(first) == hash(again)
    assert first != other and first != "first"
    assert endosdk.__version__ in repr(first) and first.model_sha256 in repr(first)


def test_the_hashed_file_is_the_one_that_was_loaded():
    from onnxruntime.capi import onnxruntime_pybind11_state

    assert runtime_file.runtime_file() == Path(onnxruntime_pybind11_state.__file__)


def test_a_runtime_that_is_not_the_pinned_one_is_refused():
    pin = DepthEstimator(TINY_MODEL).diagnostics()["onnxruntime_sha256"]
    DepthEstimator(TINY_MODEL, runtime_sha256=pin.upper())
    other = ("0" if pin[0] != "0" else "1") + pin[1:]
    with pytest.raises(errors.RuntimeHashMismatch, match=pin) as refused:
        DepthEstimator(TINY_MODEL, runtime_sha256=other)
    assert refused.value.code is errors.ErrorCode.RUNTIME_HASH_MISMATCH
    for text in ("", "abc", 5):
        with pytest.raises(errors.InvalidArgument, match="64 hexadecimal digits"):
            DepthEstimator(TINY_MODEL, runtime_sha256=text)


def test_a_pair_has_an_age_where_it_has_a_stamp():
    estimator = DepthEstimator(TINY_MODEL)
    stamp = time.monotonic_ns() - SECOND
    dated = estimator.predict(*PAIR, stamp_ns=stamp)
    assert dated.stamp_ns == stamp and 1000 <= dated.age_ms <= (time.monotonic_ns() - stamp) / 1e6
    assert dated.status is Status.OK and Cause.STALE not in dated.measures
    undated = estimator.predict(*PAIR)
    assert undated.stamp_ns is None and undated.age_ms is None


@pytest.mark.parametrize("way", ["predict", "stream"])
def test_a_pair_that_was_taken_too_long_ago_is_stale(way, caplog):
    estimator = DepthEstimator(TINY_MODEL, max_age_ms=10_000)
    now = time.monotonic_ns()
    stamps = [now, now - 12 * SECOND]
    with caplog.at_level(logging.WARNING, "endosdk.frames"):
        if way == "predict":
            results = [estimator.predict(*PAIR, stamp_ns=stamp) for stamp in stamps]
        else:
            results = list(estimator.stream((*PAIR, stamp) for stamp in stamps))
    assert [Cause.STALE in result.causes for result in results] == [False, True]
    assert [result.status for result in results] == [Status.OK, Status.DEGRADED]
    assert results[1].causes[Cause.STALE] == pytest.approx(results[1].age_ms / 10_000)
    assert "frame 2 is stale" in caplog.text and "frame 1" not in caplog.text
    assert estimator.diagnostics()["causes"]["STALE"] == 1


def test_an_answer_ages_while_nobody_takes_it():
    estimator = DepthEstimator(TINY_MODEL, threads=1)
    stamped = threading.Event()

    def source():
        yield (*PAIR, time.monotonic_ns())
        stamp = time.monotonic_ns()
        stamped.set()
        yield (*PAIR, stamp)

    results = estimator.stream(source())
    next(results)
    assert stamped.wait(60)  # the answer ages from here
    time.sleep(0.3)
    assert next(results).age_ms > 250


def test_stamps_of_another_clock_are_refused():
    estimator = DepthEstimator(TINY_MODEL)
    for stamp in (time.monotonic_ns() + 3600 * SECOND, 0, -1, 1.5, True, 2**63):
        with pytest.raises(errors.InvalidArgument, match="stamp_ns"):
            estimator.predict(*PAIR, stamp_ns=stamp)
    with pytest.raises(errors.InvalidArgument, match="must be given where max_age_ms is"):
        DepthEstimator(TINY_MODEL, max_age_ms=1.0).predict(*PAIR)
    with pytest.raises(errors.InvalidArgument, match="max_age_ms"):
        DepthEstimator(TINY_MODEL, max_age_ms=math.inf)


def test_a_result_can_be_copied_and_sent_to_another_process() -> None:
    result = DepthEstimator(TINY_MODEL).predict(*PAIR)
    sent = pickle.loads(pickle.dumps(result))
    for name in ("endosdk", "model", "model_sha256", "runtime", "runtime_sha256", "provider", "device"):
        assert getattr(sent.identity, name) == getattr(result.identity, name)
    assert (sent.disparity == result.disparity).all() and copy.deepcopy(result).status is result.status
