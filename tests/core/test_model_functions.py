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

ANY_SIZE = {("ConfidenceOfScale", 0), ("ThinConvolution", 0)}  # functions and inputs that are maps of any size
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
    inputs = [drawn(generator, scale, *shape) for scale, shape in zip(scales, shapes, strict=True)]
    return inputs, {}, twin.choose_surface(*in_doubles(inputs))


def drawn(generator: np.random.Generator, scale: float, *shape: int) -> np.ndarray:
    return generator.normal(0, scale, shape).astype(np.float32)


def in_doubles(inputs: list[np.ndarray]) -> list[np.ndarray]:
    return [values.astype(np.float64) for values in inputs]


def match_evidence(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    inputs = [drawn(generator, 20, count, 1, height, width), np.abs(drawn(generator, 3, count, 1, height, width))]
    return inputs, {"cell": 4.0}, twin.match_evidence(*in_doubles(inputs), 4.0)


def clues_of_answer(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    scales = (1.0, 20.0, 0.5, 5.0)
    shapes = [(24, height, width), (1, height, width), (4, height, width), (1, 2 * height, 2 * width)]
    inputs = [drawn(generator, scale, count, *shape) for scale, shape in zip(scales, shapes, strict=True)]
    return inputs, {"unit": 16.0}, twin.clues_of_answer(*in_doubles(inputs), 16.0)


def scale_of_errors(
    count: int, height: int, width: int, evidence: int = 6
) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    maps = [drawn(generator, 1.0, count, channels, height, width) for channels in (evidence, 27)]
    weights = [drawn(generator, 0.2, 8, evidence + 27, 1, 1), drawn(generator, 0.2, 8)]
    for _ in range(3):
        weights += [drawn(generator, 0.2, 8, 8, 3, 3), drawn(generator, 0.2, 8)]
    inputs = [*maps, *weights, drawn(generator, 0.3, 1 + evidence + 8)]
    return inputs, {}, twin.scale_of_errors(*in_doubles(inputs))


def thin_convolution(
    count: int, height: int, width: int, channels: int = 32
) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    shapes = [(count, channels, height, width), (4, channels, 3, 3), (4,)]
    inputs = [drawn(generator, scale, *shape) for scale, shape in zip((1.0, 0.3, 0.3), shapes, strict=True)]
    return inputs, {}, twin.thin_convolution(*in_doubles(inputs))


def volume_of_pairs(
    count: int, height: int, width: int, dense: int = 6, sparse: int = 4
) -> tuple[list[np.ndarray], dict[str, float], Any]:
    generator = np.random.default_rng(height * width)
    inputs = []
    for scale, zero in ((0.5, 120), (0.75, 100)):  # sums of these are exact, so that all round alike
        inputs.append(generator.integers(0, 256, (count, height, width, 32 if width % 2 else 6), np.uint8))
        inputs += [np.array(scale, np.float32), np.array(zero, np.uint8)]
    inputs += [np.array(0.5, np.float32), np.array(2, np.uint8)]
    settings = {"dense": dense, "sparse": sparse}
    return inputs, settings, twin.volume_of_pairs(*in_doubles(inputs), **settings)


def confidence_of_scale(count: int, height: int, width: int) -> tuple[list[np.ndarray], dict[str, float], Any]:
    inputs = [drawn(np.random.default_rng(height * width), 2.0, count, 1, height, width)]
    return inputs, {}, twin.confidence_of_scale(*in_doubles(inputs))


CASES = {
    "ReadViews": read("ReadViews", twin.read_views, 8, 4),
    "ReadSmaller": read("ReadSmaller", twin.read_smaller, 8, 16),
    "CompareViews": compare_views,
    "AnswerOfPlanes": answer_of_planes,
    "PlanesAroundBytes": planes_around,
    "ChooseSurface": choose_surface,
    "MatchEvidence": match_evidence,
    "CluesOfAnswer": clues_of_answer,
    "ScaleOfErrors": scale_of_errors,
    "VolumeOfPairsBytes": volume_of_pairs,
    "ThinConvolution": thin_convolution,
    "ConfidenceOfScale": confidence_of_scale,
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


@pytest.mark.parametrize(("dense", "sparse"), [(2, 0), (22, 0), (16, 6), (2, 120)])
def test_volumes_of_any_kind(dense: int, sparse: int) -> None:
    inputs, settings, (wanted,) = volume_of_pairs(1, 4, 7, dense, sparse)
    (found,) = _core.model_function("VolumeOfPairsBytes", inputs, settings)
    np.testing.assert_array_equal(found, wanted)


@every_isa
@pytest.mark.parametrize("name", ["ScaleOfErrors", "ThinConvolution"])
def test_thin_layers_of_long_rows(isa: str, name: str, restored_settings: None) -> None:
    inputs, settings, expected = CASES[name](1, 20, 120)
    _core.set_isa(isa)
    for found, wanted in zip(_core.model_function(name, inputs, settings), expected, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=2e-5, atol=2e-4)


def test_what_is_no_number_does_no_harm() -> None:
    for name in CASES:
        inputs, settings, _ = CASES[name](1, 9, 13)
        for i, values in enumerate(inputs):
            if values.dtype == np.uint8:
                continue
            spoilt = [values.copy() for values in inputs]
            spoilt[i].flat[::7] = np.nan
            spoilt[i].flat[3::7] = np.inf
            _core.model_function(name, spoilt, settings)  # must not crash


@pytest.mark.parametrize("name", CASES)
def test_wrong_shapes_are_refused(name: str) -> None:
    inputs, settings, _ = CASES[name](1, 5, 8)
    for i, values in enumerate(inputs):
        if values.ndim == 0:
            others = [values[None]]
        else:
            others = [values[..., 1:], values[0]]  # an odd number of channels, an axis less
        for other in others if (name, i) not in ANY_SIZE else others[1:]:
            wrong = [*inputs[:i], np.ascontiguousarray(other), *inputs[i + 1 :]]
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
    volume, of_volume, _ = volume_of_pairs(1, 5, 8)
    for wrong in ({"dense": 5}, {"dense": 0}, {"sparse": -2}, {"sparse": 3}, {"dense": 1000}):
        with pytest.raises(EndoError, match="even number"):
            _core.model_function("VolumeOfPairsBytes", volume, of_volume | wrong)
    for wrong in ({"dense": 5}, {"dense": -2}, {"sparse": -2}, {"dense": 1000}):
        with pytest.raises(EndoError, match="even number"):
            _core.model_function("AnswerOfPlanes", inputs, settings | wrong)
    for name in ("CompareViews", "MatchEvidence", "CluesOfAnswer"):
        inputs, _, _ = CASES[name](1, 5, 8)
        with pytest.raises(EndoError, match="above 0"):
            _core.model_function(name, inputs, {})
    inputs, _, _ = scale_of_errors(1, 5, 8, evidence=300)
    with pytest.raises(EndoError, match="at most 256 planes"):
        _core.model_function("ScaleOfErrors", inputs, {})
    inputs, _, _ = thin_convolution(1, 5, 8, channels=300)
    with pytest.raises(EndoError, match="at most 128 channels"):
        _core.model_function("ThinConvolution", inputs, {})
