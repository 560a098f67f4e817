"""Bilinear resizing against torch and the numpy twin, in every instruction set."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from endosdk import _core
from tests.core_rigs import every_isa
from tests.reference import resampling

pytestmark = pytest.mark.usefixtures("restored_settings")

SIZES = [  # source height and width, full output height and width
    ((90, 120), (720, 960)),
    ((45, 60), (360, 480)),
    ((37, 53), (301, 419)),
    ((30, 40), (30, 40)),
    ((61, 47), (20, 19)),
    ((1, 1), (5, 9)),
    ((2, 3), (2, 3)),
    ((2, 3), (17, 40)),
    ((7, 5), (1, 1)),
]


def random_map(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(1, 70, (height, width)).astype(np.float32)


def resize(source: np.ndarray, full: tuple[int, int], crop: tuple[int, int] | None = None, gain: float = 1.0):
    out = np.full(crop or full, -1, np.float32)
    _core.resize_bilinear(source, out, source.shape[0] / full[0], source.shape[1] / full[1], gain)
    return out


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize(("source_size", "full"), SIZES)
def test_equals_torch_and_twin(isa: str, threads: int, source_size: tuple[int, int], full: tuple[int, int]) -> None:
    _core.set_isa(isa)
    _core.set_threads(threads)
    source = random_map(*source_size)
    ours = resize(source, full)
    theirs = torch.nn.functional.interpolate(
        torch.from_numpy(source)[None, None], size=full, mode="bilinear", align_corners=False
    )
    np.testing.assert_allclose(ours, theirs[0, 0].numpy(), rtol=1e-5, atol=0)
    twin = resampling.resize_bilinear(source, *full, source_size[0] / full[0], source_size[1] / full[1], 1.0)
    np.testing.assert_allclose(ours, twin, rtol=1e-4, atol=0)
    _core.set_isa("plain")
    _core.set_threads(1)
    np.testing.assert_array_equal(ours, resize(source, full))


@every_isa
def test_output_may_be_the_top_left_part_and_is_multiplied(isa: str) -> None:
    _core.set_isa(isa)
    source = random_map(23, 31)
    full = resize(source, (184, 248))
    part = resize(source, (184, 248), crop=(179, 241), gain=8.0)
    np.testing.assert_allclose(part, 8 * full[:179, :241], rtol=1e-6)


@every_isa
def test_a_constant_map_stays_exactly_constant(isa: str) -> None:
    _core.set_isa(isa)
    constant = np.full((9, 13), 0.1, np.float32)
    assert np.unique(resize(constant, (100, 91))).tolist() == [constant[0, 0]]


@every_isa
def test_what_is_not_a_number_stays_local(isa: str) -> None:
    _core.set_isa(isa)
    source = random_map(20, 20)
    source[10, 10] = np.nan
    out = resize(source, (160, 160))
    bad = np.argwhere(np.isnan(out))
    assert bad.min() >= 8 * 9 + 3
    assert bad.max() <= 8 * 12 - 4
    assert np.isnan(out[84, 84])


SOURCE, OUT = np.ones((4, 6), np.float32), np.ones((8, 12), np.float32)
READ_ONLY = np.ones((8, 12), np.float32)
READ_ONLY.flags.writeable = False


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SOURCE.astype(float), OUT, 0.5, 0.5, 1.0), "src: must be float32; got float64"),
        ((SOURCE[None], OUT, 0.5, 0.5, 1.0), "src: must have shape [height, width]; got (1, 4, 6)"),
        ((SOURCE[:, ::2], OUT, 0.5, 0.5, 1.0), "src: must be C-contiguous"),
        ((SOURCE[:0], OUT, 0.5, 0.5, 1.0), "src: must not be empty; got 6x0"),
        ((SOURCE, OUT[:, :0], 0.5, 0.5, 1.0), "out: must"),
        ((SOURCE, READ_ONLY, 0.5, 0.5, 1.0), "out: must be writable"),
        ((SOURCE, OUT, 0.0, 0.5, 1.0), "scale_y: must be positive and finite; got 0"),
        ((SOURCE, OUT, 0.5, np.nan, 1.0), "scale_x: must be positive and finite"),
        ((SOURCE, OUT, 0.5, 0.5, -1.0), "gain: must be positive and finite; got -1"),
    ],
)
def test_bad_arguments_are_named(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match="; got ") as caught:
        _core.resize_bilinear(*arguments)
    assert str(caught.value).startswith(message)
