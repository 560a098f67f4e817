"""Random views of a rendered pair: other crop, other scale, other light, another camera on each side.

Every function draws from the generator it is given, so a crop is a function of its seed.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from endosdk.training import looks

Image = NDArray[np.uint8]
Map = NDArray[np.float32]

SCALES = (0.7, 1.4)  # of the picture
WIDE_SCALES = (0.6, 1.8)  # with the look "scale": disparities from almost 0 to the end of a wide range
# Share of the pairs that get a look which is switched on.
CHANCES = {
    "tone": 0.5,
    "colours": 0.3,
    "blur": 0.25,
    "noise": 0.2,
    "glare": 0.25,
    "rows": 0.25,
    "field": 0.15,
    "haze": 0.15,
    "video": 0.2,
    "compression": 0.25,
}


@dataclass(frozen=True)
class Pair:
    """Two views [H, W, 3] RGB and the disparity of the left one [H, W] in px, NaN where there is no truth."""

    left: Image
    right: Image
    disparity: Map


def random_pair(
    pair: Pair, mirrored: Pair | None, crop: tuple[int, int], rng: Generator, switches: Collection[str] = ()
) -> Pair:
    """Draw one training pair of size ``crop`` (height, width).

    ``mirrored`` is the pair as seen in a mirror (flipped views swapped, truth of the right view); None where the data
    has no truth for the right view. ``switches`` are names of `endosdk.training.looks.LOOKS`.
    """
    return spoilt_pair(placed_pair(pair, mirrored, crop, rng, switches), rng, switches)


def placed_pair(
    pair: Pair, mirrored: Pair | None, crop: tuple[int, int], rng: Generator, switches: Collection[str] = ()
) -> Pair:
    """Draw where the cameras of a training pair are: the first part of `random_pair`."""
    if mirrored is not None and rng.random() < 0.5:
        pair = mirrored
    pair = _crop(pair, crop, rng, WIDE_SCALES if "scale" in switches else SCALES)
    if rng.random() < 0.5:
        pair = Pair(pair.left[::-1], pair.right[::-1], pair.disparity[::-1])
    return pair


def spoilt_pair(pair: Pair, rng: Generator, switches: Collection[str] = ()) -> Pair:
    """Draw light, cameras and faults of a training pair: the second part of `random_pair`."""
    left, right = _colours(pair.left, pair.right, rng, 0.2 if "tone" in switches else 0.06)
    if rng.random() < 0.5:
        right = looks.misaligned(right, rng, rows_px=1.0, degrees=0.1)  # after a good calibration
    drawn = {name: rng.random() for name in looks.LOOKS}  # the same for every choice of switches
    on = {name for name in switches if drawn[name] < CHANCES.get(name, 1.0)}
    left, right, disparity = _looks(left, right, pair.disparity, rng, on)
    left, right = (_sensor(view, rng) for view in (left, right))
    if "video" in on:
        left, right = looks.filmed(left, right, rng)
    if "compression" in on:
        left, right = looks.compressed(left, right, rng)
    if rng.random() < 0.3:
        right = _occluded(right, rng)
    return Pair(left, right, disparity)


def _looks(left: Image, right: Image, disparity: Map, rng: Generator, on: Collection[str]) -> tuple[Image, Image, Map]:
    """Give the pair the looks that come before the sensor."""
    if "tone" in on:
        left, right = looks.contrast(left, rng), looks.contrast(right, rng)
    if "colours" in on:
        left, right = looks.recoloured(left, right, rng)
    if "haze" in on:
        left, right = looks.hazy(left, right, rng)
    if "glare" in on:
        left, right = looks.glare(left, rng), looks.glare(right, rng)
    if "rows" in on:
        right = looks.misaligned(right, rng, rows_px=2.0, degrees=0.25)  # the rig moved since
    if "blur" in on:
        eye = rng.integers(0, 3)
        left = looks.blurred(left, rng) if eye != 1 else left
        right = looks.blurred(right, rng) if eye != 0 else right
    if "field" in on:
        shown = looks.field_of_view(left.shape[:2], rng)
        left, right = (looks.outside_dark(view, mask, rng) for view, mask in zip((left, right), shown, strict=True))
        disparity = np.where(shown[0], disparity, np.float32(np.nan))
    if "noise" in on:
        left, right = looks.dim_and_noisy(left, right, rng)
    return left, right, disparity


def plain_pair(pair: Pair, crop: tuple[int, int], rng: Generator) -> Pair:
    """Draw a crop and change nothing else."""
    top, left = _corner(pair.left.shape[:2], crop, rng)
    return _window(pair, top, left, *crop)


def mirror(left: Image, right: Image, disparity_right: Map) -> Pair:
    """Make the pair a mirror shows: what was the right eye becomes the left one."""
    return Pair(right[:, ::-1], left[:, ::-1], disparity_right[:, ::-1])


def _corner(size: tuple[int, ...], crop: tuple[int, int], rng: Generator) -> tuple[int, int]:
    return int(rng.integers(0, size[0] - crop[0] + 1)), int(rng.integers(0, size[1] - crop[1] + 1))


def _window(pair: Pair, top: int, left: int, height: int, width: int) -> Pair:
    rows, columns = slice(top, top + height), slice(left, left + width)
    return Pair(pair.left[rows, columns], pair.right[rows, columns], pair.disparity[rows, columns])


def _crop(pair: Pair, crop: tuple[int, int], rng: Generator, scales: tuple[float, float]) -> Pair:
    """Cut a window of random size and bring it to the crop's: a random scale and stretch of the picture."""
    height, width = pair.left.shape[:2]
    scale = np.exp(rng.uniform(np.log(scales[0]), np.log(scales[1])))
    stretch = np.exp(rng.uniform(-0.15, 0.15))
    # A picture is no larger than it is. Both sides stop there together: the stretch alone says how they differ.
    scale = max(scale, crop[1] / width, crop[0] / (height * stretch))
    source = (min(height, round(crop[0] / (scale * stretch))), min(width, round(crop[1] / scale)))
    top, left = _corner((height, width), source, rng)
    window = _window(pair, top, left, *source)
    size = (crop[1], crop[0])
    views = [
        cv2.resize(np.ascontiguousarray(view), size, interpolation=cv2.INTER_AREA if scale < 1.0 else cv2.INTER_LINEAR)
        for view in (window.left, window.right)
    ]
    # Nearest, by pixel centres: a mean over an edge would be a surface that is not there.
    disparity = cv2.resize(np.ascontiguousarray(window.disparity), size, interpolation=cv2.INTER_NEAREST_EXACT)
    disparity = disparity * np.float32(crop[1] / source[1])
    return Pair(views[0].astype(np.uint8), views[1].astype(np.uint8), disparity.astype(np.float32))


def _colours(left: Image, right: Image, rng: Generator, apart: float) -> tuple[Image, Image]:
    """Gamma, gain and offset per channel: a part common to both views, and one ``apart`` strong of each alone."""
    common = _curve(rng, 0.25)
    left_curve, right_curve = (common + _curve(rng, apart) for _ in range(2))
    return _toned(left, left_curve), _toned(right, right_curve)


def _curve(rng: Generator, strength: float) -> NDArray[np.float64]:
    """Draw a tone curve: logarithm of gamma, logarithm of the gain, offset in grey levels, for each channel: [3, 3]."""
    gamma = np.full(3, rng.normal(0.0, strength))
    gain = rng.normal(0.0, strength / 2) + rng.normal(0.0, strength / 4, size=3)
    offset = np.full(3, rng.normal(0.0, strength * 40.0))
    return np.stack([gamma, gain, offset])


def _toned(view: Image, curve: NDArray[np.float64]) -> Image:
    gamma, gain, offset = curve
    levels = np.linspace(0.0, 1.0, 256)[:, None] ** np.exp(gamma)
    table = np.clip(levels * np.exp(gain) * 255.0 + offset, 0.0, 255.0).astype(np.uint8)
    return np.asarray(cv2.LUT(np.ascontiguousarray(view), table[None]), dtype=np.uint8)


def _sensor(view: Image, rng: Generator) -> Image:
    """Blur and noise of one camera."""
    if rng.random() < 0.3:
        view = np.asarray(cv2.GaussianBlur(view, (0, 0), float(rng.uniform(0.3, 1.3))), dtype=np.uint8)
    if rng.random() < 0.7:
        noise = rng.standard_normal(view.shape, dtype=np.float32) * np.float32(rng.uniform(0.0, 5.0))
        view = np.clip(view + noise, 0.0, 255.0).astype(np.uint8)
    return view


def _occluded(view: Image, rng: Generator) -> Image:
    """Cover one patch with the mean colour: something that only one camera sees."""
    height, width = view.shape[:2]
    tall, wide = int(rng.integers(height // 10, height // 3)), int(rng.integers(width // 20, width // 6))
    top, left = int(rng.integers(0, height - tall)), int(rng.integers(0, width - wide))
    covered = view.copy()
    covered[top : top + tall, left : left + wide] = view.mean(axis=(0, 1)).astype(np.uint8)
    return covered
