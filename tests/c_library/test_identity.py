"""Results of the C library say what they were computed with and how old they are; the runtime can be pinned."""

from __future__ import annotations

import ctypes
import hashlib
import json
import time
from pathlib import Path

import numpy as np
import pytest

import endosdk
from endosdk import Cause
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig

PAIR = shifted_pair(120, 160, 9)


@pytest.fixture(scope="module")
def runtime_sha256() -> str:
    return hashlib.sha256(c.runtime_library().read_bytes()).hexdigest()


def test_results_carry_the_identity_that_python_gives(library, runtime_sha256):
    rig = raw_rig().scaled(160, 120)
    estimator = c.CEstimator(library, TINY_MODEL, rig)
    seen = estimator.predict(*PAIR)[0].identity
    streamed = [bytes(result.identity) for result, _ in estimator.stream([PAIR])]
    report = json.loads(estimator.diagnostics())
    estimator.set_calibration(None)
    without = estimator.predict(*PAIR, maps=("disparity",))[0].identity
    estimator.close()
    python = endosdk.DepthEstimator(TINY_MODEL, calibration=rig).predict(*PAIR).identity
    names = ("endosdk", "model", "model_version", "model_sha256", "calibration_sha256", "runtime", "provider", "device")
    for name in names:
        assert getattr(seen, name).decode() == getattr(python, name), name
    assert seen.calibration_sha256.decode() == rig.sha256
    assert seen.runtime_sha256.decode() == report["onnxruntime_sha256"] == runtime_sha256
    assert report["device"] == python.device
    assert streamed == [bytes(seen)]
    assert without.calibration_sha256 == b"" and without.model_sha256 == seen.model_sha256


def test_a_failed_call_says_nothing_of_identity(library):
    estimator = c.CEstimator(library, TINY_MODEL)
    result, _maps = estimator.predict(*PAIR, maps=("disparity",))  # whose memory the result points to
    assert result.identity.endosdk == endosdk.__version__.encode()
    views = c.Image.of(PAIR[0]), c.Image.of(PAIR[1][:50])
    assert library.endo_predict(estimator.handle, *map(ctypes.byref, views), ctypes.byref(result)) != 0
    estimator.close()
    assert bytes(result.identity) == bytes(ctypes.sizeof(c.Identity))


def test_a_runtime_that_is_not_the_pinned_one_is_refused(library, runtime_sha256):
    c.CEstimator(library, TINY_MODEL, runtime_sha256=runtime_sha256.upper().encode()).close()
    other = ("0" if runtime_sha256[0] != "0" else "1") + runtime_sha256[1:]
    with pytest.raises(c.CError, match=runtime_sha256) as refused:
        c.CEstimator(library, TINY_MODEL, runtime_sha256=other.encode())
    assert refused.value.name == "RUNTIME_HASH_MISMATCH"
    for pin in (b"", b"abc"):
        with pytest.raises(c.CError, match="runtime_sha256") as refused:
            c.CEstimator(library, TINY_MODEL, runtime_sha256=pin)
        assert refused.value.name == "INVALID_ARGUMENT"
    with pytest.raises(c.CError, match="needs runtime_library"):
        c.CEstimator(library, TINY_MODEL, runtime_library=None, runtime_sha256=runtime_sha256.encode())


def test_a_damaged_runtime_is_refused_before_it_runs(library, runtime_sha256, tmp_path):
    damaged = bytearray(c.runtime_library().read_bytes())
    damaged[len(damaged) // 2] ^= 1
    file = tmp_path / "libonnxruntime.so"
    file.write_bytes(damaged)
    with pytest.raises(c.CError, match=r"libonnxruntime\.so must have SHA-256") as refused:
        c.CEstimator(library, TINY_MODEL, runtime_library=str(file).encode(), runtime_sha256=runtime_sha256.encode())
    assert refused.value.name == "RUNTIME_HASH_MISMATCH"
    assert str(file) not in Path("/proc/self/maps").read_text()


def test_a_pinned_runtime_is_a_path(library, runtime_sha256, tmp_path, monkeypatch):
    (tmp_path / "libonnxruntime.so").symlink_to(c.runtime_library())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(c.CError, match="must be a path with a folder") as refused:
        c.CEstimator(library, TINY_MODEL, runtime_library=b"libonnxruntime.so", runtime_sha256=runtime_sha256.encode())
    assert refused.value.name == "INVALID_ARGUMENT"


def test_a_file_that_took_the_place_of_the_one_in_memory_is_refused(library, runtime_sha256, tmp_path):
    file, other = tmp_path / "libonnxruntime.so", tmp_path / "other.so"
    content = c.runtime_library().read_bytes()
    file.write_bytes(content)
    c.CEstimator(
        library, TINY_MODEL, runtime_library=str(file).encode(), runtime_sha256=runtime_sha256.encode()
    ).close()
    other.write_bytes(content + b"\0")
    other.replace(file)
    pin = hashlib.sha256(content + b"\0").hexdigest()
    with pytest.raises(c.CError, match="must have SHA-256") as refused:
        c.CEstimator(library, TINY_MODEL, runtime_library=str(file).encode(), runtime_sha256=pin.encode())
    assert refused.value.name == "RUNTIME_HASH_MISMATCH"


def test_old_pairs_are_stale_and_all_have_their_age(library):
    estimator = c.CEstimator(library, TINY_MODEL, max_age_ms=5000.0)
    fresh = estimator.predict(*PAIR, maps=("disparity",), stamp_ns=time.monotonic_ns())[0]
    old = estimator.predict(*PAIR, maps=("disparity",), stamp_ns=time.monotonic_ns() - 6_000_000_000)[0]
    assert 0 < fresh.age_ms < 5000 and not fresh.causes >> Cause.STALE & 1
    assert 6000 <= old.age_ms < 11000 and old.causes >> Cause.STALE & 1 and old.quality == endosdk.Status.DEGRADED
    assert old.measures[Cause.STALE] == pytest.approx(old.age_ms / 5000)
    for stamp, rule in ((0, "must be given"), (-5, "monotonic"), (time.monotonic_ns() + 10**12, "at most now")):
        with pytest.raises(c.CError, match=rule):
            estimator.predict(*PAIR, maps=("disparity",), stamp_ns=stamp)
    assert json.loads(estimator.diagnostics())["causes"]["STALE"] == 1
    estimator.close()
    unlimited = c.CEstimator(library, TINY_MODEL)
    assert np.isnan(unlimited.predict(*PAIR, maps=("disparity",))[0].age_ms)
    unlimited.close()
