import json

import numpy as np
import pytest

from endosdk import errors
from endosdk.cli import main
from endosdk.dataset import Sample, open_dataset, write_record, write_sample
from endosdk.evaluation import Answer, estimator_method, evaluate, sgbm_method
from tests.conftest import TINY_MODEL, shifted_pair

SHIFTS = (6, 12, 18)


@pytest.fixture(scope="module")
def planes(tmp_path_factory):
    """A data set of three planes whose truth is their shift; what the right view does not see is occluded."""
    root = tmp_path_factory.mktemp("planes")
    hashes = {}
    for shift in SHIFTS:
        left, right = shifted_pair(96, 256, shift, seed=shift)
        occlusion = np.zeros((96, 256), bool)
        occlusion[:, :shift] = True
        truth = np.full((96, 256), shift, np.float32)
        sample = Sample(f"{shift:03d}", left, right, truth, None, occlusion, focal_px=200.0, baseline_mm=5.0)
        hashes[sample.id] = write_sample(root, "test", sample)
    record = {"format_version": 1, "name": "planes", "samples": {"train": {}, "test": hashes}}
    write_record(root, record)
    return root


def test_measures_of_a_method_that_is_one_pixel_off(planes):
    def off_by_one(sample):
        return Answer(sample.disparity + 1, milliseconds=5.0)

    scores = evaluate(off_by_one, open_dataset(planes, "test"))
    assert scores["pairs"] == 3
    assert scores["all"]["epe_px"] == pytest.approx(1.0)
    assert scores["all"]["pixels"] == 3 * 96 * 256
    assert scores["non_occluded"]["pixels"] == 3 * 96 * 256 - 96 * sum(SHIFTS)
    expected = np.mean([1000 / s - 1000 / (s + 1) for s in SHIFTS])
    assert scores["all"]["depth_mae_mm"] == pytest.approx(expected, rel=1e-6)
    assert scores["ms_median"] == 5.0


def test_worst_pairs_come_first(planes):
    scores = evaluate(lambda s: Answer(s.disparity + s.disparity / 10), open_dataset(planes, "test"))
    assert [entry["id"] for entry in scores["worst"]] == ["018", "012", "006"]


def test_a_model_and_the_rival_on_the_same_planes(planes):
    reader = open_dataset(planes, "test")
    ours = evaluate(estimator_method(str(TINY_MODEL)), reader)
    rival = evaluate(sgbm_method(filled=True), reader)
    sparse = evaluate(sgbm_method(filled=False), reader, limit=2)
    assert ours["non_occluded"]["epe_px"] < 1.0
    assert ours["all"]["coverage"] == rival["all"]["coverage"] == 1.0
    assert rival["non_occluded"]["epe_px"] < 1.0
    assert sparse["pairs"] == 2
    assert sparse["all"]["coverage"] < 1.0


def test_no_pair_is_refused(planes):
    with pytest.raises(errors.InvalidArgument, match="limit"):
        evaluate(sgbm_method(filled=True), open_dataset(planes, "test"), limit=0)


def test_command_prints_and_writes(planes, tmp_path, capsys):
    file = tmp_path / "scores.json"
    assert main(["evaluate", "--model", str(TINY_MODEL), "--data", str(planes), "--json", str(file)]) == 0
    assert "EPE" in capsys.readouterr().out
    record = json.loads(file.read_text())
    assert record["scores"]["pairs"] == 3
    assert {"cpu", "versions", "commit", "date"} <= set(record["machine"])
