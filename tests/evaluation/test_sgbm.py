import numpy as np

from endosdk.evaluation.sgbm import SgbmBaseline, fill_holes
from tests.conftest import shifted_pair


def test_finds_a_known_shift_and_leaves_holes_as_nan():
    disparity = SgbmBaseline().compute(*shifted_pair(120, 240, 17))
    assert disparity.dtype == np.float32
    inner = disparity[10:-10, 100:-10]
    assert np.nanmedian(np.abs(inner - 17)) < 0.1
    assert np.isnan(disparity[:, :17]).all()


def test_holes_take_the_farther_neighbour():
    nan = np.nan
    rows = np.array([[nan, 5, nan, nan, 3, nan], [nan] * 6, [7, nan, 9, nan, nan, 8]], np.float32)
    filled = fill_holes(rows)
    assert filled.tolist() == [[5, 5, 3, 3, 3, 3], [5, 5, 3, 3, 3, 3], [7, 7, 9, 8, 8, 8]]


def test_a_picture_without_any_answer_becomes_zero():
    assert not fill_holes(np.full((3, 4), np.nan, np.float32)).any()
