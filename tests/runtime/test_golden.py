"""Same machine, same bytes twice; other machines, the kept maps to rounding."""

import numpy as np
import pytest

from endosdk import Reason
from tests.runtime import golden


@pytest.fixture(scope="module")
def result():
    return golden.answer()


@pytest.fixture(scope="module")
def kept():
    with np.load(golden.FILE) as file:
        return dict(file)


def test_the_same_pair_gives_the_same_bytes_twice(result):
    again = golden.answer()
    for name in golden.MAPS:
        assert getattr(result, name).tobytes() == getattr(again, name).tobytes(), name
    assert (again.status, again.causes, again.measures) == (result.status, result.causes, result.measures)


def test_the_maps_are_those_that_were_kept(result, kept):
    reasons = result.reasons[::2, ::2]
    assert np.mean(reasons == kept["reasons"]) > 0.995
    same = reasons == kept["reasons"]
    np.testing.assert_allclose(result.disparity[::2, ::2][same], kept["disparity"][same], rtol=0, atol=0.02)
    np.testing.assert_allclose(result.confidence[::2, ::2][same], kept["confidence"][same], rtol=0, atol=0.01)
    np.testing.assert_allclose(result.depth[::2, ::2][same], kept["depth"][same], rtol=1e-2)
    np.testing.assert_allclose(result.sigma[::2, ::2][same], kept["sigma"][same], rtol=0.1)


def test_status_and_measures_are_those_that_were_kept(result, kept):
    assert int(result.status) == kept["status"]
    measures = {cause.name: measure for cause, measure in result.measures.items()}
    assert list(measures) == kept["names"].tolist()
    np.testing.assert_allclose(list(measures.values()), kept["measures"], rtol=0.02, atol=0.01)


def test_the_kept_maps_hold_every_reason_but_one_that_needs_a_nearer_surface(kept):
    found = {reason for reason in Reason if (kept["reasons"] & reason).any()}
    assert found >= {Reason.LOW_CONFIDENCE, Reason.OUTSIDE_OVERLAP, Reason.SATURATED, Reason.OUTSIDE_VIEW}


def test_fast_answers_the_demo_pair_as_it_was_kept():
    """By what a processor without VNNI, which saturates sums of 8-bit products, may differ: see the self test."""
    found = golden.in_cells(golden.demo_answer())
    with np.load(golden.DEMO_FILE) as kept:
        assert set(kept) == set(found)
        np.testing.assert_allclose(found["disparity"], kept["disparity"], rtol=0, atol=0.2)
        np.testing.assert_allclose(found["confidence"], kept["confidence"], rtol=0, atol=0.03)
        np.testing.assert_allclose(found["depth"], kept["depth"], rtol=0.01)
        np.testing.assert_allclose(found["sigma"], kept["sigma"], rtol=0.1)
        np.testing.assert_allclose(found["valid"], kept["valid"], rtol=0, atol=0.05)
