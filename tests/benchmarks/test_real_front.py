"""The front on real pairs: models see a pair at the width asked for, in its own proportions; errors are in range."""

import json
import sys

import numpy as np
import pytest

from benchmarks.accuracy import real_front
from endosdk import DepthEstimator
from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_picture
from endosdk.evaluation.methods import Answer
from endosdk.io.pictures import DISPARITY_STEPS
from tests.conftest import TINY_MODEL, shifted_pair


def test_entries():
    assert real_front.entry_of("fast@480") == ("fast", "fast", 480)
    assert real_front.entry_of("wide=runs/a@b/fast.onnx@640") == ("wide", "runs/a@b/fast.onnx", 640)


def test_a_pair_is_seen_at_the_width_in_its_own_proportions(monkeypatch):
    sizes = []

    def noted(model, *, network_size):
        sizes.append((model, network_size))
        return lambda sample: network_size

    monkeypatch.setattr(real_front, "estimator_method", noted)
    method = real_front.seen_at("fast", 640)
    shapes = [(370, 463), (370, 427), (370, 427), (370, 463)]
    seen = [method(Sample("1", *np.zeros((2, *shape, 3), np.uint8), None, None, None, 1.0, 1.0)) for shape in shapes]
    assert seen == [(640, 511), (640, 555), (640, 555), (640, 511)]
    assert sizes == [("fast", size) for size in ((640, 511), (640, 555), (640, 511))], "one of equal pairs stays"


class Reader(list):
    split = "test"


def test_errors_are_those_in_range():
    truth = np.array([[2, 2, 2, 9]], np.float32)
    sample = Sample("1", *np.zeros((2, 1, 4, 3), np.uint8), truth, None, None, 1.0, 1.0)
    answer = Answer(truth + np.array([0, 2, 4, 100], np.float32), largest_px=8.0)
    found = real_front.measure(lambda sample: answer, Reader([sample]))
    assert found == {"in_range": 0.75, "epe_px": 2, "kpe_1": pytest.approx(2 / 3), "kpe_3": pytest.approx(1 / 3)}


def test_the_record_has_the_width_of_every_model(monkeypatch, tmp_path):
    pair = tmp_path / "real" / "one"
    pair.mkdir(parents=True)
    left, right = shifted_pair(120, 160, 9)
    write_picture(pair / "left.png", left)
    write_picture(pair / "right.png", right)
    write_picture(pair / "disparity.png", np.full((120, 160), 9 * DISPARITY_STEPS, np.uint16))
    file = tmp_path / "found.json"
    entries = [f"{width}={TINY_MODEL}@{width}" for width in (80, 160)]
    monkeypatch.setattr(sys, "argv", ["m", "--data", str(pair.parent), "--models", *entries, "--json", str(file)])
    real_front.main()
    record = json.loads(file.read_text())
    name = TINY_MODEL.name
    assert record["command"].endswith(f"--data real --layout plain --models 80={name}@80 160={name}@160")
    assert record["dataset"]["pairs"] == 1
    assert [point["network_width"] for point in record["points"].values()] == [80, 160]
    with DepthEstimator(TINY_MODEL) as estimator:
        assert set(record["models"].values()) == {estimator.model.sha256}
    half, whole = record["points"].values()
    assert whole["in_range"] == 1 and whole["epe_px"] < half["epe_px"]
