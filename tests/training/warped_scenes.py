"""Pairs with exact truth and no renderer: textured layers seen through smooth random disparity.

The tests learn from them. ``python -m tests.training.warped_scenes FOLDER --pairs 200`` writes a data set of them: a
warm start where rendered data is scarce, for matching is learned before tissue is.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np


def warped_pair(seed, size=(128, 256), disparity=(4.0, 40.0), layers=1):
    """Return left, right (uint8 [H, W, 3]) and the disparity [H, W] of the left view, px.

    Each layer of the left view is that of the right one read at x - d(x), so the truth is exact; nearer layers cover
    farther ones in both views, which gives true edges and occlusions.
    """
    rng = np.random.default_rng(seed)
    height, width = size
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    bounds = np.sort(rng.uniform(*disparity, size=layers + 1))
    left = right = truth = None
    for layer in range(layers):
        low, high = bounds[layer], bounds[layer + 1]
        surface = np.float32(low) + _smooth(rng, size, int(rng.integers(2, 7))) * np.float32(high - low)
        picture = _texture(rng, height, width)
        cover = np.ones(size, np.float32)
        if layer:
            cover = (_smooth(rng, size, int(rng.integers(2, 6))) > 0.6).astype(np.float32)
        warped = cv2.remap(picture, x - surface, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
        seen = cv2.remap(cover, x - surface, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REFLECT) > 0.5
        if left is None:
            left, right, truth = warped, picture, surface
        left = np.where(seen[..., None], warped, left)
        right = np.where(cover[..., None] > 0.5, picture, right)
        truth = np.where(seen, surface, truth)
    return left, right, truth.astype(np.float32)


def constant_pair(seed, size, shift):
    """Return a pair that is a pure shift of ``shift`` whole pixels, with its truth."""
    height, width = size
    wide = _texture(np.random.default_rng(seed), height, width + shift)
    # The left view sees further to the left: x_right = x_left - shift.
    left, right = wide[:, :width].copy(), wide[:, shift:].copy()
    return left, right, np.full(size, shift, np.float32)


def _smooth(rng, size, cells):
    """Random map of this size from 0 to 1 with about ``cells`` bumps a side."""
    coarse = rng.uniform(size=(cells, cells + 1)).astype(np.float32)
    smooth = cv2.resize(coarse, (size[1], size[0]), interpolation=cv2.INTER_CUBIC)
    return (smooth - smooth.min()) / (smooth.max() - smooth.min())


def _texture(rng, height, width):
    """Sum of noise at several scales, tinted like tissue, lit unevenly."""
    grey = np.zeros((height, width), np.float32)
    for cell in (2, 4, 8, 16, 32):
        noise = rng.standard_normal((height // cell + 2, width // cell + 2)).astype(np.float32)
        grey += np.float32(rng.uniform(0.2, 1.4)) * cv2.resize(noise, (width, height), interpolation=cv2.INTER_CUBIC)
    light = 0.5 + _smooth(rng, (height, width), 3)
    grey = np.clip(light * (115.0 + rng.uniform(8.0, 30.0) * grey), 0.0, 255.0)
    tint = np.array([1.0, rng.uniform(0.5, 0.9), rng.uniform(0.4, 0.9)], np.float32)
    return (grey[..., None] * tint).astype(np.uint8)


def write_set(root, pairs, size, disparity):
    """Write a data set of such pairs, one in ten for testing."""
    from endosdk.datasets.dataset import SPLITS, Sample
    from endosdk.datasets.writer import write_dataset_record, write_sample

    hashes = {split: {} for split in SPLITS}
    for seed in range(pairs):
        split = "test" if seed % 10 == 9 else "train"
        left, right, truth = warped_pair(seed, size, disparity, layers=1 + seed % 4)
        sample = Sample(f"{seed:05d}", left, right, truth, None, None, focal_px=400.0, baseline_mm=10.0)
        hashes[split][sample.id] = write_sample(root, split, sample)
    write_dataset_record(root, {"format_version": 1, "name": "warped-textures", "samples": hashes})


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pairs", type=int, default=200)
    options = parser.parse_args()
    write_set(options.folder, options.pairs, (480, 720), (3.0, 66.0))
