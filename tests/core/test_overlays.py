"""Text, menus and insets that a program has drawn into both frames show no scene, so they have no depth."""

import cv2
import numpy as np
import pytest

from endosdk import DepthEstimator, Reason, _core
from endosdk.datasets.layouts import open_dataset
from tests.conftest import ROOT, TINY_MODEL, shifted_pair
from tests.reference import overlays
from tests.rigs import raw_rig


def with_menu(view: np.ndarray, opacity: float = 1.0) -> np.ndarray:
    """A view under a menu of five lines, in the upper left."""
    shown = view.copy()
    height, width = view.shape[:2]
    top, left, bottom, right = (
        int(size * share) for size, share in zip((height, width) * 2, (0.1, 0.1, 0.5, 0.6), strict=True)
    )
    panel = shown[top:bottom, left:right]
    panel[:] = (1 - opacity) * panel + opacity * np.array((40, 35, 30))
    for line in range(5):
        place = (left + width // 50, top + int((bottom - top) * (0.18 + 0.18 * line)))
        cv2.putText(
            shown,
            f"PATIENT 01 ZOOM x1.{line}",
            place,
            cv2.FONT_HERSHEY_SIMPLEX,
            width / 1000,
            (230,) * 3,
            max(1, width // 480),
        )
    return shown


def tissue(height: int, width: int) -> list[np.ndarray]:
    """A pair 9 px apart, with less contrast than text."""
    return [(0.3 * view + 60).astype(np.uint8) for view in shifted_pair(height, width, 9)]


def blocks_over(covered: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Blocks as pixels; what the last blocks leave over belongs to them."""
    side = overlays.side_of(shape[1])
    rows, columns = (
        np.minimum(np.arange(size) // side, count - 1) for size, count in zip(shape, covered.shape, strict=True)
    )
    return covered[rows[:, None], columns]


@pytest.mark.parametrize("shape", [(120, 200), (90, 960, 3), (480, 640, 3), (135, 240, 3), (270, 1920, 3), (7, 3, 3)])
@pytest.mark.parametrize("opacity", [0.0, 0.6, 1.0])
def test_equal_blocks_equal_twin(shape, opacity):
    rng = np.random.default_rng(0)
    pair = [with_menu(view, opacity) for view in shifted_pair(*shape[:2], 9)]
    noisy = [np.clip(view + rng.normal(0, 1.5, view.shape), 0, 255).astype(np.uint8) for view in pair]
    for views in (pair, noisy, [pair[0], pair[0]]):
        left, right = views if len(shape) == 3 else [np.ascontiguousarray(view[..., 1]) for view in views]
        marks = _core.equal_blocks(left, right)
        np.testing.assert_array_equal(marks, overlays.equal_blocks(left, right))
    assert marks.all()  # of one picture twice


@pytest.mark.parametrize("opacity", [0.0, 0.6, 1.0])
def test_what_covers_the_scene_is_outside_the_view(opacity):
    left, right = (with_menu(view, opacity) for view in tissue(480, 640))
    covered = overlays.covered_blocks(overlays.equal_blocks(left, right), np.zeros((43, 58), bool))
    assert 0.05 < covered.mean() < 0.4
    with DepthEstimator(TINY_MODEL) as estimator:
        result = estimator.predict(left, right)
    over = blocks_over(covered, (480, 640))
    # The map has cells of about two pixels, whose middle decides.
    sure = cv2.erode(over.astype(np.uint8), np.ones((5, 5))) > 0
    far = cv2.dilate(over.astype(np.uint8), np.ones((5, 5))) == 0
    outside = (result.reasons & Reason.OUTSIDE_VIEW) > 0
    assert outside[sure].all() and not outside[far].any()
    # A pixel whose match the overlay of the right view covers has none.
    moved = np.zeros_like(sure)
    moved[:, 20:] = sure[:, 11:-9]
    assert ((result.reasons & Reason.OUTSIDE_OVERLAP) > 0)[moved & (np.abs(result.disparity - 9) < 1)].all()


def test_overlays_of_raw_frames_are_found_where_rectification_moves_them():
    rig = raw_rig().scaled(320, 240)
    left, right = (with_menu(view) for view in tissue(240, 320))
    with DepthEstimator(TINY_MODEL, calibration=rig) as estimator:
        result = estimator.predict(left, right)
        covered = overlays.covered_blocks(overlays.equal_blocks(left, right), np.zeros((48, 64), bool))
        raw = np.repeat(blocks_over(covered, (240, 320))[..., None], 3, axis=2).astype(np.uint8)
        over = estimator.rectify(200 * raw, 200 * raw)[0][..., 0] // 100
    sure = cv2.erode(over, np.ones((5, 5))) > 0
    far = cv2.dilate(over, np.ones((5, 5))) == 0
    outside = (result.reasons & Reason.OUTSIDE_VIEW) > 0
    assert sure.any() and outside[sure].all() and not outside[far].any()


def test_the_rim_of_a_round_picture_is_no_overlay():
    rows, columns = np.indices((480, 640))
    inside = np.hypot(rows - 240, columns - 320) < 230
    pair = [np.where(inside[..., None], view, 4).astype(np.uint8) for view in tissue(480, 640)]
    with DepthEstimator(TINY_MODEL) as estimator:
        result = estimator.predict(*pair)
    well_inside = np.hypot(rows - 240, columns - 320) < 220
    assert not ((result.reasons & Reason.OUTSIDE_VIEW) > 0)[well_inside].any()


def test_text_beside_a_round_picture_takes_nothing_from_it():
    rows, columns = np.indices((480, 640))
    inside = np.hypot(rows - 240, columns - 320) < 230
    pair = []
    for view in tissue(480, 640):
        shown = np.where(inside[..., None], view, 4).astype(np.uint8)
        cv2.putText(shown, "ID 0417", (4, 40), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (230,) * 3, 1)
        pair.append(shown)
    assert (_core.equal_blocks(*pair) == overlays.TELLING).any()
    with DepthEstimator(TINY_MODEL) as estimator:
        result = estimator.predict(*pair)
    well_inside = np.hypot(rows - 240, columns - 320) < 220
    assert not ((result.reasons & Reason.OUTSIDE_VIEW) > 0)[well_inside].any()


def test_one_view_twice_is_no_overlay():
    left = tissue(480, 640)[0]
    with DepthEstimator(TINY_MODEL) as estimator:
        assert not (estimator.predict(left, left.copy()).reasons & Reason.OUTSIDE_VIEW).any()


def test_clean_pairs_have_no_overlays():
    pairs = open_dataset(ROOT / "datasets" / "endosim-gi-cycles", "test")
    for i in range(0, len(pairs), 6):
        marks = _core.equal_blocks(pairs[i].left, pairs[i].right)
        assert (marks == overlays.TELLING).sum() == 0
