"""What the two chips and their processors do to a picture: unlike tones, blur, noise, sharpening, chroma, JPEG."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.io.jpeg import as_jpeg
from endosdk.simulation.effects import subsample_chroma
from endosdk.simulation.noise import Array

Picture = NDArray[np.uint8]
SEEN_AT_PX = 480  # width of picture for which lengths in px are given


@dataclass(frozen=True)
class Chip:
    """What one eye does; lengths in px of a frame 480 wide."""

    gain: float
    balance: tuple[float, float, float]
    gamma: float
    contrast: float
    blur_px: float
    blur_stretch: float  # how much more it blurs down than across
    noise: float  # grey levels in the dark
    shot_noise: float  # grey levels at full brightness
    grain_px: float


@dataclass(frozen=True)
class Processor:
    """What the camera's own processing does to both eyes."""

    level: float | None  # mean grey level of a dim frame; None: as it was
    smear_px: float  # of a filter against noise
    sharpen: float
    chroma: bool  # one colour for four pixels
    jpeg_quality: int  # 0: not compressed
    interlaced: bool


def draw_chips(rng: np.random.Generator) -> tuple[Chip, Chip]:
    """Draw what the two eyes do: part of it alike, part of each alone; either may be the blurred one."""
    strength = float(rng.choice([0.3, 1.0, 2.0]))
    tone = [_tone(rng, 0.04 * strength) for _ in range(2)]
    common = _tone(rng, 0.12)
    blur = [0.5 * abs(rng.normal())] * 2 if rng.random() < 0.4 else [0.0, 0.0]
    if rng.random() < 0.35:
        blur[int(rng.integers(2))] += rng.uniform(0.3, 2.0)
    dark = float(rng.choice([0.0, rng.uniform(0.0, 3.0), rng.uniform(2.0, 12.0)], p=[0.25, 0.5, 0.25]))
    bright, grain, stretch = rng.uniform(0.0, 3.5), rng.uniform(0.0, 1.2), rng.uniform(0.7, 1.4)
    chips = []
    for own, soft in zip(tone, blur, strict=True):
        gain, gamma, contrast, *balance = (float(np.exp(a + b)) for a, b in zip(common, own, strict=True))
        share = float(np.exp(rng.normal(0, 0.15)))
        chips.append(
            Chip(
                gain, (balance[0], balance[1], balance[2]), gamma, contrast, float(soft), float(stretch),
                dark * share, float(bright) * share, float(grain),
            )
        )  # fmt: skip
    return chips[0], chips[1]


def _tone(rng: np.random.Generator, strength: float) -> NDArray[np.float64]:
    """Draw logarithms of gain, gamma, contrast and of the gains of red, green and blue."""
    return np.asarray(rng.normal(0, strength, 6) * np.array([1.5, 1.0, 0.7, 0.7, 0.4, 0.7]))


def draw_processor(rng: np.random.Generator) -> Processor:
    """Draw the processing of both eyes."""
    return Processor(
        level=float(rng.uniform(30, 60)) if rng.random() < 0.2 else None,
        smear_px=float(rng.uniform(0.5, 1.5)) if rng.random() < 0.15 else 0.0,
        sharpen=float(rng.uniform(0.3, 1.8)) if rng.random() < 0.35 else 0.0,
        chroma=bool(rng.random() < 0.4),
        jpeg_quality=int(rng.integers(35, 96)) if rng.random() < 0.4 else 0,
        interlaced=bool(rng.random() < 0.05),
    )


def dimming(left: Array, level: float | None) -> float:
    """Return the factor that brings the mean grey level of the left view down to ``level``; it never brightens."""
    return 1.0 if level is None else min(1.0, level / max(float(left.mean()), 1.0))


def take(picture: Array, chip: Chip, factor: float) -> Array:
    """Return what a chip sees: blurred, and with tones of its own. Pictures are float [H,W,3], 0..255."""
    import cv2

    blur = chip.blur_px * picture.shape[1] / SEEN_AT_PX
    if blur > 0.15:
        picture = np.asarray(cv2.GaussianBlur(picture, (0, 0), blur, sigmaY=blur * chip.blur_stretch), np.float32)
    scaled = np.clip(picture / 255.0, 0.0, 1.0) ** np.float32(chip.gamma)
    scaled = 0.5 + (scaled - 0.5) * np.float32(chip.contrast)
    return np.asarray(255.0 * factor * chip.gain * scaled * np.asarray(chip.balance, np.float32), np.float32)


def add_noise(picture: Array, chip: Chip, rng: np.random.Generator) -> Array:
    """Add the noise of a chip, which grows with the light."""
    import cv2

    grain = rng.standard_normal(picture.shape, dtype=np.float32)
    size = chip.grain_px * picture.shape[1] / SEEN_AT_PX
    if size > 0.3:
        grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), size), np.float32)
        grain /= max(float(grain[::3, ::3].std()), 1e-6)
    strength = np.hypot(chip.noise, chip.shot_noise * np.sqrt(np.clip(picture, 0, 255) / 255.0))
    return np.asarray(picture + grain * strength, np.float32)


def process(picture: Array, processor: Processor) -> Picture:
    """Return the 8-bit picture that the camera gives out."""
    import cv2

    scale = picture.shape[1] / SEEN_AT_PX
    if processor.interlaced:  # the odd lines are those of the other half-frame: here, made from their neighbours
        picture = picture.copy()
        odd = picture[1:-1:2]
        odd[:] = 0.5 * (picture[0:-2:2][: len(odd)] + picture[2::2][: len(odd)])
    if processor.smear_px > 0:
        coded = np.clip(picture + 0.5, 0, 255).astype(np.uint8)
        picture = cv2.bilateralFilter(coded, 0, 18.0, processor.smear_px * scale).astype(np.float32)
    if processor.sharpen > 0:
        picture = picture + np.float32(processor.sharpen) * (picture - cv2.GaussianBlur(picture, (0, 0), 1.2 * scale))
    coded = np.clip(picture + 0.5, 0, 255).astype(np.uint8)
    if processor.chroma:
        coded = subsample_chroma(coded)
    if processor.jpeg_quality:
        coded = as_jpeg(coded, processor.jpeg_quality)
    return np.ascontiguousarray(coded)
