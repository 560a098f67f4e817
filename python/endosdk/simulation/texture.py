"""Pictures of tissue: an albedo that never repeats, and a small repeating tile of fine contrast and relief."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.bubbles import add_bubbles
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.noise import Array, fractal_tile, tile_noise
from endosdk.simulation.tissue import Tissue
from endosdk.simulation.tissue_pictures import tissue_tile
from endosdk.simulation.vessels import draw_vessels

DETAIL_PX = 1024
DETAIL_MM = 44.0  # the tile repeats after this; longer than any baseline, so a repeat is never a match in range

DEEP_TINT = np.array([0.42, 0.45, 0.62], np.float32)  # what a vessel under the surface leaves of the light
NETWORK_LOSS = np.array([0.35, 0.65, 0.6], np.float32)  # what capillaries take of it


@dataclass(frozen=True)
class TissueTexture:
    """Textures of one surface, and the mm that each covers.

    ``albedo`` uint8 [H,W,4] holds the square root of linear RGB, and wetness; ``detail`` uint8 [D,D,4] holds contrast,
    slope along u, slope along v and gloss, neutral at 128.
    """

    albedo: NDArray[np.uint8]
    detail: NDArray[np.uint8]
    size_mm: tuple[float, float]  # along u, along v
    detail_mm: float = DETAIL_MM


FLAT_TILE = np.full((16, 16, 4), 128, np.uint8)  # a detail that changes nothing

Surface = tuple[Mesh, Tissue, TissueTexture]  # as it is rendered: form, substance and what is painted on it


def paint_tissue(tissue: Tissue, seed: tuple[int, ...], size_mm: tuple[float, float], pixels: int) -> TissueTexture:
    """Paint the textures of a surface ``size_mm`` large, at most ``pixels`` along its longer side."""
    rng = np.random.default_rng(seed)
    scale = pixels / max(size_mm)  # px per mm
    shape = (_multiple(size_mm[1] * scale), _multiple(size_mm[0] * scale))
    albedo = _albedo(rng, tissue, shape, scale, (*seed, 1))
    return TissueTexture(albedo, _detail(rng, tissue), size_mm)


def _multiple(value: float) -> int:
    return max(64, round(value / 64) * 64)


def _linear(colour: tuple[float, float, float]) -> Array:
    return ((np.asarray(colour, np.float32) / 255.0) ** 2.2).astype(np.float32)


def _blend(image: Array, colour: Array, weight: Array) -> None:
    """Fade the image [H,W,3] towards a colour, in place."""
    image += (colour - image) * weight[..., None]


def _step(field: Array, threshold: float, softness: float) -> Array:
    t = np.clip((field - threshold) / softness + 0.5, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), np.float32)


def _albedo(
    rng: np.random.Generator, tissue: Tissue, shape: tuple[int, int], scale: float, bubble_seed: tuple[int, ...]
) -> NDArray[np.uint8]:
    if tissue.picture is None:
        image = _drawn_colours(rng, tissue, shape, scale)
    else:
        image = tissue_tile(tissue.picture, rng, shape, scale)
    wet = _step(tile_noise(rng, shape, max(8.0, 14 * scale)), 0.6, 1.6) * np.float32(tissue.mucus)
    if tissue.stain > 0:
        field = fractal_tile(rng, shape, 22 * scale, 4, 0.45)
        softness = float(rng.uniform(0.8, 3.0))
        stain = _step(field, float(np.quantile(field[::8, ::8], 1 - tissue.stain)), softness)
        _blend(image, _linear(tissue.stain_colour), stain * np.float32(rng.uniform(0.4, 0.9)))
        wet = np.maximum(wet, stain)
    if tissue.bubbles > 0:
        add_bubbles(image, wet, bubble_seed, tissue.bubbles, scale)
    coded = np.empty((*shape, 4), np.uint8)
    coded[..., :3] = np.sqrt(np.clip(image, 0.0, 1.0)) * 255.0 + 0.5
    coded[..., 3] = np.clip(wet, 0.0, 1.0) * 255.0 + 0.5
    return coded


def _drawn_colours(rng: np.random.Generator, tissue: Tissue, shape: tuple[int, int], scale: float) -> Array:
    """Draw base, blotches, meshes, dots and vessels: linear colours [H,W,3]."""
    blotch_px = tissue.blotch_mm * scale
    coarse = fractal_tile(rng, shape, blotch_px, 4, 0.55)
    image = np.empty((*shape, 3), np.float32)
    image[:] = _linear(tissue.base)
    _blend(image, _linear(tissue.second), _step(coarse, 0.3, 2.5) * np.float32(tissue.blotch))
    image *= np.exp(0.09 * fractal_tile(rng, shape, blotch_px * 0.6, 5, 0.6) * tissue.blotch)[..., None]
    if tissue.network > 0.02:
        image *= _network(rng, tissue, shape, scale)
    if tissue.speckle > 0.02:
        dots = _step(fractal_tile(rng, shape, 0.9 * scale, 2), 0.8, 1.0) * np.float32(0.6 * tissue.speckle)
        image *= (1.0 - dots)[..., None]
    if tissue.deep > 0.02 or tissue.vessel_density > 0.01:
        deep, surface = draw_vessels(rng, tissue, shape, scale)
        _blend(image, image.mean((0, 1)) * DEEP_TINT, deep * np.float32(0.8 * tissue.deep))
        _blend(image, _linear(tissue.vessel_colour), surface * np.float32(rng.uniform(0.45, 0.95)))
    return image


def _network(rng: np.random.Generator, tissue: Tissue, shape: tuple[int, int], scale: float) -> Array:
    """Capillary meshes: the zero lines of a noise field, present only in some regions. Factor [H,W,3]."""
    cell = tissue.network_mm * scale
    lines = np.exp(-((tile_noise(rng, shape, cell * 1.6) / 0.10) ** 2))
    lines = np.maximum(lines, 0.7 * np.exp(-((tile_noise(rng, shape, cell) / 0.14) ** 2)))
    where = _step(tile_noise(rng, shape, cell * 9.0), 0.0, 1.6) * np.float32(tissue.network)
    loss = (lines * where)[..., None] * NETWORK_LOSS
    return np.asarray(1.0 - loss, np.float32)


def _detail(rng: np.random.Generator, tissue: Tissue) -> NDArray[np.uint8]:
    shape = (DETAIL_PX, DETAIL_PX)
    scale = DETAIL_PX / DETAIL_MM
    contrast = tissue.grain * 0.7 * fractal_tile(rng, shape, tissue.grain_mm * 2.5 * scale, 3, 0.6)
    contrast += tissue.grain * 0.8 * fractal_tile(rng, shape, 3.0 * scale, 3, 0.6)
    if tissue.fibres > 0.02:
        contrast += 0.16 * tissue.fibres * tile_noise(rng, shape, (0.3 * scale, 6.0 * scale))
    relief = fractal_tile(rng, shape, tissue.bump_mm * 2.0 * scale, 2, 0.25)
    relief *= np.float32(tissue.bump * tissue.bump_mm * 0.3)
    if tissue.lobes > 0.01:
        # Lobules are round with creases between: the absolute value of noise has creases at its zero lines.
        creases = np.abs(tile_noise(rng, shape, tissue.lobe_mm * 1.6 * scale))
        relief += np.float32(tissue.lobes * tissue.lobe_mm * 0.35) * creases
        contrast -= np.float32(0.5 * tissue.lobes) * np.exp(-((creases / 0.12) ** 2))
    if tissue.pits > 0.02:
        pit = _step(tile_noise(rng, shape, tissue.pit_mm * 2.0 * scale), 0.9, 0.9)
        contrast -= np.float32(0.4 * tissue.pits) * pit
        relief -= np.float32(0.15 * tissue.pits * tissue.pit_mm) * pit
    gloss = fractal_tile(rng, shape, 5.0 * scale, 3)
    tile = np.empty((*shape, 4), np.float32)
    tile[..., 0] = 0.5 + 0.5 * np.tanh(contrast)
    tile[..., 1] = 0.5 + 0.25 * (np.roll(relief, -1, 1) - np.roll(relief, 1, 1)) * scale
    tile[..., 2] = 0.5 + 0.25 * (np.roll(relief, -1, 0) - np.roll(relief, 1, 0)) * scale
    tile[..., 3] = 0.5 + 0.2 * gloss
    return np.asarray(np.clip(tile, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
