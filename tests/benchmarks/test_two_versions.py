"""Each of two versions says which model file it ran."""

import json
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.accuracy import same_maps
from benchmarks.speed import two_versions
from endosdk.runtime.models import read_model
from tests.conftest import TINY_MODEL, shifted_pair


@pytest.fixture
def given(tmp_path):
    """Options: the earlier version has another file of the model."""
    earlier = tmp_path / "python"
    earlier.write_text(f'#!/bin/sh\nshift 3\nexec {sys.executable} -c "$CODE" {TINY_MODEL} "$@"\n')
    earlier.chmod(0o755)
    versions = ["--before", str(earlier), "--after", sys.executable, "--commits", "one", "two"]
    return [*versions, "--models", "fast-320", "--json", str(tmp_path / "found.json")]


def run(monkeypatch, module, given):
    monkeypatch.setenv("CODE", module.WORKER)
    monkeypatch.setattr(sys, "argv", [module.__name__, *given])
    module.main()


def hashes_in(file):
    record = json.loads(file.read_text())
    return record["before_sha256"], record["model_sha256"]


EXPECTED = ({"fast-320": read_model(TINY_MODEL).sha256}, {"fast-320": read_model("fast-320").sha256})


def test_times_are_of_the_files_of_each_version(monkeypatch, tmp_path, given):
    for name, value in (("TURNS", 1), ("FRAMES", 1), ("LARGEST_ERROR", 1.0)):
        monkeypatch.setattr(two_versions, name, value)
    run(monkeypatch, two_versions, [*given, "--sizes", "160x120"])
    assert hashes_in(tmp_path / "found.json") == EXPECTED


def test_differences_are_of_the_files_of_each_version(monkeypatch, tmp_path, given):
    class Pairs(list):
        name, sha256 = "one", "ab" * 32

    left, right = shifted_pair(120, 160, 5)
    pairs = Pairs([SimpleNamespace(left=left, right=right, disparity=np.full((120, 160), 5.0))])
    monkeypatch.setattr(same_maps, "PAIRS", 1)
    monkeypatch.setattr(same_maps, "open_dataset", lambda folder, split: pairs)
    with pytest.raises(SystemExit, match="the versions differ"):
        run(monkeypatch, same_maps, [*given, "--data", "one"])
    assert hashes_in(tmp_path / "found.json") == EXPECTED
