"""Turn shapes into triangle meshes, with real displacement and with texture coordinates that follow arc length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.curve import Floats, even_points, moving_frames
from endosdk.simulation.noise import Array, space_noise, tile_noise
from endosdk.simulation.shapes import Blob, Rod, Shape, Tube


@dataclass(frozen=True)
class Mesh:
    """Triangles ready to draw. ``uv`` is in mm; ``size_mm`` is the stretch of u and v that one texture covers."""

    positions: Array  # [N,3] mm
    normals: Array  # [N,3] unit, towards the camera's side
    tangents: Array  # [N,3] unit, along u
    uv: Array  # [N,2]
    shade: Array  # [N] 0..1, less in hollows that light hardly reaches
    triangles: NDArray[np.uint32]  # [M,3]
    size_mm: tuple[float, float]


def build_mesh(shape: Shape, seed: tuple[int, ...]) -> Mesh:
    """Build the mesh of a shape; the same shape and seed give the same bytes."""
    rng = np.random.default_rng(seed)
    if isinstance(shape, Tube):
        return _tube(rng, shape)
    if isinstance(shape, Blob):
        return _blob(rng, shape)
    return _rod(shape)


def _tube(rng: np.random.Generator, shape: Tube) -> Mesh:
    columns = 320 if shape.inside else 200
    _, length = even_points(np.asarray(shape.control), 8)
    step = 2.0 * np.pi * shape.radius / columns
    # Finer along the axis of a gut: its folds are narrow, and seen edge on they would show the grid.
    rows = int(np.clip(length / (0.7 * step if shape.inside else step), 120, 1300))
    centre, length = even_points(np.asarray(shape.control), rows)
    tangents, normals, binormals = moving_frames(centre)
    along = np.asarray(np.linspace(0.0, length, rows), np.float64)
    theta: Floats = np.arange(columns, dtype=np.float64) * (2.0 * np.pi / columns)
    radius, shift = _tube_wall(rng, shape, along, theta, step)
    outward = np.cos(theta)[None, :, None] * normals[:, None] + np.sin(theta)[None, :, None] * binormals[:, None]
    positions = centre[:, None] + radius[..., None] * outward + shift[..., None] * tangents[:, None]
    sign = -1.0 if shape.inside else 1.0
    along_u, along_v = _differences(positions)
    normal = _facing(np.cross(along_v, along_u), sign * outward)
    normal[0], normal[-1] = -sign * tangents[0], sign * tangents[-1]  # the ends are points, without a turn of their own
    travelled = np.concatenate(
        [np.zeros((1, columns)), np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=2), axis=0)]
    )
    girth = 2.0 * np.pi * shape.radius
    uv = np.stack([travelled, np.broadcast_to(theta * shape.radius, travelled.shape)], -1)
    shade = _hollow_shade(radius if shape.inside else -radius, shape.radius, columns // 12)
    grid = [_close_ring(a) for a in (positions, normal, along_u, uv, shade)]
    grid[3][:, -1, 1] = girth
    return _grid_mesh(grid, (float(travelled.max()), girth))


def _tube_wall(
    rng: np.random.Generator, shape: Tube, along: Floats, theta: Floats, step: float
) -> tuple[Floats, Floats]:
    """Radius and shift along the axis, each [rows, columns]."""
    grid = (len(along), len(theta))
    coarse = tile_noise(rng, grid, shape.wave_mm / step)
    radius = 1.0 + shape.waves * coarse + 0.12 * shape.waves * tile_noise(rng, grid, 0.4 * shape.wave_mm / step)
    radius = radius + 0.0012 * tile_noise(rng, grid, max(6.0, 3.0 / step))
    if shape.taeniae > 0:
        band = np.cos(shape.sectors * theta / 2.0) ** 16
        radius = radius - shape.taeniae * band
    ridge = np.zeros(grid)
    if shape.fold_spacing > 0:
        place = rng.uniform(0.3, 0.9) * shape.fold_spacing
        while place < along[-1]:
            ridge = np.maximum(ridge, _fold(rng, shape, along, theta, place))
            place += shape.fold_spacing * rng.uniform(0.7, 1.35)
        radius = radius + shape.swelling * (1.0 - ridge / max(float(ridge.max()), 1e-6))
    radius = np.clip(radius - ridge, 0.25, None)
    # Rounded ends close the tube, so that no ray of sight is lost.
    to_end = np.minimum(along, along[-1] - along)[:, None] / shape.radius
    cap = np.sqrt(np.clip(1.0 - np.clip(1.0 - to_end, 0.0, 1.0) ** 2, 0.0, 1.0))
    return shape.radius * radius * cap, shape.radius * shape.fold_lean * ridge * cap


def _fold(rng: np.random.Generator, shape: Tube, along: Floats, theta: Floats, place: float) -> Floats:
    tilt = rng.uniform(-0.35, 0.35) * shape.radius * np.cos(theta - rng.uniform(0, 2 * np.pi))
    wobble = shape.radius * 0.06 * np.sin(rng.integers(2, 6) * theta + rng.uniform(0, 2 * np.pi))
    if shape.sectors > 0:
        phase = shape.sectors * theta / (2 * np.pi)
        heights = rng.uniform(0.15, 1.0, shape.sectors)
        tall = heights[np.floor(phase).astype(int) % shape.sectors]
        # A fold rises between two bands of muscle and sinks to little on them; sectors are slightly staggered.
        envelope = 0.12 + tall * np.abs(np.sin(np.pi * phase)) ** 0.8
        stagger = rng.uniform(-0.2, 0.2, shape.sectors)[np.floor(phase).astype(int) % shape.sectors]
        wobble = wobble + stagger * shape.fold_spacing * np.abs(np.sin(np.pi * phase))
    else:
        envelope = 0.6 + 0.4 * np.cos(theta - rng.uniform(0, 2 * np.pi))
    distance = np.abs(along[:, None] - (place + tilt + wobble)[None, :]) / (shape.fold_width * rng.uniform(0.7, 1.4))
    return np.asarray(shape.fold_height * envelope[None, :] * np.exp(-(distance**1.8)))


def _blob(rng: np.random.Generator, shape: Blob) -> Mesh:
    rows, columns = (360, 560) if shape.inside else (200, 320)
    polar = np.asarray(np.linspace(0.0, np.pi, rows), np.float64)
    turn: Floats = np.arange(columns, dtype=np.float64) * (2.0 * np.pi / columns)
    ring = np.stack([np.cos(turn), np.sin(turn)], -1)
    local = np.concatenate(
        [
            np.sin(polar)[:, None, None] * ring[None],
            np.broadcast_to(np.cos(polar)[:, None, None], (rows, columns, 1)),
        ],
        -1,
    )
    scaled = local * np.asarray(shape.axes)
    mean_radius = float(np.mean(shape.axes))
    flat = scaled.reshape(-1, 3).astype(np.float32)
    swell = shape.waves * space_noise(rng, flat, shape.wave_mm, 2, 0.25)
    swell += shape.fine * space_noise(rng, flat, shape.wave_mm * 0.2, 2, 0.4)
    factor = 1.0 + swell.reshape(rows, columns).astype(np.float64)
    factor = _rugae(rng, shape, factor, polar, turn)
    positions = scaled * factor[..., None]
    axis = _unit(np.asarray(shape.pole))
    side = _unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
    turned = positions @ np.stack([side, np.cross(axis, side), axis])
    along_polar, along_turn = _differences(turned)
    normal = _facing(np.cross(along_polar, along_turn), -turned if shape.inside else turned)
    # u runs along one fixed direction of the disc around the pole, so its tangent mixes both grid directions.
    tangent = _unit_rows(along_polar) * ring[None, :, :1] - _unit_rows(along_turn) * ring[None, :, 1:]
    for k, inner in ((0, 1), (-1, -2)):
        normal[k] = normal[inner].mean(0)
        tangent[k] = tangent[inner]
    uv = polar[:, None, None] * ring[None] * mean_radius
    shade = _hollow_shade(factor if shape.inside else -factor, 1.0, columns // 16)
    grid = [_close_ring(a) for a in (turned + np.asarray(shape.centre), normal, tangent, uv, shade)]
    reach = 2.0 * mean_radius * (2.2 if shape.inside else 1.7)
    return _grid_mesh(grid, (reach, reach))


def _rugae(rng: np.random.Generator, shape: Blob, factor: Floats, polar: Floats, turn: Floats) -> Floats:
    """Add folds that wind towards the pole, and the funnel at the pole."""
    grid = (len(polar), len(turn))
    if shape.rugae > 0:
        wander = 0.55 * tile_noise(rng, grid, 90.0) + 0.18 * tile_noise(rng, grid, 34.0)
        phase = shape.rugae * turn[None, :] / (2 * np.pi) + wander
        crest = np.abs((phase % 1.0) - 0.5) * 2.0  # 0 on a crest
        strength = np.clip(0.6 + 0.5 * tile_noise(rng, grid, 80.0), 0.0, 1.2)
        fade = np.clip(np.sin(np.clip(polar, 0, np.pi)) * 1.8, 0.0, 1.0)[:, None]
        factor = factor - shape.ruga_height * strength * fade * np.exp(-((crest / shape.ruga_width) ** 2))
    if shape.outlet > 0:
        funnel = shape.outlet * np.exp(-((polar / 0.13) ** 4))
        lip = 0.10 * np.exp(-(((polar - 0.2) / 0.07) ** 2))
        factor = factor + (funnel - lip)[:, None]
    return factor


def _rod(shape: Rod) -> Mesh:
    start, stop = np.asarray(shape.start), np.asarray(shape.stop)
    length = float(np.linalg.norm(stop - start))
    axis = (stop - start) / length
    side = _unit(np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))]))
    other = np.cross(axis, side)
    turn = np.arange(64) * (2.0 * np.pi / 64)
    # Distance along the axis and radius of each ring: a rounded cap, the shaft, a rounded cap.
    bend = np.linspace(0.0, 0.5 * np.pi, 7)
    first, last = shape.radius_start, shape.radius_stop
    along = np.concatenate([0.5 * first * (1 - np.cos(bend)), length - 0.5 * last * (1 - np.cos(bend))[::-1]])
    radius = np.concatenate([first * np.sin(bend), last * np.sin(bend)[::-1]])
    outward = np.cos(turn)[:, None] * side + np.sin(turn)[:, None] * other
    positions = start + along[:, None, None] * axis + radius[:, None, None] * outward[None]
    slope = np.gradient(radius) / np.maximum(np.abs(np.gradient(along)), 1e-6)
    normal = outward[None] - np.clip(slope, -20, 20)[:, None, None] * axis
    tangent = np.broadcast_to(axis, positions.shape)
    uv = np.stack(np.broadcast_arrays(along[:, None], (turn * max(first, last))[None]), -1)
    grid = [_close_ring(a) for a in (positions, normal, tangent, uv, np.ones(uv.shape[:2]))]
    girth = 2.0 * np.pi * max(first, last)
    grid[3][:, -1, 1] = girth
    return _grid_mesh(grid, (length, girth))


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector))


def _unit_rows(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _differences(positions: Floats) -> tuple[Floats, Floats]:
    """Return differences along the rows and, wrapping around, along the columns."""
    return np.asarray(np.gradient(positions, axis=0)), np.roll(positions, -1, 1) - np.roll(positions, 1, 1)


def _facing(normals: Floats, towards: Floats) -> Floats:
    """Turn the normals of a grid over, all together, if most face away: a fold that leans over has both kinds."""
    return np.asarray(normals * np.sign(np.einsum("ijk,ijk->ij", normals, towards).sum()))


def _hollow_shade(radius: Floats, scale: float, reach: int) -> Floats:
    """Darken what lies further out than its surroundings: light comes from near the axis."""
    import cv2

    field = np.pad(np.asarray(radius / scale, np.float32), ((reach, reach), (reach, reach)), mode="wrap")
    around = cv2.blur(cv2.blur(field, (reach, reach)), (reach, reach))
    hollow = (field - around)[reach:-reach, reach:-reach]
    return np.asarray(np.clip(1.0 - 3.0 * hollow, 0.45, 1.15), np.float64)


def _close_ring(grid: Floats) -> Floats:
    return np.concatenate([grid, grid[:, :1]], 1)


def _grid_mesh(grid: list[Floats], size_mm: tuple[float, float]) -> Mesh:
    positions, normals, tangents, uv, shade = grid
    rows, columns = shade.shape
    index = np.arange(rows * columns, dtype=np.uint32).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
    triangles = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 2).reshape(-1, 3)
    return Mesh(
        np.ascontiguousarray(positions.reshape(-1, 3), np.float32),
        np.ascontiguousarray(_unit_rows(normals).reshape(-1, 3), np.float32),
        np.ascontiguousarray(_unit_rows(tangents).reshape(-1, 3), np.float32),
        np.ascontiguousarray(uv.reshape(-1, 2), np.float32),
        np.ascontiguousarray(shade.reshape(-1), np.float32),
        np.ascontiguousarray(triangles),
        size_mm,
    )
