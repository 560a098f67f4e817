"""What lies between tissue and chip: smoke, droplets on one lens, and glare that is elsewhere for the other eye."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.simulation.noise import Array, fractal_tile

THICKEST = 3.0  # depth that smoke reaches, in typical depths of the scene
DROPLETS = (1, 5)
GLINTS = (1, 14)


@dataclass(frozen=True)
class Smoke:
    """A haze that grows with depth and drifts in clouds."""

    density: float  # optical thickness at the typical depth
    clouds: float  # 0: even, 1: in clouds
    nearness: float  # disparity of the clouds, as a share of the scene's typical one
    level: float  # its grey level
    tint: tuple[float, float, float]


@dataclass(frozen=True)
class Droplet:
    """A drop on the glass in front of one eye; place and size as shares of the width."""

    eye: int  # 0: left, 1: right
    x: float
    y: float
    radius: float
    blur: float
    opacity: float
    brightness: float


@dataclass(frozen=True)
class Glint:
    """A patch of glare: an ellipse of light that each eye sees at a place of its own; shares of the width."""

    x: float
    y: float
    offset: tuple[float, float]  # in the right view, against where the surface is
    size: float
    stretch: float
    angle: float
    strength: tuple[float, float]  # grey levels in each eye


def draw_smoke(rng: np.random.Generator) -> Smoke:
    """Draw some smoke."""
    tint = rng.uniform(0.9, 1.1, 3)
    return Smoke(
        density=float(rng.uniform(0.1, 1.1)),
        clouds=float(rng.uniform(0.0, 1.0)),
        nearness=float(rng.uniform(0.7, 2.0)),
        level=float(rng.uniform(90, 220)),
        tint=(float(tint[0]), float(tint[1]), float(tint[2])),
    )


def draw_droplets(rng: np.random.Generator) -> tuple[Droplet, ...]:
    """Draw drops on one of the two lenses."""
    eye = int(rng.integers(2))
    return tuple(
        Droplet(
            eye, float(rng.uniform(0, 1)), float(rng.uniform(0, 0.75)), float(rng.uniform(0.02, 0.13)),
            float(rng.uniform(0.006, 0.035)), float(rng.uniform(0.4, 1.0)), float(rng.uniform(0.75, 1.35)),
        )
        for _ in range(int(rng.integers(DROPLETS[0], DROPLETS[1] + 1)))
    )  # fmt: skip


def draw_glints(rng: np.random.Generator) -> tuple[Glint, ...]:
    """Draw patches of glare; some are seen by one eye alone."""
    glints = []
    for _ in range(int(rng.integers(GLINTS[0], GLINTS[1] + 1))):
        wide = rng.random() < 0.2
        level = float(rng.uniform(10, 60) if wide else rng.uniform(60, 400))
        seen = [level, level * float(np.exp(rng.normal(0, 0.5)))]
        if rng.random() < 0.25:
            seen[int(rng.integers(2))] = 0.0
        offset = rng.normal(0, 0.015, 2) * np.array([1.0, 0.3])
        glints.append(
            Glint(
                float(rng.uniform(0, 1)), float(rng.uniform(0, 0.75)), (float(offset[0]), float(offset[1])),
                float(rng.uniform(0.08, 0.3) if wide else np.exp(rng.uniform(np.log(0.002), np.log(0.03)))),
                float(np.exp(rng.normal(0, 0.6))), float(rng.uniform(0, np.pi)), (seen[0], seen[1]),
            )
        )  # fmt: skip
    return tuple(glints)


def add_smoke(view: Array, disparity: Array, eye: int, smoke: Smoke, seed: tuple[int, ...]) -> Array:
    """Fade a view [H,W,3] into smoke; ``disparity`` [H,W] in px, NaN where unknown, says how deep each pixel lies."""
    import cv2

    height, width = disparity.shape
    typical = float(np.nanmedian(disparity))
    depth = np.clip(typical / np.maximum(np.nan_to_num(disparity, nan=typical), 1e-3), 0.0, THICKEST)
    clouds = fractal_tile(np.random.default_rng(seed), (256, 256), 110.0, 4, 0.5)
    rows, columns = np.indices((height, width), np.float32)
    columns = columns + np.float32(smoke.nearness * typical * eye)  # the clouds are solid things, seen twice
    place = np.float32(256.0 / (1.5 * width))
    field = cv2.remap(clouds, columns * place, rows * place, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    thick = smoke.density * depth * (1.0 + smoke.clouds * (np.clip(1.0 + field, 0.0, 3.0) - 1.0))
    through = np.exp(-thick)[..., None].astype(np.float32)
    return np.asarray(view * through + (1.0 - through) * (smoke.level * np.asarray(smoke.tint, np.float32)), np.float32)


def add_droplets(view: Array, eye: int, droplets: tuple[Droplet, ...]) -> Array:
    """Blur what this eye sees through its drops. The truth stays that of the surface behind."""
    import cv2

    height, width = view.shape[:2]
    rows, columns = np.indices((height, width), np.float32)
    for drop in droplets:
        if drop.eye != eye:
            continue
        away = np.hypot(columns - drop.x * width, rows - drop.y * width) / (drop.radius * width)
        weight = drop.opacity * np.clip((1.15 - away) / 0.3, 0.0, 1.0)[..., None]
        blurred = np.asarray(cv2.GaussianBlur(view, (0, 0), drop.blur * width), np.float32) * drop.brightness
        view = np.asarray(view + weight * (blurred - view), np.float32)
    return view


def add_glints(view: Array, disparity: Array, eye: int, glints: tuple[Glint, ...]) -> Array:
    """Add glare; ``disparity`` is that of the left view, and says where a surface is in the right one."""
    height, width = view.shape[:2]
    rows, columns = np.indices((height, width), np.float32)
    view = view.copy()
    for glint in glints:
        x, y = glint.x * width, glint.y * width
        if eye == 1:
            shift = float(disparity[min(int(y), height - 1), min(int(x), width - 1)])
            x, y = x - (shift if np.isfinite(shift) else 0.0) + glint.offset[0] * width, y + glint.offset[1] * width
        across = (columns - x) * np.cos(glint.angle) + (rows - y) * np.sin(glint.angle)
        down = (rows - y) * np.cos(glint.angle) - (columns - x) * np.sin(glint.angle)
        far = (across**2 / glint.stretch + down**2 * glint.stretch) / (glint.size * width) ** 2
        view += (glint.strength[eye] * np.exp(-np.minimum(far, 30.0)))[..., None]
    return view
