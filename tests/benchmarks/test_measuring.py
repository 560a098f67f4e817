"""The bench of measures: its record says on which pairs, and rigs whose axes do not cross at infinity are measured."""

import json
import sys

import numpy as np
import pytest

from benchmarks.accuracy import measuring
from endosdk.datasets.dataset import Sample
from tests.conftest import TINY_MODEL, shifted_pair

DOFFS = 4.0


class Reader(list):
    """A set whose folder has another name."""

    name, split, sha256 = "one set", "test", "ab" * 32


@pytest.fixture
def sample():
    left, right = shifted_pair(120, 160, 9)
    truth = np.full((120, 160), 9, np.float32)
    return Sample("1", left, right, truth, None, None, focal_px=210.0, baseline_mm=4.5, doffs=DOFFS)


def test_the_set_is_named_and_its_rig_is_whole(monkeypatch, tmp_path, sample):
    piece = np.zeros((120, 160), bool)
    piece[20:100, 30:130] = True
    true_depths = []
    monkeypatch.setattr(measuring, "Rasteriser", lambda: None)
    monkeypatch.setattr(measuring, "objects", lambda renderer, sample: [("polyp", piece)])
    monkeypatch.setattr(measuring, "open_dataset", lambda root, split: Reader([sample]))
    measurements = measuring.measurements

    def noted(result, truth, piece, rng):
        true_depths.append(float(np.nanmedian(truth.depth)))
        return measurements(result, truth, piece, rng)

    monkeypatch.setattr(measuring, "measurements", noted)
    file = tmp_path / "measuring.json"
    monkeypatch.setattr(sys, "argv", ["m", "--data", "folder", "--model", str(TINY_MODEL), "--json", str(file)])
    measuring.main()
    record = json.loads(file.read_text())
    assert list(record["sets"]) == ["one set"] and "--data one set --model" in record["command"]
    found = record["sets"]["one set"]
    assert (found["split"], found["sha256"], found["objects"]["polyp"]) == ("test", "ab" * 32, 1)
    assert true_depths == [pytest.approx(210.0 * 4.5 / (9 + DOFFS), rel=1e-5)]
