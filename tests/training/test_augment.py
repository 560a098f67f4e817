import numpy as np
import pytest

from endosdk.training.augment import Pair, mirror, plain_pair, random_pair
from tests.training.warped_scenes import constant_pair, warped_pair

CROP = (96, 192)


def matching(pair):
    """Mean grey difference between the left view and the right one read where the disparity says."""
    height, width = pair.disparity.shape
    x = np.arange(width)[None] - pair.disparity
    known = np.isfinite(x) & (x >= 0) & (x <= width - 1)
    rows = np.broadcast_to(np.arange(height)[:, None], x.shape)[known]
    low = np.floor(x[known]).astype(int)
    part = (x[known] - low)[:, None]
    right = pair.right.astype(np.float64)
    read = right[rows, low] * (1 - part) + right[rows, np.minimum(low + 1, width - 1)] * part
    return float(np.abs(read - pair.left[known]).mean()), float(known.mean())


def whole(seed=0, size=(256, 384)):
    return Pair(*warped_pair(seed, size))


@pytest.mark.parametrize("seed", range(6))
def test_the_truth_follows_crop_scale_and_flips(seed, monkeypatch):
    """Geometry alone: with the changes of colour and sensor left out, both views still agree."""
    same = {"_colours": lambda left, right, *_: (left, right), "_sensor": lambda view, *_: view}
    still = {"looks.misaligned": lambda view, *_, **__: view, "_occluded": lambda view, *_: view}
    for name, replacement in (same | still).items():
        monkeypatch.setattr(f"endosdk.training.augment.{name}", replacement)
    pair = random_pair(whole(seed), None, CROP, np.random.default_rng(seed))
    assert pair.left.shape == (*CROP, 3)
    difference, share = matching(pair)
    wrong, _ = matching(Pair(pair.left, pair.right, pair.disparity + 4))
    assert share > 0.5
    assert difference < 4.0
    assert 2 * difference < wrong


def test_the_mirrored_pair_is_a_pair():
    left, right, truth = constant_pair(3, CROP, 7)
    truth_right = np.full_like(truth, 7.0)
    mirrored = mirror(left, right, truth_right)
    assert matching(mirrored)[0] == 0.0
    assert matching(Pair(right[:, ::-1], left[:, ::-1], truth_right + 3))[0] > 3.0


def test_the_mirror_is_used_half_of_the_time():
    pair = whole()
    other = Pair(pair.left, pair.right, np.full_like(pair.disparity, 200.0))
    drawn = [np.nanmedian(random_pair(pair, other, CROP, np.random.default_rng(s)).disparity) for s in range(40)]
    assert 10 < sum(value > 100 for value in drawn) < 30


def test_the_same_seed_draws_the_same_pair_and_another_seed_another():
    first, again, other = (random_pair(whole(), None, CROP, np.random.default_rng(s)) for s in (5, 5, 6))
    for name in ("left", "right", "disparity"):
        assert np.array_equal(getattr(first, name), getattr(again, name), equal_nan=name == "disparity")
    assert not np.array_equal(first.left, other.left)


def test_unknown_truth_stays_unknown():
    pair = whole()
    pair.disparity[:] = np.nan
    assert np.isnan(random_pair(pair, None, CROP, np.random.default_rng(0)).disparity).all()


def test_views_differ_in_colour_but_not_in_content():
    drawn = [random_pair(whole(), None, CROP, np.random.default_rng(seed)) for seed in range(8)]
    means = np.array([[pair.left.mean(), pair.right.mean()] for pair in drawn])
    assert means.std(axis=0).min() > 5.0  # the light changes from crop to crop
    assert np.abs(means[:, 0] - means[:, 1]).max() > 1.0  # and a little between the eyes


def test_a_plain_crop_is_cut_and_nothing_else():
    pair = whole()
    drawn = plain_pair(pair, CROP, np.random.default_rng(2))
    windows = np.lib.stride_tricks.sliding_window_view(pair.disparity, CROP)
    found = np.argwhere(windows[:, :, 0, 0] == drawn.disparity[0, 0])
    assert any(np.array_equal(windows[y, x], drawn.disparity) for y, x in found)
    assert matching(drawn)[0] < 3.0


def test_a_crop_as_wide_as_the_picture_is_stretched_no_more_than_others(monkeypatch):
    same = {"_colours": lambda left, right, *_: (left, right), "_sensor": lambda view, *_: view}
    for name, replacement in (same | {"looks.misaligned": lambda view, *_, **__: view}).items():
        monkeypatch.setattr(f"endosdk.training.augment.{name}", replacement)
    rows = np.broadcast_to(np.arange(360, dtype=np.uint16)[:, None, None] // 2, (360, 480, 3)).astype(np.uint8)
    picture = Pair(rows, rows, np.full((360, 480), 10.0, np.float32))
    for seed in range(60):
        drawn = random_pair(picture, None, (256, 480), np.random.default_rng(seed))
        slope = abs(float(drawn.left[-8, 0, 0]) - float(drawn.left[8, 0, 0])) * 2 / (256 - 16)
        across, along = 1 / slope, float(np.nanmedian(drawn.disparity)) / 10.0
        assert along >= 1.0
        assert abs(np.log(across / along)) < 0.15 + 0.02
