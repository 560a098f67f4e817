"""The bench of looks changes what it names, and nothing else; its record has every model and look."""

import json
import sys

import numpy as np
import pytest

from benchmarks.accuracy import looks
from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.evaluation.methods import Answer
from tests.conftest import TINY_MODEL, shifted_pair


@pytest.fixture
def sample():
    left, right = shifted_pair(120, 160, 9)
    left[..., 0], right[..., 0] = left[..., 0] // 2, right[..., 0] // 2  # of three channels, no two are the same
    left[..., 2], right[..., 2] = left[..., 2] // 3, right[..., 2] // 3
    return Sample("1", left, right, np.full((120, 160), 9, np.float32), None, None, 210.0, 4.5)


def test_a_look_changes_what_it_names(sample):
    seen = {name: look(sample) for name, look in looks.LOOKS.items()}
    assert seen["as rendered"] is sample
    swapped, grey, lower = (seen[name] for name in list(seen)[1:])
    for view in ("left", "right"):
        before = getattr(sample, view)
        np.testing.assert_array_equal(getattr(swapped, view), before[..., [2, 1, 0]])
        brightness = before @ np.array([0.299, 0.587, 0.114])
        assert np.abs(getattr(grey, view) - brightness[..., None]).max() <= 1
    np.testing.assert_array_equal(lower.left, sample.left)
    np.testing.assert_array_equal(lower.right[1:], sample.right[:-1])
    for look in seen.values():
        assert look.left.shape == look.right.shape == sample.left.shape
        assert look.left.dtype == look.right.dtype == np.uint8
        assert look.disparity is sample.disparity


def test_errors_are_those_of_the_look(sample):
    """A method that errs by the brightness of the left view's first pixel, and is valid in the upper half."""
    valid = np.arange(120)[:, None] < np.full(160, 60)

    def method(seen):
        return Answer(seen.disparity + np.float32(seen.left[0, 0, 0]), valid=valid)

    sample.left[0, 0] = (4, 0, 2)  # grey: 0.299 * 4 + 0.114 * 2 = 1.4
    found = looks.measure(method, [sample], 1)
    assert [found[look]["epe_px"] for look in looks.LOOKS] == [4, 2, 1, 4]
    assert [found[look]["kpe_3"] for look in looks.LOOKS] == [1, 0, 0, 1]
    assert [found[look]["kpe_1"] for look in looks.LOOKS] == [1, 1, 0, 1]
    assert all(one["valid"] == 0.5 for one in found.values())


def test_the_record_has_every_model_and_look(monkeypatch, tmp_path, sample):
    root = tmp_path / "tiny"
    samples = {"train": {}, "test": {"1": write_sample(root, "test", sample)}}
    write_dataset_record(root, {"format_version": 1, "name": "tiny", "samples": samples})
    file = tmp_path / "looks.json"
    given = ["looks", "--data", str(root), "--models", str(TINY_MODEL), "--json", str(file)]
    monkeypatch.setattr(sys, "argv", given)
    looks.main()
    record = json.loads(file.read_text())
    assert (record["dataset"]["name"], record["dataset"]["pairs"]) == ("tiny", 1)
    assert f"--data tiny --pairs 100 --models {TINY_MODEL.name}" in record["command"]
    (found,) = record["looks"].values()
    assert list(found) == list(looks.LOOKS)
    assert found["as rendered"]["epe_px"] < 1 and found["as rendered"]["valid"] > 0.5
    assert found["right view 1 px lower"] != found["as rendered"]
