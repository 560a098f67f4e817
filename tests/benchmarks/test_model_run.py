"""A record has the hash of the file that ran: where 8-bit integers are not fast, that of the float32 model."""

import re

import pytest

from benchmarks.accuracy.pareto_front import named_model
from benchmarks.accuracy.photometric_consistency import Answerer
from benchmarks.model_run import model_run
from benchmarks.speed import c_library
from endosdk import DepthEstimator, _core
from endosdk.runtime.models import read_model
from tests.conftest import ROOT, TINY_MODEL


@pytest.fixture(params=[False, True], ids=["integers", "floats"])
def taken(monkeypatch, request):
    """The file that stands for fast-320 on such a processor."""
    monkeypatch.setattr(_core, "wants_float32_model", lambda provider: request.param)
    return read_model("fast-320-fp32" if request.param else "fast-320").sha256


def test_the_file_is_that_of_an_estimator(taken):
    with DepthEstimator("fast-320") as estimator:
        assert model_run("fast-320").sha256 == estimator.model.sha256 == taken
    assert model_run(TINY_MODEL).sha256 == read_model(TINY_MODEL).sha256


def test_benchmarks_record_what_ran(taken):
    assert named_model("small=fast-320@320x240", 1)[:2] == ("small", taken)
    assert c_library.hashes("streams")["model_sha256"]["fast-320"] == taken
    assert Answerer("fast-320").session.info.sha256 == taken


def test_no_benchmark_takes_the_hash_of_a_name():
    """Those that read a model themselves run the very bytes."""
    reading = {
        str(path.relative_to(ROOT / "benchmarks"))
        for path in (ROOT / "benchmarks").rglob("*.py")
        if re.search(r"read_model\(|has_integer_units\(", path.read_text())
    }
    assert reading == {"model_run.py", "speed/gpu.py", "studies/flipped_bits.py", "studies/saturation.py"}
