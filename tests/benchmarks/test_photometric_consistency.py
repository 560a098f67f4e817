"""The benchmark of the rule that views must agree runs, and tells right pairs from wrong ones."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.accuracy import photometric_consistency
from benchmarks.accuracy.photometric_consistency import Answerer, BothAnswers, degraded_pairs, on_truth, wrong_pairs
from benchmarks.network_run import NetworkRun
from tests.conftest import TINY_MODEL, shifted_pair
from tests.rigs import raw_rig


def test_right_pairs_keep_their_answers_and_wrong_ones_lose_them():
    answer = Answerer(str(TINY_MODEL))
    left, right = shifted_pair(240, 320, 9)
    shares = answer(left, right).shares()
    assert shares["valid_with"] > 0.9 * shares["valid_without"] > 0.5
    wrong = {name: answer(*pair).shares() for name, *pair in wrong_pairs(left, right)}
    assert wrong["twice the left"]["valid_with"] == wrong["both black"]["valid_with"] == 0
    assert max(found["valid_with"] for found in wrong.values()) < 0.1
    assert len([name for name, *_ in degraded_pairs(left, right)]) == 4


def test_one_camera_connected_twice_to_a_raw_rig_has_no_answer(monkeypatch):
    monkeypatch.setattr(photometric_consistency._core, "default_min_confidence", 0.3)  # this model is never very sure
    left, _ = shifted_pair(480, 640, 9)
    found = Answerer(str(TINY_MODEL))(left, left, raw_rig().scaled(640, 480)).shares()
    assert found["valid_with"] == 0 < found["valid_without"]


@pytest.mark.parametrize(("confidence", "valid"), [(0.83, True), (0.75, False)])
def test_maps_without_the_rule_are_in_units_of_the_frame(monkeypatch, confidence, valid):
    """A frame 1280 wide is seen 720 wide: 17.8 px of the network are 31.6 px of the frame.

    So the first 32 columns have no match. Confidence is given for errors up to 1 px of the network and asked for errors
    up to 1/480 of the width, which are 1.5 px of it: 0.785 becomes the 0.9 from which pixels are valid.
    """

    class HandSetMaps(NetworkRun):
        def __call__(self):
            self.disparity[:], self.confidence[:] = 17.8, confidence

    left, right = shifted_pair(360, 1280, 16)
    monkeypatch.setattr(photometric_consistency, "NetworkRun", HandSetMaps)
    found = Answerer(str(TINY_MODEL))(left, right)
    assert not found.without[:, :32].any() and (found.without[:, 32:] == valid).all()


def test_errors_of_what_the_rule_drops_and_keeps():
    """Two pairs of four pixels; those without truth, or without an answer before the rule, are no errors."""
    truth = np.array([[5, 5, 5, np.nan]], np.float32)
    valid = {"first": ([1, 1, 1, 1], [1, 1, 0, 1]), "second": ([1, 1, 0, 0], [0, 1, 0, 0])}  # without the rule, with it
    found = {"first": [[6, 9, 13, 5]], "second": [[3, 2, 14, 5]]}
    pairs = {name: BothAnswers(np.array(found[name]), *np.array(masks, bool)[:, None]) for name, masks in valid.items()}
    samples = [SimpleNamespace(left=name, right=None, disparity=truth) for name in pairs]
    assert on_truth(lambda left, right: pairs[left], samples) == {
        "valid_without": 0.75,
        "valid_with": 0.5,
        "least_valid_without": 0.5,
        "least_valid_with": 0.25,
        "epe_of_dropped_px": 5.0,  # 8 and 2
        "epe_of_kept_px": 2.667,  # 1, 4 and 3
        "over_3_px_of_dropped": 0.5,
        "over_3_px_of_kept": 0.3333,
    }
