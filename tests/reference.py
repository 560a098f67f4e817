"""Slow numpy twins of the compiled kernels: what each one must compute, written to be read."""

from __future__ import annotations

import numpy as np

LOW_CONFIDENCE, OCCLUDED, OUTSIDE_OVERLAP, OUT_OF_RANGE, SATURATED = 1, 2, 4, 8, 16


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


def reasons(
    disparity: np.ndarray,
    confidence: np.ndarray,
    *,
    min_confidence: float,
    image: np.ndarray | None = None,
    valid_left: np.ndarray | None = None,
    valid_right: np.ndarray | None = None,
    depth: np.ndarray | None = None,
    depth_range: tuple[float, float] = (0.0, np.inf),
    doffs: float = 0.0,
    disparity_end: float = np.inf,
) -> np.ndarray:
    """Reason bits of full-size float32 maps; with ``depth`` the range is tested, without it only the sign.

    From ``disparity_end`` on, px of these maps, the network finds nothing.
    """
    height, width = disparity.shape
    finite = np.isfinite(disparity)
    x = np.arange(width, dtype=np.float32)
    match = np.where(finite, x - np.where(finite, disparity, 0), np.float32(np.inf)).astype(np.float32)
    bits = np.zeros((height, width), np.uint8)
    bits[~(confidence >= min_confidence)] |= LOW_CONFIDENCE
    for y in range(height):
        for column in range(width - 1):
            if finite[y, column] and match[y, column + 1 :].min() < match[y, column] - np.float32(1):
                bits[y, column] |= OCCLUDED
    inside = finite & (match >= 0) & (match <= width - 1)
    bits[finite & ~inside] |= OUTSIDE_OVERLAP
    if valid_left is not None:
        bits[valid_left == 0] |= OUTSIDE_OVERLAP
    if valid_right is not None:
        nearest = np.where(inside, match + np.float32(0.5), 0).astype(int)
        bits[inside & (np.take_along_axis(valid_right, nearest, axis=1) == 0)] |= OUTSIDE_OVERLAP
    if depth is None:
        usable = disparity > 0
    else:
        usable = (disparity + np.float32(doffs) > 0) & (depth >= depth_range[0]) & (depth <= depth_range[1])
        usable &= np.isfinite(depth) & (depth > 0)
    bits[~(usable & finite & (disparity < np.float32(disparity_end)))] |= OUT_OF_RANGE
    if image is not None:
        bits[(image[:, :height, :width] >= 250).all(axis=0)] |= SATURATED
    return bits


def supported_confidence(
    disparity: np.ndarray, confidence: np.ndarray, left: np.ndarray, right: np.ndarray, height: int, width: int
) -> tuple[np.ndarray, bool]:
    """Confidence, 0 in blocks whose views do not agree at the disparity found, and whether the views belong together.

    Grids float32 [h, w]; views uint8 [3, H, W], of which ``height`` x ``width`` px are no padding and H / h, W / w px
    are one cell.
    """
    stride_y, stride_x = left.shape[1] / disparity.shape[0], left.shape[2] / disparity.shape[1]
    side = max(16, width // 60 * 2)
    shape = -(-height // side), -(-width // side)
    correlation = np.full(shape, np.nan)
    varies = np.zeros(shape, bool)
    for row, column in np.ndindex(shape):
        y = np.arange(row * side, min(height, row * side + side), 2)[:, None]
        x = np.arange(column * side, min(width, column * side + side), 2)[None]
        y, x = np.broadcast_arrays(y, x)
        found = disparity[((y + 0.5) / stride_y).astype(int), ((x + 0.5) / stride_x).astype(int)]
        inside = (found >= 0) & (found <= x)
        if np.count_nonzero(inside) < side * side // 4 // 4:
            continue
        match = x[inside] - np.floor(found[inside] + np.float32(0.5)).astype(int)
        a = left[1, y[inside], x[inside]].astype(float)
        b = right[1, y[inside], match].astype(float)
        spread = a.std() * b.std()
        correlation[row, column] = np.mean((a - a.mean()) * (b - b.mean())) / spread if spread > 0 else 0.0
        varies[row, column] = a.std() > 0
    judged = np.isfinite(correlation)
    enough = 3 * np.count_nonzero(correlation >= 0.5) >= np.count_nonzero(judged & varies)
    together = bool(enough and not np.array_equal(left, right))
    dropped = judged & (correlation <= 0.2) if together else np.ones(shape, bool)
    y, x = np.indices(confidence.shape)
    rows = np.minimum(((y + 0.5) * stride_y).astype(int) // side, shape[0] - 1)
    columns = np.minimum(((x + 0.5) * stride_x).astype(int) // side, shape[1] - 1)
    return np.where(dropped[rows, columns], np.float32(0), confidence), together


def sigma(depth: np.ndarray, confidence: np.ndarray, *, focal_baseline: float, gain: float) -> np.ndarray:
    """Expected depth error in mm: a Laplace law whose chance of an error up to one network pixel is the confidence."""
    # The limits are those of single precision, which is what confidence comes in.
    clamped = np.clip(confidence, np.float32(1e-6), np.float32(1 - 1e-6)).astype(np.float64)
    scale = -1 / np.log1p(-clamped)
    return depth**2 / focal_baseline * gain * np.sqrt(2) * scale


def joint_bilateral_upsampling(disparity: np.ndarray, confidence: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Disparity [h, w] of every pixel of ``view`` uint8 [3, H, W], which has H / h pixels per cell, float64 [H, W].

    Each pixel takes the mean of the cells less than three cells away, weighted by how near a cell lies (a tent), how
    much its mean colour is like the pixel's, and one over the scale of the Laplace law that its confidence tells.
    """
    h, w = disparity.shape
    factor = view.shape[1] // h
    colours = view.astype(np.float64)
    means = colours.reshape(3, h, factor, w, factor).mean(axis=(2, 4))
    known = np.nan_to_num(confidence, nan=0.0)
    trust = -np.log1p(-np.clip(known, np.float32(1e-6), np.float32(1 - 1e-6)).astype(np.float64))
    out = np.empty((h * factor, w * factor))
    for y, x in np.ndindex(out.shape):
        at_y, at_x = (y + 0.5) / factor - 0.5, (x + 0.5) / factor - 0.5
        weight = value = 0.0
        for cell_y in range(int(np.floor(at_y)) - 2, int(np.floor(at_y)) + 4):
            for cell_x in range(int(np.floor(at_x)) - 2, int(np.floor(at_x)) + 4):
                tent = max(0.0, 1 - abs(at_y - cell_y) / 3) * max(0.0, 1 - abs(at_x - cell_x) / 3)
                cell = min(max(cell_y, 0), h - 1), min(max(cell_x, 0), w - 1)  # the border stands in for what is beyond
                unlike = np.abs(means[:, cell[0], cell[1]] - colours[:, y, x]).sum()
                counts = tent * (max(0.0, 1 - unlike / 128) ** 4 + 1e-6) * trust[cell]
                weight += counts
                value += counts * disparity[cell]
        out[y, x] = value / weight
    return out
