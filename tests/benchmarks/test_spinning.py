"""The bench of waiting threads: both ways are timed under each load, and only where they answer alike."""

import pytest

from benchmarks.speed import spinning
from endosdk import DepthEstimator
from endosdk.datasets.samples import sample_pairs
from tests.conftest import TINY_MODEL


@pytest.fixture(scope="module")
def pairs():
    return [pair.resized(160, 120) for pair in sample_pairs()[:2]]


def test_both_ways_are_timed_under_each_load(monkeypatch, pairs):
    monkeypatch.setattr(spinning, "TURNS", 2)
    monkeypatch.setattr(spinning, "LOADS", (0, 1))
    found = spinning.measured(str(TINY_MODEL), pairs, 3)
    assert list(found) == ["0 busy processes", "1 busy processes"]
    for ways in found.values():
        assert set(ways) == set(spinning.WAYS)
        assert all(0 < one["p50_ms"] <= one["p99_ms"] and one["fps"] > 0 for one in ways.values())


def test_ways_that_answer_differently_are_not_timed(pairs):
    rig = pairs[0].calibration
    ways = {
        str(width): DepthEstimator(str(TINY_MODEL), calibration=rig, network_size=(width, 64)) for width in (64, 96)
    }
    with pytest.raises(SystemExit, match="unlike maps"):
        spinning.check_same(ways, pairs)
