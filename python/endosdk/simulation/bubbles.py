"""Bubbles in the film on a mucosa: clusters of rings with a thin dark edge, painted where they lie."""

from __future__ import annotations

import numpy as np

from endosdk.simulation.noise import Array

CLUSTER_MM2 = 500.0  # area for one cluster where bubbles are most frequent
MOST_IN_CLUSTER = 40
RADIUS_MM = (0.25, 1.8)
SPREAD_MM = (1.0, 6.0)
WHITE = np.float32(0.9)  # of the lamp's mirror image
RIM, EDGE = 1.5, 0.5  # the rim gathers light, the edge sends some of it away; shares of the tissue's own
REACH = 1.15  # of the radius: how far out the edge goes


def add_bubbles(image: Array, wet: Array, seed: tuple[int, ...], strength: float, scale: float) -> None:
    """Paint bubbles into linear colour [H,W,3] and wetness [H,W], in place; ``scale`` is px per mm."""
    rng = np.random.default_rng(seed)
    height, width = wet.shape
    clusters = rng.poisson(strength * height * width / scale**2 / CLUSTER_MM2)
    for _ in range(int(clusters)):
        middle = rng.uniform(0.0, 1.0, 2) * (height, width)
        spread = rng.uniform(*SPREAD_MM, 2) * scale
        for _ in range(int(rng.integers(4, MOST_IN_CLUSTER))):
            # Small ones are many: foam has few large bubbles.
            radius = scale * RADIUS_MM[0] * (RADIUS_MM[1] / RADIUS_MM[0]) ** (rng.uniform() ** 2.5)
            place = middle + rng.normal(size=2) * spread
            if radius > 1.5:
                _paint(image, wet, place, float(radius), float(rng.uniform(0.3, 0.8)))


def _paint(image: Array, wet: Array, place: np.ndarray, radius: float, brightness: float) -> None:
    """Paint one bubble; what leaves the texture on one side comes in on the other."""
    half = int(np.ceil(REACH * radius)) + 1
    steps = np.arange(-half, half + 1)
    top, left = np.floor(place).astype(int)
    window = np.ix_((top + steps) % wet.shape[0], (left + steps) % wet.shape[1])
    down, across = (steps + top - place[0])[:, None] / radius, (steps + left - place[1])[None, :] / radius
    far = np.hypot(down, across)
    rim = np.exp(-(((far - 0.84) / 0.1) ** 2))
    edge = np.exp(-(((far - 1.0) / 0.07) ** 2))
    spark = np.exp(-(((np.hypot(down + 0.35, across + 0.25)) / 0.14) ** 2)) * brightness
    gain = (1.0 + brightness * (RIM * rim + 0.2 * (far < 0.9)) - EDGE * edge)[..., None].astype(np.float32)
    patch = np.minimum(image[window] * gain, WHITE)
    image[window] = patch + (WHITE - patch) * spark[..., None].astype(np.float32)
    wet[window] = np.maximum(wet[window], (far < 1.0).astype(np.float32))
