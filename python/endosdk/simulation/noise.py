"""Smooth random fields: periodic ones in the plane, lattice ones in space."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float32]
LARGEST_FIELD = 512  # samples of a noise field along one side, before it repeats


def tile_noise(rng: np.random.Generator, shape: tuple[int, int], wavelength: float | tuple[float, float]) -> Array:
    """Return periodic noise [H,W] of zero mean and unit deviation whose features are about ``wavelength`` px across.

    A pair gives the wavelength along rows and columns, which makes fibres.
    """
    down, along = wavelength if isinstance(wavelength, tuple) else (wavelength, wavelength)
    # Long waves need few samples and short ones may repeat: shape a small field, then tile and enlarge it.
    repeat = [2 ** max(0, math.ceil(math.log2(side / LARGEST_FIELD))) if side % 64 == 0 else 1 for side in shape]
    period = (shape[0] // repeat[0], shape[1] // repeat[1])
    if min(period) < 6 * max(down, along):
        repeat, period = [1, 1], shape
    height = _small_size(period[0], down)
    width = _small_size(period[1], along)
    rows = np.fft.fftfreq(height)[:, None] * (down * height / period[0])
    columns = np.fft.rfftfreq(width)[None, :] * (along * width / period[1])
    # A soft band around one: pure low-pass noise would be dominated by waves as long as the tile.
    distance = np.hypot(rows, columns)
    window = (distance * np.exp(-1.4 * distance**2)).astype(np.float32)
    spectrum = np.fft.rfft2(rng.standard_normal((height, width), dtype=np.float32)) * window
    field = np.fft.irfft2(spectrum, s=(height, width)).astype(np.float32)
    field = (field - field.mean()) / max(float(field.std()), 1e-9)
    return np.tile(_enlarge(field, period), repeat)


def _enlarge(field: Array, shape: tuple[int, int]) -> Array:
    """Resize a periodic field to ``shape`` without breaking its period."""
    import cv2

    if field.shape == shape:
        return field
    pad = 4
    scale_y, scale_x = shape[0] / field.shape[0], shape[1] / field.shape[1]
    wrapped = np.pad(field, pad, mode="wrap")
    size = (round(wrapped.shape[1] * scale_x), round(wrapped.shape[0] * scale_y))
    large = cv2.resize(wrapped, size, interpolation=cv2.INTER_CUBIC)
    top, left = round(pad * scale_y), round(pad * scale_x)
    return np.asarray(large[top : top + shape[0], left : left + shape[1]], np.float32)


def _small_size(size: int, wavelength: float) -> int:
    small = size
    while small % 2 == 0 and wavelength * (small // 2) / size >= 3.0 and small > 16:
        small //= 2
    return small


def fractal_tile(
    rng: np.random.Generator, shape: tuple[int, int], wavelength: float, octaves: int, gain: float = 0.5
) -> Array:
    """Sum octaves of `tile_noise`, each half as wide and ``gain`` as strong as the one before; unit deviation."""
    total = np.zeros(shape, np.float32)
    strength = 1.0
    for _ in range(octaves):
        if wavelength < 2.0:
            break
        total += strength * tile_noise(rng, shape, wavelength)
        wavelength *= 0.5
        strength *= gain
    return total / max(float(total.std()), 1e-9)


def space_noise(rng: np.random.Generator, points: Array, wavelength: float, octaves: int, gain: float) -> Array:
    """Return smooth noise [N], about -1..1, at points [N,3]: random values on a lattice, smoothly interpolated."""
    total = np.zeros(len(points), np.float32)
    strength, norm = 1.0, 0.0
    for _ in range(octaves):
        total += strength * _lattice(rng, points / np.float32(wavelength * 0.5))
        norm += strength
        strength *= gain
        wavelength *= 0.5
    return total / np.float32(norm)


def _lattice(rng: np.random.Generator, points: Array) -> Array:
    cells = 64
    values = rng.uniform(-1.0, 1.0, cells**3).astype(np.float32)
    shifted = points + rng.uniform(0.0, cells, 3).astype(np.float32)
    base = np.floor(shifted)
    t = np.asarray(shifted - base, np.float32)
    t *= t * t * (t * (t * np.float32(6.0) - np.float32(15.0)) + np.float32(10.0))
    low = base.astype(np.int32) & (cells - 1)
    high = (low + 1) & (cells - 1)
    result = np.zeros(len(points), np.float32)
    for corner in range(8):
        pick = [(high if corner >> axis & 1 else low)[:, axis] for axis in range(3)]
        weight = [t[:, axis] if corner >> axis & 1 else 1.0 - t[:, axis] for axis in range(3)]
        result += values[(pick[0] * cells + pick[1]) * cells + pick[2]] * (weight[0] * weight[1] * weight[2])
    return result
