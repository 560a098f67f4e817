"""What tools are made of: steel, dark composite, plastic, gold, thread and cloth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.noise import Array, fractal_tile, tile_noise
from endosdk.simulation.texture import FLAT_TILE, TissueTexture
from endosdk.simulation.tissue import Tissue, draw_metal

SIDE = 128
# sRGB levels, and by how much the colours may stray
TONES: dict[str, tuple[tuple[float, float, float], tuple[float, float, float]]] = {
    "steel": ((110, 110, 112), (205, 205, 205)),
    "dark": ((12, 12, 12), (55, 55, 58)),
    "white": ((190, 190, 185), (235, 235, 235)),
    "plastic": ((20, 60, 110), (90, 190, 230)),
    "gold": ((150, 110, 50), (215, 180, 110)),
    "violet": ((50, 15, 70), (110, 60, 150)),
    "cloth": ((200, 195, 190), (240, 240, 238)),
}
METALLIC = ("steel", "gold")


def draw_material(
    rng: np.random.Generator, name: str, size_mm: tuple[float, float], shade: float
) -> tuple[Tissue, TissueTexture]:
    """Draw the look and the texture of a material; ``shade`` darkens what would be overexposed near the lamp."""
    low, high = TONES[name]
    mix = rng.uniform(0, 1)
    base = np.asarray(low, np.float32) + np.float32(mix) * (np.asarray(high, np.float32) - np.asarray(low, np.float32))
    picture = np.empty((SIDE, SIDE, 3), np.float32)
    picture[:] = base
    if name == "cloth":
        picture *= _weave(rng)[..., None]
    else:
        streaks = tile_noise(rng, (SIDE, SIDE), (rng.uniform(2, 6), rng.uniform(12, 40)))
        picture *= np.exp(rng.uniform(0.02, 0.18) * streaks)[..., None]
    if rng.random() < 0.4:  # marks and rings, which repeat along the shaft
        rings = (np.arange(SIDE) * int(rng.integers(1, 7)) / SIDE % 1.0) < rng.uniform(0.08, 0.4)
        picture *= np.where(rings, np.float32(rng.uniform(0.4, 1.6)), np.float32(1.0))[:, None, None]
    if rng.random() < 0.3:  # blood
        stain = np.clip(fractal_tile(rng, (SIDE, SIDE), 50.0, 4) - rng.uniform(0.3, 1.5), 0, 1)[..., None]
        picture += stain * (np.array([120, 12, 10], np.float32) - picture)
    albedo = np.full((SIDE, SIDE, 4), int(rng.integers(0, 90)), np.uint8)
    albedo[..., :3] = np.clip(picture * np.sqrt(shade), 0, 255)
    metal = draw_metal(rng, dark=name not in METALLIC)
    gloss = float(rng.uniform(0.0, 0.15) if name == "cloth" else rng.uniform(0.2, 1.2)) * (
        2.0 if metal.metallic else 1.0
    )
    look = replace(metal, kind=name, gloss=gloss, roughness=float(rng.uniform(0.2, 0.6)), metallic=metal.metallic)
    return look, TissueTexture(albedo, FLAT_TILE, size_mm, max(size_mm))


def _weave(rng: np.random.Generator) -> Array:
    count = int(rng.integers(8, 22))
    y, x = np.mgrid[0:SIDE, 0:SIDE].astype(np.float32) * np.float32(count / SIDE)
    over = np.abs(np.sin(np.pi * x)) * (np.floor(y) % 2) + np.abs(np.sin(np.pi * y)) * ((np.floor(y) + 1) % 2)
    holes: NDArray[np.bool_] = (x % 1.0 < 0.25) & (y % 1.0 < 0.25)
    return np.where(holes, np.float32(rng.uniform(0.3, 0.8)), 0.75 + 0.25 * over).astype(np.float32)
