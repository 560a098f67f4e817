"""Looks that real endoscopes give a pair and clean renders do not: each a switch of the training recipe.

Every function draws from the generator it is given and changes pictures [H, W, 3] alone; only `field_of_view`
says where a picture no longer shows the scene.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from endosdk.io.jpeg import as_jpeg

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]

LOOKS = ("tone", "colours", "blur", "noise", "glare", "rows", "field", "scale", "haze", "video", "compression")


def recoloured(left: Image, right: Image, rng: Generator) -> tuple[Image, Image]:
    """Give both views the same other colours: channels swapped, grey, or a mix as of a narrow band of light."""
    kind = rng.random()
    if kind < 0.35:
        mix = np.eye(3)[rng.permutation(3)]
    elif kind < 0.65:
        mix = np.full((3, 3), 1.0 / 3.0)
    else:
        mix = rng.dirichlet(np.full(3, 0.7), size=3)
    matrix = mix.astype(np.float32)
    return cv2.transform(left, matrix).astype(np.uint8), cv2.transform(right, matrix).astype(np.uint8)


def contrast(view: Image, rng: Generator) -> Image:
    """Draw the levels of a view together or apart around its mean."""
    factor = np.exp(rng.normal(0.0, 0.25))
    levels = np.arange(256, dtype=np.float64)
    table = np.clip((levels - view.mean()) * factor + view.mean(), 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(view, table), dtype=np.uint8)


def blurred(view: Image, rng: Generator) -> Image:
    """Blur as a lens out of focus does."""
    return np.asarray(cv2.GaussianBlur(view, (0, 0), float(rng.uniform(0.5, 2.2))), dtype=np.uint8)


def dim_and_noisy(left: Image, right: Image, rng: Generator) -> tuple[Image, Image]:
    """Darken both views, to a fifth at most, and add noise of up to 12 grey levels, in grains of one to two pixels."""
    gain, strength, grain = rng.uniform(0.2, 1.0), rng.uniform(0.0, 12.0), rng.uniform(0.0, 0.8)
    return _noisy(left, gain, strength, grain, rng), _noisy(right, gain, strength, grain, rng)


def _noisy(view: Image, gain: float, strength: float, grain: float, rng: Generator) -> Image:
    noise = rng.standard_normal(view.shape, dtype=np.float32)
    if grain > 0.3:
        noise = np.asarray(cv2.GaussianBlur(noise, (0, 0), grain), dtype=np.float32)
        noise /= max(float(noise.std()), 1e-6)
    return np.clip(view * np.float32(gain) + noise * np.float32(strength), 0.0, 255.0).astype(np.uint8)


def glare(view: Image, rng: Generator) -> Image:
    """Add bright spots, as wet tissue mirrors the light into one eye at a place of its own."""
    height, width = view.shape[:2]
    light = np.zeros((height, width), np.float32)
    for _ in range(int(rng.integers(1, 9))):
        centre = (int(rng.integers(0, width)), int(rng.integers(0, height)))
        size = np.exp(rng.uniform(np.log(1.5), np.log(14.0), size=2))
        axes = (max(1, round(size[0])), max(1, round(size[1] * 0.6)))
        cv2.ellipse(light, centre, axes, float(rng.uniform(0, 180)), 0, 360, float(rng.uniform(120, 400)), -1)
    light = np.asarray(cv2.GaussianBlur(light, (0, 0), float(rng.uniform(0.8, 3.0))), dtype=np.float32)
    return np.asarray(np.clip(view + light[..., None], 0.0, 255.0), dtype=np.uint8)


def hazy(left: Image, right: Image, rng: Generator) -> tuple[Image, Image]:
    """Lay an even veil over both views, as smoke or a fogged lens does: less contrast around a bright grey."""
    clear, level = np.float32(rng.uniform(0.2, 0.8)), np.float32(rng.uniform(90.0, 200.0))
    veiled = [np.clip(level + clear * (view - level), 0.0, 255.0).astype(np.uint8) for view in (left, right)]
    return veiled[0], veiled[1]


def filmed(left: Image, right: Image, rng: Generator) -> tuple[Image, Image]:
    """Send both views through an older video chain: half the lines, a narrow band, less of it for colour, sharpened."""
    line = int(rng.integers(0, 2)) if rng.random() < 0.6 else None  # every second one from there on; None: all
    band, colour = float(np.exp(rng.uniform(0.0, np.log(3.0)))), float(rng.uniform(0.5, 4.0))
    sharpening = float(rng.uniform(0.0, 1.2))
    views = [_filmed(view, line, band, colour, sharpening) for view in (left, right)]
    return views[0], views[1]


def _filmed(view: Image, line: int | None, band: float, colour: float, sharpening: float) -> Image:
    height, width = view.shape[:2]
    luma, *chroma = cv2.split(cv2.cvtColor(np.ascontiguousarray(view), cv2.COLOR_RGB2YCrCb))
    sent = luma if line is None else luma[line::2]
    sent = cv2.resize(sent, (round(width / band), len(sent)), interpolation=cv2.INTER_AREA)
    wider, taller = width / sent.shape[1], 1.0 if line is None else 2.0
    # Columns are means, whose centres stay where they were; lines come back to where they were taken.
    back = np.array([[wider, 0, (wider - 1) / 2], [0, taller, line or 0]], np.float32)
    seen = cv2.warpAffine(sent, back, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    seen = cv2.addWeighted(seen, 1.0 + sharpening, cv2.GaussianBlur(seen, (0, 0), 1.2), -sharpening, 0.0)
    chroma = [cv2.GaussianBlur(channel, (0, 0), sigmaX=colour, sigmaY=colour / 2) for channel in chroma]
    return np.asarray(cv2.cvtColor(cv2.merge([seen, *chroma]), cv2.COLOR_YCrCb2RGB), dtype=np.uint8)


def compressed(left: Image, right: Image, rng: Generator) -> tuple[Image, Image]:
    """Store both views as JPEG of one quality, half of the pairs at twice the size: frames are often reduced later."""
    quality = int(rng.integers(10, 70))
    times = int(rng.integers(1, 3))
    size = (left.shape[1], left.shape[0])
    views = []
    for view in (left, right):
        stored = cv2.resize(view, (times * size[0], times * size[1]), interpolation=cv2.INTER_LINEAR)
        read = as_jpeg(np.asarray(stored, dtype=np.uint8), quality)
        views.append(np.asarray(cv2.resize(read, size, interpolation=cv2.INTER_AREA), dtype=np.uint8))
    return views[0], views[1]


def field_of_view(size: tuple[int, int], rng: Generator) -> tuple[Mask, Mask]:
    """Draw what the optics show of each view [H, W]: a circle, an octagon or a frame, a little apart in the two."""
    height, width = size
    kind = int(rng.integers(0, 3))
    centre = np.array([width / 2, height / 2]) + rng.normal(0.0, 0.08, size=2) * (width, height)
    reach = rng.uniform(0.42, 0.62) * width
    border = rng.uniform(0, 0.12, size=4) * (width, height, width, height)
    masks = []
    for _ in range(2):
        at, radius = centre + rng.normal(0.0, 4.0, size=2), reach + rng.normal(0.0, 2.0)
        shown = np.zeros((height, width), np.uint8)
        if kind == 0:
            cv2.circle(shown, (round(at[0]), round(at[1])), round(radius), 1, -1)
        elif kind == 1:
            angle = np.deg2rad(22.5 + 45.0 * np.arange(8))
            corners = at + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
            cv2.fillPoly(shown, [np.rint(corners).astype(np.int32)], 1)
        else:
            sides = np.maximum(0, np.rint(border + rng.normal(0.0, 4.0, size=4))).astype(int)
            shown[sides[1] : height - sides[3], sides[0] : width - sides[2]] = 1
        masks.append(shown.astype(bool))
    return masks[0], masks[1]


def outside_dark(view: Image, shown: Mask, rng: Generator) -> Image:
    """Make black, with the noise of a sensor, what the optics do not show."""
    dark = rng.uniform(0.0, 12.0) + rng.normal(0.0, 2.0, size=view.shape)
    return np.where(shown[..., None], view, np.clip(dark, 0.0, 255.0)).astype(np.uint8)


def misaligned(view: Image, rng: Generator, *, rows_px: float, degrees: float) -> Image:
    """Shift rows and slant them, each by up to so much either way: what is left after a calibration, or came since.

    Points keep their column, so that the disparity stays as it is.
    """
    height, width = view.shape[:2]
    turn = cv2.getRotationMatrix2D((width / 2.0, height / 2.0), float(rng.uniform(-degrees, degrees)), 1.0)
    turn[0] = 1.0, 0.0, 0.0
    turn[1, 2] += rng.uniform(-rows_px, rows_px)
    warped = cv2.warpAffine(view, turn, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, dtype=np.uint8)
