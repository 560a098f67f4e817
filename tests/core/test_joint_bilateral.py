"""Joint bilateral upsampling of disparity: against the numpy twin, in every instruction set, and what it is for."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from endosdk import _core
from tests.core_rigs import every_isa
from tests.reference import postprocess, resampling

pytestmark = pytest.mark.usefixtures("restored_settings")


def scene(height: int, width: int, factor: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A bright instrument over dark tissue: disparity and confidence of cells, a view of factor x factor px a cell."""
    rng = np.random.default_rng(seed)
    view = rng.normal(70, 12, (3, height * factor, width * factor))
    y, x = np.mgrid[: height * factor, : width * factor]
    near = np.abs(x - 0.6 * width * factor - 0.3 * y) < 0.15 * width * factor
    view[:, near] += 110
    disparity = np.where(near, 20.0, 8.0) + 0.01 * x
    cells = disparity.reshape(height, factor, width, factor).mean(axis=(1, 3))
    confidence = np.where(cells % 12 < 9, 0.9, 0.3) * rng.uniform(0.9, 1.1, cells.shape)
    return cells.astype(np.float32), confidence.astype(np.float32), np.clip(view, 0, 255).astype(np.uint8)


def upsampled(disparity: np.ndarray, confidence: np.ndarray, view: np.ndarray, **options) -> np.ndarray:
    """What comes out at the size of the view."""
    height, width = view.shape[1:]
    scale = disparity.shape[1] / width
    fields = {"disparity": disparity, "confidence": confidence, "left": view, "scale": (scale, scale)} | options
    out = maps(height, width)
    _core.postprocess(fields, out)
    return out["disparity"]


def maps(height: int, width: int) -> dict[str, np.ndarray]:
    """Memory of the outputs."""
    kinds = {"disparity": np.float32, "confidence": np.float32, "reasons": np.uint8}
    return {name: np.empty((height, width), kind) for name, kind in kinds.items()}


@functools.cache
def twin_of_scene(size: tuple[int, int, int]) -> np.ndarray:
    """The slow twin, once for all instruction sets and numbers of threads."""
    twin = postprocess.joint_bilateral_upsampling(*scene(*size))
    twin.flags.writeable = False
    return twin


@every_isa
@pytest.mark.parametrize("threads", [1, 3])
@pytest.mark.parametrize("size", [(1, 1, 2), (2, 3, 4), (9, 13, 2), (5, 70, 2), (7, 66, 3), (4, 9, 16)])
def test_equals_twin_and_plain(isa: str, threads: int, size: tuple[int, int, int]) -> None:
    pair = scene(*size)
    _core.set_isa(isa)
    _core.set_threads(threads)
    found = upsampled(*pair)
    np.testing.assert_allclose(found, twin_of_scene(size), rtol=2e-6)
    _core.set_isa("plain")
    _core.set_threads(1)
    np.testing.assert_array_equal(found, upsampled(*pair))


@every_isa
def test_extreme_confidences_and_what_is_no_number(isa: str) -> None:
    _core.set_isa(isa)
    disparity, confidence, view = scene(8, 40, 2)
    confidence[0, :5] = [0.0, 1.0, np.nan, -1.0, 2.0]
    np.testing.assert_allclose(
        upsampled(disparity, confidence, view),
        postprocess.joint_bilateral_upsampling(disparity, confidence, view),
        rtol=2e-6,
    )
    disparity[4, 20] = np.nan
    found = upsampled(disparity, confidence, view)
    spoilt = np.isnan(found)
    assert spoilt[8:10, 40:42].all()
    assert not spoilt[:2].any()
    assert not spoilt[:, :34].any()
    assert not spoilt[:, 48:].any()


def test_edges_come_to_lie_on_those_of_the_view() -> None:
    factor, height, width = 4, 24, 32
    view = np.full((3, height * factor, width * factor), 60, np.uint8)
    view[:, :, 50:] = 180  # within a cell, whose disparity is then between both
    truth = np.where(np.arange(width * factor) < 50, 10.0, 30.0)
    cells = truth.reshape(width, factor).mean(axis=1)
    disparity = np.broadcast_to(cells, (height, width)).astype(np.float32).copy()
    confidence = np.full((height, width), 0.9, np.float32)
    found = np.abs(upsampled(disparity, confidence, view) - truth)
    bilinear = np.abs(upsampled(disparity, confidence, view, left=None) - truth)
    assert found.max() < 0.01
    assert bilinear.max() > 8.0


def test_sure_cells_count_more_than_unsure_ones() -> None:
    view = np.full((3, 20, 20), 90, np.uint8)
    disparity = np.full((10, 10), 10.0, np.float32)
    confidence = np.full((10, 10), 0.95, np.float32)
    disparity[5, 5] = 40.0
    trusted = upsampled(disparity, confidence, view)[10, 10]
    confidence[5, 5] = 0.05
    doubted = upsampled(disparity, confidence, view)[10, 10]
    assert 10.0 < doubted < 10.5 < trusted


def test_a_constant_stays_and_views_without_a_whole_number_of_pixels_a_cell_are_resized() -> None:
    view = np.random.default_rng(3).integers(0, 256, (3, 30, 50)).astype(np.uint8)
    constant, confidence = np.full((15, 25), 12.5, np.float32), np.full((15, 25), 0.7, np.float32)
    np.testing.assert_allclose(upsampled(constant, confidence, view), 12.5, rtol=3e-6)
    confidence = np.full((10, 20), 0.7, np.float32)
    slanted = np.add.outer(np.zeros(10), np.arange(20.0)).astype(np.float32)
    twin = resampling.resize_bilinear(slanted, 30, 50, 20 / 50, 20 / 50, 1.0)
    np.testing.assert_allclose(upsampled(slanted, confidence, view), twin, rtol=1e-5, atol=1e-5)


def test_the_output_may_be_larger_than_the_view() -> None:
    disparity, confidence, view = scene(12, 20, 2)
    out = maps(96, 160)
    scales = {"scale": (1 / 8, 1 / 8), "view_scale": (0.25, 0.25), "gain": 4.0}
    _core.postprocess({"disparity": disparity, "confidence": confidence, "left": view} | scales, out)
    fine = postprocess.joint_bilateral_upsampling(disparity, confidence, view)
    np.testing.assert_allclose(out["disparity"], resampling.resize_bilinear(fine, 96, 160, 0.25, 0.25, 4.0), rtol=1e-5)
    np.testing.assert_allclose(
        out["confidence"], resampling.resize_bilinear(confidence, 96, 160, 1 / 8, 1 / 8, 1.0), rtol=1e-5
    )
