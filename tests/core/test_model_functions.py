"""Functions of model files: the loops against the numpy twin and the plain loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from endosdk import _core
from endosdk.errors import EndoError
from tests.core_rigs import every_isa
from tests.reference import model_functions as twin

SIZES = [(1, 1, 1), (1, 2, 3), (1, 5, 8), (2, 9, 13), (1, 12, 33)]  # batch, and cells down and along


def views_for(count: int, height: int, width: int) -> list[np.ndarray]:
    generator = np.random.default_rng(height * width)
    return [generator.integers(0, 256, (count, 3, height, width), np.uint8) for _ in range(2)]


def read(name: str, twin_of: Callable[..., Any], down: int, along: int) -> Callable[..., Any]:
    def case(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
        views = views_for(count, down * height, along * width)
        return views, {}, twin_of(*views)

    case.__name__ = name
    return case


def compare_views(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    bright = generator.uniform(0, 4, (2 * count, 1, 2 * height, 4 * width)).astype(np.float32)
    disparity = generator.uniform(-3, 4 * width, (count, 1, height, width)).astype(np.float32)
    return [bright, disparity], {"unit": 16.0}, twin.compare_views(bright, disparity, 16.0)


def answer_of_planes(
    count: int, height: int, width: int, dense: int = 6, sparse: int = 4, reach: int = 2
) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    planes = dense + sparse
    cost = generator.normal(0, 6, (count, 2, planes // 2, height * width, 4)).astype(np.float32)
    correction = generator.normal(0, 3, (count, height, width, 4 * planes)).astype(np.float32)
    settings = {"dense": dense, "sparse": sparse, "reach": reach}
    return [cost, correction], settings, twin.answer_of_planes(cost, correction, **settings)


def planes_around(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    pairs, channels = 1 + height % 4, 32 if width % 2 else 6
    generator = np.random.default_rng(height * width)
    planes = generator.integers(0, 256, (count * pairs, height, width, channels), np.uint8)
    return [planes], {"pairs": pairs}, twin.planes_around(planes, pairs)


def choose_surface(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    shapes = [(count, channels, height, width) for channels in (4, 12, 1, 6)]
    scales = (0.5, 5.0, 20.0, 10.0)
    inputs = [generator.normal(0, s, shape).astype(np.float32) for s, shape in zip(scales, shapes, strict=True)]
    return inputs, {}, twin.choose_surface(*(values.astype(np.float64) for values in inputs))


CASES = {
    "ReadViews": read("ReadViews", twin.read_views, 8, 4),
    "ReadSmaller": read("ReadSmaller", twin.read_smaller, 8, 16),
    "CompareViews": compare_views,
    "AnswerOfPlanes": answer_of_planes,
    "PlanesAroundBytes": planes_around,
    "ChooseSurface": choose_surface,
}


@every_isa
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("name", CASES)
def test_equals_twin_and_plain(isa: str, size: tuple[int, int, int], name: str, restored_settings: None) -> None:
    inputs, settings, expected = CASES[name](*size)
    _core.set_isa("plain")
    plain = _core.model_function(name, inputs, settings)
    _core.set_isa(isa)
    found = _core.model_function(name, inputs, settings)
    for map_found, map_plain, map_expected in zip(found, plain, expected, strict=True):
        np.testing.assert_array_equal(map_found, map_plain)
        np.testing.assert_allclose(map_found, map_expected, rtol=2e-5, atol=2e-4)


@pytest.mark.parametrize(("dense", "sparse", "reach"), [(8, 0, 2), (8, 0, 0), (6, 4, 0), (2, 30, 1)])
def test_planes_of_any_kind(dense: int, sparse: int, reach: int) -> None:
    inputs, settings, expected = answer_of_planes(1, 4, 7, dense, sparse, reach)
    for found, wanted in zip(_core.model_function("AnswerOfPlanes", inputs, settings), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=5e-4)


def test_what_is_no_number_does_no_harm() -> None:
    for name in ("CompareViews", "AnswerOfPlanes", "ChooseSurface"):
        inputs, settings, _ = CASES[name](1, 9, 13)
        for i in range(len(inputs)):
            spoilt = [values.copy() for values in inputs]
            spoilt[i].flat[::7] = np.nan
            spoilt[i].flat[3::7] = np.inf
            _core.model_function(name, spoilt, settings)  # must not crash


@pytest.mark.parametrize("name", CASES)
def test_wrong_shapes_are_refused(name: str) -> None:
    inputs, settings, _ = CASES[name](1, 5, 8)
    for i, values in enumerate(inputs):
        wrong = [*inputs[:i], np.ascontiguousarray(values[..., 1:]), *inputs[i + 1 :]]  # an odd number of channels
        with pytest.raises(EndoError, match="must have the shape"):
            _core.model_function(name, wrong, settings)
        with pytest.raises(EndoError):
            _core.model_function(name, [*inputs[:i], values.astype(np.int16), *inputs[i + 1 :]], settings)
    with pytest.raises(EndoError):
        _core.model_function(name, inputs[:-1], settings)
    with pytest.raises(EndoError, match="function that model files have"):
        _core.model_function("Nothing", inputs, settings)


def test_wrong_settings_are_refused() -> None:
    inputs, settings, _ = answer_of_planes(1, 5, 8)
    for wrong in ({"dense": 5}, {"dense": -2}, {"sparse": -2}, {"dense": 1000}):
        with pytest.raises(EndoError, match="even number"):
            _core.model_function("AnswerOfPlanes", inputs, settings | wrong)
    inputs, _, _ = compare_views(1, 5, 8)
    with pytest.raises(EndoError, match="above 0"):
        _core.model_function("CompareViews", inputs, {})
