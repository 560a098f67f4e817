"""The bench of trust runs, spoils what it says it spoils, and counts what it says it counts."""

import numpy as np

from benchmarks.accuracy.trust import Tally, measure
from benchmarks.accuracy.trust_cases import FAULTS, USABLE, Case
from endosdk import Cause, DepthEstimator, StereoCalibration
from endosdk.datasets.dataset import Sample
from tests.conftest import TINY_MODEL, shifted_pair

DISPARITY = 9.0


def plane() -> Sample:
    """A plane that faces the cameras, whose left band the right view does not show."""
    left, right = shifted_pair(240, 320, int(DISPARITY))
    hidden = np.zeros(left.shape[:2], bool)
    hidden[:, : int(DISPARITY) + 1] = True
    truth = np.full(left.shape[:2], DISPARITY, np.float32)
    return Sample("1", left, right, truth, None, hidden, 210.0, 4.5)


def test_clean_pairs_are_trusted_and_faults_are_named():
    chosen = ("clean", "circular field of view", "right covered, black", "the left view twice, one bit changed")
    cases = tuple(case for case in (*USABLE, *FAULTS) if case.name in chosen)
    found = measure(str(TINY_MODEL), [plane()], cases)
    assert set(found) == set(chosen)
    clean = found["clean"]
    assert clean["status"] == {"OK": 1} and clean["causes"] == {}
    assert clean["right_called_valid"] > 0.9 and clean["ause"] is not None
    assert found["circular field of view"]["outside_called_valid"] < 0.01
    for name in chosen[2:]:
        assert found[name]["named"] == 1 and found[name]["status"] == {"INVALID": 1}


def test_a_case_does_not_see_the_frames_of_another_one():
    cases = [Case(str(number), FAULTS[0].spoil) for number in range(7)]  # one left view, so often
    found = measure(str(TINY_MODEL), [plane()], tuple(cases))
    assert not any("FROZEN" in result["causes"] for result in found.values())


def test_every_case_changes_the_pair_and_keeps_its_shape():
    sample = plane()
    names = [case.name for case in (*USABLE, *FAULTS)]
    assert len(set(names)) == len(names)
    for case in (*USABLE[1:], *FAULTS):
        spoilt = case.spoil(sample, np.random.default_rng(1))
        assert spoilt.left.shape == spoilt.right.shape == sample.left.shape
        assert spoilt.left.dtype == spoilt.right.dtype == np.uint8
        same = np.array_equal(spoilt.left, sample.left) and np.array_equal(spoilt.right, sample.right)
        assert not same, case.name


def test_a_wrong_answer_is_counted_as_wrong():
    sample = plane()
    rig = StereoCalibration.rectified(210.0, 4.5, (320, 240))
    with DepthEstimator(TINY_MODEL, calibration=rig) as estimator:
        answer = estimator.predict(sample.left, sample.right)
    answer.disparity[100:140, 100:200] += 5
    tally = Tally()
    tally.add(sample, answer, Case("a block off", lambda s, rng: s, (Cause.COVERED,)), 31.0)
    assert tally.pixels["wrong"] >= 40 * 100
    assert tally.result(Case("a block off", lambda s, rng: s))["wrong_called_valid"] > 0.9
