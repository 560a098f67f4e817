"""Models join a record of the same pairs, and cases one of the same model."""

import json
import sys
from types import SimpleNamespace

import pytest

from benchmarks import model_records
from benchmarks.accuracy import trust
from endosdk import _core
from endosdk.errors import InvalidArgument
from endosdk.runtime.models import read_model
from tests.conftest import TINY_MODEL

MODEL = str(TINY_MODEL)
CASES = ["clean", "right covered, black"]


class Reader(list):
    """A set of so many pairs."""

    def __init__(self, sha256="ab" * 32, pairs=3):
        super().__init__(range(pairs))
        self.name, self.sha256 = "one set", sha256


@pytest.fixture
def run(monkeypatch, tmp_path):
    """Run the bench of trust without its minutes; return the record."""
    monkeypatch.setattr(sys.modules["__main__"], "__spec__", SimpleNamespace(name="benchmarks.accuracy.trust"))
    measured = iter(range(1000))

    def measure(model, samples, cases):
        return {case.name: {"pairs": len(samples), "status": next(measured)} for case in cases}

    monkeypatch.setattr(trust, "measure", measure)

    def call(*options, reader=None, model=MODEL):
        monkeypatch.setattr(trust, "open_dataset", lambda folder, split: reader or Reader())
        file = tmp_path / "trust.json"
        monkeypatch.setattr(sys, "argv", ["trust", "--models", model, "--json", str(file), *options])
        trust.main()
        return json.loads(file.read_text())

    return call


def test_cases_join_those_of_the_model_and_say_what_they_were_measured_by(run):
    before = run()["models"][MODEL]
    after = run("--cases", *CASES)["models"][MODEL]
    assert list(after["cases"]) == list(before["cases"]), "none is lost, and each keeps its place"
    for name, case in after["cases"].items():
        if name in CASES:
            assert case["status"] != before["cases"][name]["status"]
            assert "--cases clean 'right covered, black' --models" in case["command"]
            assert case["model_sha256"] == before["model_sha256"] and "date" in case["machine"]
        else:
            assert case == before["cases"][name]
    assert {**after, "cases": None} == {**before, "cases": None}, "the signature is that of the cases that stay"


def test_a_record_that_begins_with_some_cases_says_so(run):
    found = run("--cases", *CASES)["models"][MODEL]
    assert list(found["cases"]) == CASES and "--cases clean 'right covered, black'" in found["command"]


@pytest.mark.parametrize(
    ("said", "options", "reader"),
    [
        ("data: must be that of trust.json, .*'sha256': 'abab.*; got .*'sha256': 'cdcd", [], Reader("cd" * 32)),
        ("data: must be that of trust.json", ["--split", "train"], Reader()),
        ("pairs: must be 3, as of clean of .* in trust.json; got 2", ["--pairs", "2", "--cases", "fog"], Reader()),
    ],
)
def test_what_is_measured_on_other_pairs_does_not_join(run, tmp_path, said, options, reader):
    before = run()
    with pytest.raises(InvalidArgument, match=said):
        run(*options, reader=reader)
    assert json.loads((tmp_path / "trust.json").read_text()) == before


def test_the_hash_is_that_of_the_file_that_ran(run, monkeypatch):
    monkeypatch.setattr(_core, "wants_float32_model", lambda provider: True)
    assert run(model="fast")["models"]["fast"]["model_sha256"] == read_model("fast-fp32").sha256


def test_cases_of_another_model_file_do_not_join(run, monkeypatch):
    run()
    monkeypatch.setattr(model_records, "model_run", lambda name: SimpleNamespace(sha256="cd" * 32))
    with pytest.raises(InvalidArgument, match=r"models: must have the SHA-256 of .* in trust.json, .*; got cdcd"):
        run("--cases", *CASES)
    run()  # all cases of the model are measured anew: nothing of the other file stays
