"""Turn light into 8-bit pictures: exposure, differences between the two chips, noise and compression."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.io.jpeg import as_jpeg
from endosdk.simulation.noise import Array


@dataclass(frozen=True)
class Sensor:
    """What the two chips do to the light; differences are between the left and the right view."""

    level: float  # brightness, 0..1, to which the middle tone is exposed
    gamma: float
    saturation: float
    gain_difference: float
    tint_difference: tuple[float, float, float]
    vignette: float
    glare: float  # share of light scattered over the picture
    blur_px: float
    blur_difference_px: float
    sharpen: float
    noise: float  # grey levels in the dark
    shot_noise: float  # grey levels at full brightness
    noise_grain_px: float
    jpeg_quality: int  # 0: not compressed


def draw_sensor(rng: np.random.Generator) -> Sensor:
    """Draw one pair of chips."""
    tint = rng.normal(0, 0.015, 3)
    return Sensor(
        level=float(rng.uniform(0.48, 0.72)),
        gamma=float(rng.uniform(1.9, 2.5)),
        saturation=float(rng.uniform(0.85, 1.35)),
        gain_difference=float(rng.normal(0, 0.05)),
        tint_difference=(float(tint[0]), float(tint[1]), float(tint[2])),
        vignette=float(rng.uniform(0.0, 0.45)),
        glare=float(rng.uniform(0.0, 0.06)),
        blur_px=float(rng.uniform(0.0, 0.9)),
        blur_difference_px=float(rng.uniform(0.0, 0.3)),
        sharpen=float(rng.uniform(0.0, 0.8)) if rng.random() < 0.5 else 0.0,
        noise=float(rng.uniform(0.3, 2.0)),
        shot_noise=float(rng.uniform(0.5, 3.5)),
        noise_grain_px=float(rng.uniform(0.0, 0.8)),
        jpeg_quality=int(rng.integers(70, 97)) if rng.random() < 0.5 else 0,
    )


Picture = NDArray[np.uint8]


def expose(left: Array, right: Array, sensor: Sensor, seed: tuple[int, ...]) -> tuple[Picture, Picture]:
    """Turn linear light [H,W,3] of both views into RGB uint8; exposure is measured on the left, as one camera would."""
    rng = np.random.default_rng(seed)
    middle = float(np.quantile(left.max(2)[::4, ::4], 0.65))
    gain = sensor.level**sensor.gamma / max(middle, 1e-6)
    half = np.asarray(sensor.tint_difference, np.float32) + np.float32(sensor.gain_difference)
    return (
        _develop(rng, left * (gain * (1.0 - 0.5 * half)), sensor, sensor.blur_px),
        _develop(rng, right * (gain * (1.0 + 0.5 * half)), sensor, sensor.blur_px + sensor.blur_difference_px),
    )


def _develop(rng: np.random.Generator, light: Array, sensor: Sensor, blur_px: float) -> Picture:
    import cv2

    height, width = light.shape[:2]
    light = np.minimum(light, 3.0).astype(np.float32)
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j].astype(np.float32)
    light *= (1.0 - sensor.vignette * np.clip((x**2 + y**2) * 0.5, 0, 1) ** 1.3)[..., None]
    small = cv2.resize(light, (width // 8, height // 8), interpolation=cv2.INTER_AREA)
    veil = cv2.resize(cv2.GaussianBlur(small, (0, 0), width / 80), (width, height), interpolation=cv2.INTER_LINEAR)
    light += np.float32(sensor.glare) * veil
    if blur_px > 0.2:
        light = np.asarray(cv2.GaussianBlur(light, (0, 0), blur_px), np.float32)
    # A soft shoulder keeps colour below white and lets highlights clip.
    curve = np.where(light < 0.7, light, 0.7 + 0.5 * np.tanh((light - 0.7) / 0.5 * 0.9))
    grey = curve.mean(2, keepdims=True)
    tone = np.clip(grey + (curve - grey) * np.float32(sensor.saturation), 0.0, 1.2) ** np.float32(1 / sensor.gamma)
    picture = (tone * 255.0).astype(np.float32)
    if sensor.sharpen > 0:
        picture += np.float32(sensor.sharpen) * (picture - cv2.GaussianBlur(picture, (0, 0), 1.5))
    grain = rng.standard_normal(picture.shape, dtype=np.float32)
    if sensor.noise_grain_px > 0.3:
        grain = np.asarray(cv2.GaussianBlur(grain, (0, 0), sensor.noise_grain_px), np.float32)
        grain /= float(grain[::4, ::4].std())
    picture += grain * (sensor.noise + sensor.shot_noise * np.sqrt(np.clip(picture, 0, 255) / 255.0))
    coded = np.clip(picture + 0.5, 0, 255).astype(np.uint8)
    if sensor.jpeg_quality:
        coded = as_jpeg(coded, sensor.jpeg_quality)
    return np.ascontiguousarray(coded)
