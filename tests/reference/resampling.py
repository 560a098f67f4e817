"""Slow NumPy twins of rectifying, packing and resizing, written to be read."""

from __future__ import annotations

import numpy as np


def source_map(
    model: str, matrix: np.ndarray, distortion: np.ndarray, rotation: np.ndarray, projection: np.ndarray, size: tuple
) -> tuple[np.ndarray, np.ndarray]:
    """Raw x and y (float64 [height, width]) of every rectified pixel; ``size`` is (width, height)."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1).astype(np.float64)
    rays = pixels @ np.linalg.inv(projection[:, :3] @ rotation).T
    u, v = rays[..., 0] / rays[..., 2], rays[..., 1] / rays[..., 2]
    k = np.zeros(8)
    k[: len(distortion)] = distortion
    if model == "pinhole":
        r2 = u * u + v * v
        radial = (1 + k[0] * r2 + k[1] * r2**2 + k[4] * r2**3) / (1 + k[5] * r2 + k[6] * r2**2 + k[7] * r2**3)
        distorted_u = u * radial + 2 * k[2] * u * v + k[3] * (r2 + 2 * u * u)
        distorted_v = v * radial + k[2] * (r2 + 2 * v * v) + 2 * k[3] * u * v
    else:
        r = np.hypot(u, v)
        theta = np.arctan(r)
        angle = theta * (1 + k[0] * theta**2 + k[1] * theta**4 + k[2] * theta**6 + k[3] * theta**8)
        ratio = np.divide(angle, r, out=np.ones_like(r), where=r > 0)
        distorted_u, distorted_v = u * ratio, v * ratio
    return matrix[0, 0] * distorted_u + matrix[0, 2], matrix[1, 1] * distorted_v + matrix[1, 2]


def valid_mask(map_x: np.ndarray, map_y: np.ndarray, width: int, height: int) -> np.ndarray:
    """1 where a source position lies inside a raw image of this size."""
    return ((map_x >= 0) & (map_y >= 0) & (map_x <= width - 1) & (map_y <= height - 1)).astype(np.uint8)


def reduce(image: np.ndarray, factor: int) -> np.ndarray:
    """Means over blocks of factor x factor pixels of uint8 [H, W, C], or what there is of them, rounded half up."""
    height, width = (-(-side // factor) for side in image.shape[:2])
    out = np.empty((height, width, image.shape[2]), int)
    for y in range(height):
        for x in range(width):
            block = image[y * factor : (y + 1) * factor, x * factor : (x + 1) * factor].astype(int)
            count = block.shape[0] * block.shape[1]
            out[y, x] = (block.sum(axis=(0, 1)) + count // 2) // count
    return out


def remap(
    image: np.ndarray, map_x: np.ndarray, map_y: np.ndarray, whole: tuple[float, float] | None = None
) -> np.ndarray:
    """Bilinear samples of uint8 [H, W, C] at float positions, black outside, as float64 [height, width, C].

    Positions fade into black over one pixel beyond the outermost ones; with ``whole``, (width, height) of the area that
    holds pixels, they read those pixels up to half a pixel beyond, and black from there on.
    """
    height, width = image.shape[:2]
    if whole is not None:
        inside = (map_x > -0.5) & (map_y > -0.5) & (map_x < whole[0] - 0.5) & (map_y < whole[1] - 0.5)
        samples = remap(image, np.clip(map_x, 0, width - 1), np.clip(map_y, 0, height - 1))
        return np.where(inside[..., None], samples, 0)
    framed = np.zeros((height + 2, width + 2, image.shape[2]))
    framed[1:-1, 1:-1] = image
    x = np.clip(map_x, -1, width) + 1
    y = np.clip(map_y, -1, height) + 1
    x0 = np.minimum(np.floor(x).astype(int), width)
    y0 = np.minimum(np.floor(y).astype(int), height)
    fx, fy = (x - x0)[..., None], (y - y0)[..., None]
    upper = framed[y0, x0] * (1 - fx) + framed[y0, x0 + 1] * fx
    lower = framed[y0 + 1, x0] * (1 - fx) + framed[y0 + 1, x0 + 1] * fx
    return upper * (1 - fy) + lower * fy


def planar(image: np.ndarray, order: str, height: int, width: int) -> np.ndarray:
    """uint8 [H, W, C] as planar RGB [3, height, width], last column and row repeated over the pad."""
    if order == "gray":
        image = np.repeat(image.reshape(*image.shape[:2], 1), 3, axis=2)
    if order == "bgr":
        image = image[..., ::-1]
    pad = ((0, 0), (0, height - image.shape[0]), (0, width - image.shape[1]))
    return np.pad(image.transpose(2, 0, 1), pad, mode="edge")


def _positions(size: int, scale: float, source: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    position = np.clip((np.arange(size) + 0.5) * scale - 0.5, 0, source - 1)
    first = np.floor(position).astype(int)
    return first, np.minimum(first + 1, source - 1), position - first


def resize_bilinear(
    source: np.ndarray, height: int, width: int, scale_y: float, scale_x: float, gain: float
) -> np.ndarray:
    """Half-pixel bilinear resize with clamped edges, times gain, float64 [height, width]."""
    y0, y1, wy = _positions(height, scale_y, source.shape[0])
    x0, x1, wx = _positions(width, scale_x, source.shape[1])
    grid = source.astype(np.float64)
    rows = grid[y0] * (1 - wy[:, None]) + grid[y1] * wy[:, None]
    return gain * (rows[:, x0] * (1 - wx) + rows[:, x1] * wx)
