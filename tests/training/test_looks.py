import cv2
import numpy as np
import pytest

from endosdk.training import augment, looks
from endosdk.training.augment import Pair, random_pair
from tests.training.warped_scenes import warped_pair

CROP = (96, 192)


def whole(seed=0):
    return Pair(*warped_pair(seed, (256, 384)))


def drawn(seed, switches, monkeypatch=None, always=None):
    if always is not None:
        monkeypatch.setattr(augment, "CHANCES", {name: float(name == always) for name in looks.LOOKS})
    return random_pair(whole(), None, CROP, np.random.default_rng(seed), switches)


@pytest.mark.parametrize("look", looks.LOOKS)
def test_every_look_changes_the_pair_and_keeps_its_form(look, monkeypatch):
    plain, changed = drawn(3, (), monkeypatch, look), drawn(3, (look,), monkeypatch, look)
    assert not np.array_equal(plain.right, changed.right)
    for view in (changed.left, changed.right):
        assert view.shape == (*CROP, 3)
        assert view.dtype == np.uint8
    assert changed.disparity.shape == CROP
    again = drawn(3, (look,), monkeypatch, look)
    assert np.array_equal(changed.left, again.left)
    assert np.array_equal(changed.right, again.right)


@pytest.mark.parametrize("look", [look for look in looks.LOOKS if look not in ("scale", "field")])
def test_looks_leave_the_truth_alone(look, monkeypatch):
    plain, changed = drawn(5, (), monkeypatch, look), drawn(5, (look,), monkeypatch, look)
    np.testing.assert_array_equal(plain.disparity, changed.disparity)


def test_a_rig_that_moved_leaves_points_in_their_columns():
    across = np.tile(np.linspace(0, 255, 192).astype(np.uint8)[None, :, None], (256, 1, 3))
    down = np.ascontiguousarray(across.swapaxes(0, 1))
    for seed in range(8):
        assert np.array_equal(looks.misaligned(across, np.random.default_rng(seed), rows_px=2.0, degrees=2.0), across)
        moved = looks.misaligned(down, np.random.default_rng(seed), rows_px=2.0, degrees=2.0)
        assert not np.array_equal(moved, down)


def test_there_is_no_truth_outside_the_field_of_view():
    for seed in range(12):
        shown, other = looks.field_of_view((120, 160), np.random.default_rng(seed))
        assert shown.shape == other.shape == (120, 160)
        assert 0.3 < shown.mean() <= 1.0
        assert (shown != other).mean() < 0.2
    view = np.full((120, 160, 3), 90, np.uint8)
    dark = looks.outside_dark(view, shown, np.random.default_rng(0))
    assert np.array_equal(dark[shown], view[shown])
    assert dark[~shown].max() < 30


def test_a_video_chain_takes_detail_and_moves_nothing():
    left, right, _ = warped_pair(1, (96, 160))
    for seed in range(12):
        both = looks.filmed(left, right, np.random.default_rng(seed))
        for view, sent in zip((left, right), both, strict=True):
            before, after = (cv2.cvtColor(part, cv2.COLOR_RGB2GRAY).astype(np.float32) for part in (view, sent))
            moved, _ = cv2.phaseCorrelate(before, after, cv2.createHanningWindow(before.shape[::-1], cv2.CV_32F))
            assert np.hypot(*moved) < 0.1
            assert 0.3 < after.std() / before.std() < 1.5


def test_a_wide_scale_reaches_larger_disparities():
    reach = {
        switches: max(np.nanmax(drawn(seed, switches).disparity) for seed in range(12)) for switches in ((), ("scale",))
    }
    assert reach[("scale",)] > 1.15 * reach[()]


def test_other_colours_are_the_same_in_both_views():
    left, right, _ = warped_pair(1, (64, 96))
    for seed in range(8):
        both = looks.recoloured(left, left, np.random.default_rng(seed))
        assert np.array_equal(*both)
    grey = [looks.recoloured(left, right, np.random.default_rng(seed))[0] for seed in range(20)]
    assert any(np.ptp(view, axis=2).max() <= 1 for view in grey)


def test_compression_keeps_more_of_red_than_of_blue():
    texture = np.kron(np.random.default_rng(0).integers(60, 200, (24, 48)), np.ones((4, 4))).astype(np.uint8)
    lost = []
    for channel in (0, 2):
        view = np.full((*CROP, 3), 100, np.uint8)
        view[..., channel] = texture
        stored, _ = looks.compressed(view, view, np.random.default_rng(1))
        lost.append(np.abs(stored[..., channel].astype(float) - texture).mean())
    assert lost[0] < 0.95 * lost[1]
