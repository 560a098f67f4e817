"""The bench of trust runs, spoils what it says it spoils, and counts what it says it counts."""

import re
from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.accuracy.trust import THRESHOLDS, Tally, measure
from benchmarks.accuracy.trust_cases import FAULTS, USABLE, Case, next_scene
from benchmarks.tables import records, trust
from endosdk import Cause, DepthEstimator, Reason, Status, StereoCalibration
from endosdk.datasets.dataset import Sample
from tests.benchmarks.test_table_cells import columns
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


def test_another_scene_is_that_of_the_next_pair_which_shows_another():
    assert next_scene(["a", "a", "b", "b", "c"]) == [2, 2, 4, 4, 0]
    assert next_scene(["a", "b", "a"]) == [1, 2, 1]
    assert next_scene(["a", "a"]) == [None, None]
    case = next(case for case in FAULTS if case.joins_another)
    one, other = plane(), replace(plane(), right=np.full_like(plane().right, 7))
    joined = case.pair(one, other)
    assert np.array_equal(joined.right, other.right) and np.array_equal(joined.left, one.left)
    with pytest.raises(ValueError, match="no pair of another scene"):
        case.pair(one)


def test_every_case_changes_the_pair_and_keeps_its_shape():
    sample = plane()
    another = replace(sample, right=np.ascontiguousarray(sample.right[:, ::-1]))
    names = [case.name for case in (*USABLE, *FAULTS)]
    assert len(set(names)) == len(names)
    for case in (*USABLE[1:], *FAULTS):
        spoilt = case.pair(sample, another)
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


AS_IT_IS = Case("as it is", lambda sample, rng: sample)
FAULTY = Case("covered", lambda sample, rng: sample, (Cause.COVERED, Cause.DIM))


def row_of(count, **truth):
    """A sample of one row of pixels, all 100 mm away: 1000 px mm over 8 px, and 2 px that the rig has between."""
    pixels = {"disparity": np.full((1, count), 8, np.float32), "occlusion": None, "info": {}} | truth
    views = np.zeros((2, 1, count, 3), np.uint8)
    return Sample("1", *views, pixels["disparity"], None, pixels["occlusion"], 200.0, 5.0, 2.0, pixels["info"])


def tallied(sample, status=Status.OK, causes=(), largest=31.0, case=AS_IT_IS, **maps):
    """Count an answer whose maps are right and sure but for what is given; each map is the list of its row."""
    count = sample.disparity.shape[1]
    right = {"disparity": [8] * count, "depth": [100] * count, "sigma": [1] * count, "confidence": [0.9] * count}
    given = {name: row for name, row in (right | maps).items() if name != "reasons"}
    rows = {name: None if row is None else np.array([row], np.float32) for name, row in given.items()}
    reasons = np.array([maps.get("reasons", [0] * count)], np.uint8)
    answer = SimpleNamespace(status=status, causes=causes, reasons=reasons, sigma_map=rows["sigma"], **rows)
    tally = Tally()
    tally.add(sample, answer, case, largest)
    return tally


def test_a_pixel_is_right_within_one_px_and_wrong_beyond_three():
    found = tallied(row_of(8), disparity=[8, 9, 7, 9.25, 11, 11.25, 4.75, 5]).pixels
    assert (found["right"], found["wrong"], found["known"]) == (3, 2, 8)


@pytest.mark.parametrize("off", [0, 6])
def test_other_thresholds_of_confidence_drop_what_has_no_other_reason(off):
    unsure, hidden = Reason.LOW_CONFIDENCE, Reason.OUTSIDE_OVERLAP
    confidence = [0.65, 0.7, 0.85, 0.92, 0.92, 0.96, 0.96, 0.96]
    reasons = [unsure, unsure, unsure, unsure, 0, 0, hidden, unsure | hidden]
    found = tallied(row_of(8), disparity=[8 + off] * 8, confidence=confidence, reasons=reasons).pixels
    kind = "wrong" if off else "right"
    assert found[kind] == 8 and found[f"{kind}_valid"] == found["known_valid"] == 2
    assert [found[f"{kind}_from_{threshold}"] for threshold in THRESHOLDS] == [5, 4, 3, 1]
    assert not any(found[f"{'right' if off else 'wrong'}{rest}"] for rest in ("", "_valid", "_from_0.7"))


def test_errors_of_depth_within_one_and_within_two_sigma():
    """Of valid pixels alone; a third sigma is not within two."""
    depth, sigma = [100, 102, 98, 102.5, 96, 104.5, 95, 100], [2] * 7 + [9]
    found = tallied(row_of(8), depth=depth, sigma=sigma, reasons=[0] * 7 + [int(Reason.LOW_CONFIDENCE)])
    assert found.pixels["known_valid"] == found.pixels["with_sigma"] == 7
    assert (found.pixels["within_sigma"], found.pixels["within_two_sigma"]) == (3, 5)
    # All have a sigma of 2 mm, and errors of (0 + 2 + 2 + 2.5 + 4 + 4.5 + 5) / 7 = 20 / 7 mm in the mean.
    assert found.result(AS_IT_IS)["sigma_ece_mm"] == pytest.approx(20 / 7 - 2, abs=5e-4)


def test_pixels_without_a_truth_that_can_be_found_count_as_neither():
    truth = np.array([[np.nan, 1, 1.5, 30.5, 31, 40, 8, 8]], np.float32)
    occlusion = np.array([[False] * 7 + [True]])
    found = tallied(row_of(8, disparity=truth, occlusion=occlusion), disparity=truth[0] + 5).pixels
    assert found["known"] == found["wrong"] == 3


def test_pixels_outside_the_field_of_view_are_counted_apart():
    outside = np.array([[True, True, True, False, False]])
    found = tallied(row_of(5, info={"outside": outside}), reasons=[int(Reason.OUTSIDE_VIEW), 0, 0, 0, 0]).pixels
    assert (found["outside"], found["outside_valid"]) == (3, 2)


def test_confidence_is_judged_by_how_it_ranks_the_errors():
    errors = np.arange(70.0)
    sure = 1 - (errors + 1) / 100
    ranked, reverse = (
        tallied(row_of(70), disparity=8 + errors, confidence=one).result(AS_IT_IS) for one in (sure, sure[::-1])
    )
    assert ranked["ause"] == 0 and reverse["ause"] > 0.5


def test_confidence_is_right_as_often_as_it_says():
    """In a row of 960 px, its error is 2 px. Half of the pixels have a confidence of 0.25, and one in five is right."""
    sure = np.repeat([0.25, 0.95], 480)
    errors = np.where(np.arange(960) % 5, 2.0, 1.75)
    errors[480:] = 0.0
    found = tallied(row_of(960), disparity=8 + errors, confidence=sure).result(AS_IT_IS)
    bins = found["confidence_bins"]
    assert bins["pixels"] == [0, 0, 480, 0, 0, 0, 0, 0, 0, 480]
    assert bins["confidence"] == [None, None, 0.25, *[None] * 6, 0.95] and bins["right"][2::7] == [0.2, 1.0]
    assert found["confidence_ece"] == pytest.approx((0.05 + 0.05) / 2)


def test_the_highest_confidence_is_in_the_last_bin():
    assert tallied(row_of(3), confidence=[1, 0.92, 0.88]).confidence[0].tolist() == [0] * 8 + [1, 2]


def test_an_invalid_frame_says_nothing_of_confidence():
    found = tallied(row_of(8), Status.INVALID, confidence=[0] * 8).result(AS_IT_IS)
    assert found["confidence_ece"] is None and found["ause"] is None


def test_confidence_is_judged_without_a_camera_too():
    sample = replace(row_of(8), focal_px=np.nan, baseline_mm=np.nan)
    found = tallied(sample, sigma=None).result(AS_IT_IS)
    assert found["confidence_ece"] == pytest.approx(0.1, abs=1e-4) and found["ause"] == 0
    assert found["within_sigma"] is None and found["sigma_ece_mm"] is None


@pytest.mark.parametrize(
    ("status", "causes", "named"),
    [
        (Status.INVALID, (Cause.COVERED,), 1),
        (Status.DEGRADED, (Cause.BLURRED, Cause.DIM), 1),
        (Status.INVALID, (Cause.BLURRED,), 0),
        (Status.OK, (Cause.DIM,), 0),
    ],
)
def test_a_fault_is_named_by_a_frame_that_is_not_ok_and_has_one_of_its_causes(status, causes, named):
    tally = tallied(row_of(1), status, causes, case=FAULTY)
    assert tally.named == named
    assert tally.status == {status.name: 1} and tally.causes == {cause.name: 1 for cause in causes}


def test_shares_are_of_what_their_names_say():
    """Known: 1000 pixels, half of them valid. No two shares are equal."""
    pixels = Counter(known=1000, known_valid=500, with_sigma=500, within_sigma=300, within_two_sigma=450)
    pixels.update(right=800, right_valid=400, wrong=50, wrong_valid=5, outside=40, outside_valid=1)
    for i, threshold in enumerate(THRESHOLDS):
        pixels.update({f"right_from_{threshold}": 8 * (90 - i), f"wrong_from_{threshold}": 40 - i})
    tally = Tally(pixels, Counter(OK=3, INVALID=5), Counter(DIM=2), named=2, areas=[0.1, 0.4])
    plain = tally.result(AS_IT_IS)
    assert plain == {
        "pairs": 8,
        "status": {"OK": 3, "INVALID": 5},
        "causes": {"DIM": 2},
        "right": 0.8,
        "right_called_valid": 0.5,
        "wrong": 0.05,
        "wrong_called_valid": 0.1,
        "wrong_of_valid": 0.01,
        "called_valid_by_min_confidence": {
            "0.7": {"right": 0.9, "wrong": 0.8},
            "0.8": {"right": 0.89, "wrong": 0.78},
            "0.9": {"right": 0.88, "wrong": 0.76},
            "0.95": {"right": 0.87, "wrong": 0.74},
        },
        "outside_called_valid": 0.025,
        "within_sigma": 0.6,
        "within_two_sigma": 0.9,
        "ause": 0.25,
        "confidence_ece": None,
        "confidence_bins": {"pixels": [0] * 10, "confidence": [None] * 10, "right": [None] * 10},
        "sigma_ece_mm": None,
    }
    assert tally.result(FAULTY) == plain | {"expected": ["COVERED", "DIM"], "named": 0.25}


@pytest.fixture
def given(monkeypatch):
    """Tables read the records that a test gives, and no others."""
    monkeypatch.setattr(records, "shipped", lambda: {"abc"})
    return lambda found: monkeypatch.setattr(records, "read", found.__getitem__)


def test_sigma_of_a_fault_stands_where_a_frame_can_be_used(given):
    shares = {"right_called_valid": 0.011, "wrong_called_valid": 0.012, "wrong_of_valid": 0.013, "within_sigma": 0.014}
    moved = {**shares, "status": {"DEGRADED": 1, "INVALID": 8}, "named": 1.0}
    cases = {"moved": moved, "covered": {**moved, "status": {"INVALID": 9}}}
    given({"accuracy/trust": {"models": {"fast": {"model_sha256": "abc", "cases": cases}}}})
    found = {head: cells for head, *cells in columns(trust.trust_table("fast"))}
    assert found["error within sigma"] == ["1.4 %", ""]
    assert found["right pixels valid"] == ["", ""] and found["cause named"] == ["100.0 %"] * 2


def test_faults_in_some_pairs_of_a_set_that_set_no_limit(given):
    """Of these pairs, all tell how often a frame without a fault is not OK."""
    covered = {"frames": 9, "named": 8, "sets": {"one": {"frames": 5, "named": 4}, "more": {"frames": 4, "named": 3}}}
    record = {
        "model_sha256": "abc",
        "datasets": {"one": {"pairs": "clean"}, "more": {"pairs": "further"}},
        "without_fault": {"one": {"frames": 5, "status": {"OK": 4, "DEGRADED": 1}}},
        "further": {"more": {"frames": 20, "status": {"OK": 18, "INVALID": 2}}},
        "faults": {"covered": covered},
    }
    given({"accuracy/fault_naming": record})
    assert columns(trust.fault_naming_table()) == [
        ("fault", "none: frames that are not OK", "covered"),
        ("of 5 clean pairs", "1", "4"),
        ("of 4 further clean pairs", "2 of 20", "3"),
    ]


def test_the_page_says_how_often_compression_looks_like_a_moved_rig():
    page = re.sub(r"\s+", " ", (records.SOURCES / "docs" / "trust.md").read_text())
    stated = re.search(r"(\d+) of the (\d+) pairs of surgery raise RIG_MOVED. As they are, (\d+) do", page)
    cases = records.read("accuracy/trust_lap")["models"]["fast"]["cases"]
    packed, plain = (cases[name] for name in ("JPEG of quality 20", "clean"))
    assert stated, "the sentence is gone"
    assert [int(n) for n in stated.groups()] == [
        packed["causes"]["RIG_MOVED"],
        packed["pairs"],
        plain["causes"]["RIG_MOVED"],
    ]
