"""The surfaces that objects are made of: grids of points in a unit box, and the mesh of many such grids."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.simulation.curve import Floats
from endosdk.simulation.meshes import Mesh


@dataclass(frozen=True)
class Patches:
    """``points`` [N,R,C,3] of N grids.

    Where they bound a body, ``outward`` [N] says on which side of each grid, 1 or -1, the outside lies. A rotation
    keeps it.
    """

    points: Floats
    outward: Floats | None = None

    def moved(self, points: Floats) -> Patches:
        """Return the same patches with other points: turned, stretched, shifted, but not mirrored."""
        return Patches(points, self.outward)


def bounding(points: Floats, inside: Floats) -> Patches:
    """Return grids [N,R,C,3] that bound bodies; ``inside`` (broadcast to them) are points behind each of theirs."""
    towards_outside = ((points - inside) * _normals(points)).sum(-1).sum((1, 2))
    return Patches(points, np.where(towards_outside < 0, -1.0, 1.0))


def sheet(rng: np.random.Generator) -> Patches:
    """Draw a sheet: flat, rolled about one axis, or wavy."""
    side = 24
    u, v = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    v = v * rng.uniform(0.3, 1.0)
    kind = int(rng.integers(3))
    if kind == 0:
        return Patches(np.stack([u, v, np.zeros_like(u)], -1)[None])
    if kind == 1:
        turn = rng.uniform(0.5, 2.5)
        return Patches(np.stack([np.sin(turn * u) / turn, v, (1 - np.cos(turn * u)) / turn], -1)[None])
    return Patches(np.stack([u, v, waves(rng, u, v)], -1)[None])


def waves(rng: np.random.Generator, u: Floats, v: Floats) -> Floats:
    """Draw a relief over a grid: the sum of a few waves, steeper where they are longer."""
    relief = np.zeros_like(u)
    for _ in range(4):
        wave = rng.normal(0, 2.5, 2)
        height = rng.uniform(0.03, 0.25) / (1.0 + 0.4 * float(np.linalg.norm(wave)))
        relief = relief + height * np.sin(wave[0] * u + wave[1] * v + rng.uniform(0, 2 * np.pi))
    return relief


def boxes(centres: Floats, halves: Floats) -> Patches:
    """Return upright boxes with the given centres and half sides, each [N,3]."""
    side = 5
    u, v = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            face = np.empty((side, side, 3))
            face[..., axis], face[..., (axis + 1) % 3], face[..., (axis + 2) % 3] = sign, sign * u, v
            faces.append(face)
    unit = np.stack(faces)
    points = centres[:, None, None, None] + halves[:, None, None, None] * unit[None]
    return bounding(points.reshape(-1, side, side, 3), np.repeat(centres, 6, axis=0)[:, None, None])


def box(rng: np.random.Generator) -> Patches:
    """Draw one box."""
    return boxes(np.zeros((1, 3)), rng.uniform(0.15, 1.0, (1, 3)))


def comb(rng: np.random.Generator) -> Patches:
    """Draw equal boxes in a row: teeth, stairs or a fence."""
    count = int(rng.integers(3, 14))
    centres = np.zeros((count, 3))
    centres[:, 0] = np.linspace(-1, 1, count)
    centres[:, 2] = np.linspace(-1, 1, count) * rng.uniform(0.0, 0.6)
    half = np.array([rng.uniform(0.2, 0.7) / count, rng.uniform(0.3, 1.0), rng.uniform(0.03, 0.3)])
    return boxes(centres, np.broadcast_to(half, centres.shape))


def body(rng: np.random.Generator) -> Patches:
    """Draw a closed body: between an ellipsoid and a box, smooth or with bumps."""
    rows, columns = 28, 44
    polar, turn = np.meshgrid(np.linspace(0, np.pi, rows), np.linspace(0, 2 * np.pi, columns), indexing="ij")
    ball = np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], -1)
    points = np.sign(ball) * np.abs(ball) ** rng.uniform(0.3, 1.2)
    swell = 1.0 + rng.uniform(0.0, 0.35) * np.sin(ball @ rng.normal(0, 2.5, 3) + rng.uniform(0, 6))
    return bounding((points * swell[..., None] * rng.uniform(0.35, 1.0, 3))[None], np.zeros(3))


def plate(rng: np.random.Generator) -> Patches:
    """Draw a flat plate of any outline, often with a hole."""
    columns = 49
    turn = np.linspace(0, 2 * np.pi, columns)
    corners = int(rng.integers(3, 9))
    if rng.random() < 0.5:  # straight sides
        outline = np.cos(np.pi / corners) / np.cos((turn % (2 * np.pi / corners)) - np.pi / corners)
    else:
        outline = 1.0 + rng.uniform(0.05, 0.45) * np.sin(corners * turn + rng.uniform(0, 6))
    inner = rng.uniform(0.3, 0.85) if rng.random() < 0.4 else 0.0
    radius = np.linspace(inner, 1.0, 6)[:, None] * outline[None] / max(1.0, float(outline.max()))
    stretch = rng.uniform(0.3, 1.0)
    return Patches(
        np.stack([radius * np.cos(turn), stretch * radius * np.sin(turn), np.zeros_like(radius)], -1)[None],
    )


def sweep(centre: Floats, radius: Floats, sides: int) -> Patches:
    """Return tubes along lines [N,M,3] with radii [N,M]."""
    along = np.gradient(centre, axis=1)
    along = along / np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    # The axis that the whole line follows least keeps the frame from turning over.
    hint = np.eye(3)[np.argmin(np.abs(along).max(axis=1), axis=-1)][:, None]
    side = np.cross(along, np.broadcast_to(hint, along.shape))
    side = side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
    other = np.cross(along, side)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    ring = np.cos(turn)[:, None] * side[:, :, None] + np.sin(turn)[:, None] * other[:, :, None]
    return bounding(centre[:, :, None] + radius[:, :, None, None] * ring, centre[:, :, None])


def rod(rng: np.random.Generator) -> Patches:
    """Draw a straight rod with ends, of one radius or tapering."""
    x = np.concatenate([[-1.0], np.linspace(-1, 1, 12), [1.0]])
    centre = np.stack([x, np.zeros_like(x), np.zeros_like(x)], -1)[None]
    thick = rng.uniform(0.03, 0.3)
    radius = np.concatenate([[0.0], np.linspace(thick, thick * rng.uniform(0.3, 1.0), 12), [0.0]])
    return sweep(centre, radius[None], 24)


def wires(rng: np.random.Generator, thickness: float) -> Patches:
    """Draw one to six bent wires of about this radius."""
    count, points = int(rng.integers(1, 7)), 40
    t = np.linspace(0, 1, points)[:, None]
    ends = rng.uniform(-1, 1, (count, 4, 1, 3)) * np.array([1.0, 1.0, 0.4])
    weights = [(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3]
    centre = np.asarray(sum(ends[:, k] * weights[k] for k in range(4)))
    radius = thickness * rng.uniform(0.5, 2.0, (count, 1)) * np.ones(points)
    return sweep(centre, radius, 8)


def spring(rng: np.random.Generator) -> Patches:
    """Draw a helix, or (with one turn and no pitch) a ring."""
    ring = rng.random() < 0.4
    turns = 1 if ring else int(rng.integers(3, 12))
    t = np.linspace(0, 2 * np.pi * turns, 24 * turns + 1)
    width = 0.9 if ring else rng.uniform(0.15, 0.5)
    x = np.zeros_like(t) if ring else np.linspace(-1, 1, len(t))
    centre = np.stack([x, width * np.cos(t), width * np.sin(t)], -1)[None]
    thick = rng.uniform(0.05, 0.3) * (width if ring else min(width, 2.0 / turns))
    return sweep(centre, np.full(centre.shape[:2], thick), 10)


def net(rng: np.random.Generator) -> Patches:
    """Draw a mesh of crossing wires, flat or bent, with 4 to 16 holes along a side."""
    count, points = int(rng.integers(5, 18)), 30
    t = np.linspace(-1, 1, points)
    lines = np.linspace(-1, 1, count)
    skew = rng.uniform(-0.4, 0.4)
    u = np.concatenate([np.broadcast_to(t, (count, points)), np.broadcast_to(lines[:, None], (count, points))])
    v = np.concatenate([np.broadcast_to(lines[:, None], (count, points)), np.broadcast_to(t, (count, points))])
    relief = waves(rng, u, v) if rng.random() < 0.6 else np.zeros_like(u)
    centre = np.stack([u + skew * v, v, relief], -1)
    thick = rng.uniform(0.05, 0.35) / count
    return sweep(centre, np.full(centre.shape[:2], thick), 6)


def mesh_of(patches: Patches, tile_mm: float, facing: Floats) -> Mesh:
    """Return the mesh of patches that stand where they shall, in mm; one texture covers ``tile_mm`` both ways.

    Open patches turn their normals towards the point ``facing``.
    """
    points = patches.points
    normals = _normals(points)
    normals = normals / np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-12)
    if patches.outward is not None:
        side = patches.outward
    else:
        side = np.where(((facing - points) * normals).sum(-1).mean((1, 2)) < 0, -1.0, 1.0)
    normals = normals * side[:, None, None, None]
    along_u = np.gradient(points, axis=2)
    count, rows, columns = points.shape[:3]
    uv = np.stack([_travelled(points, 2), _travelled(points, 1)], -1)
    uv = uv + 7.3 * tile_mm * np.arange(count)[:, None, None, None] * np.array([0.37, 0.61])  # no two patches alike
    tangents = along_u / np.maximum(np.linalg.norm(along_u, axis=-1, keepdims=True), 1e-12)
    index = np.arange(count * rows * columns, dtype=np.uint32).reshape(count, rows, columns)
    a, b, c, d = index[:, :-1, :-1], index[:, :-1, 1:], index[:, 1:, :-1], index[:, 1:, 1:]
    triangles = np.stack([np.stack([a, c, b], -1), np.stack([b, c, d], -1)], 3).reshape(-1, 3)
    return Mesh(
        np.ascontiguousarray(points.reshape(-1, 3), np.float32),
        np.ascontiguousarray(normals.reshape(-1, 3), np.float32),
        np.ascontiguousarray(tangents.reshape(-1, 3), np.float32),
        np.ascontiguousarray(uv.reshape(-1, 2), np.float32),
        np.ones(count * rows * columns, np.float32),
        np.ascontiguousarray(triangles),
        (tile_mm, tile_mm),
    )


def _normals(points: Floats) -> Floats:
    return np.cross(np.gradient(points, axis=2), np.gradient(points, axis=1))


def _travelled(points: Floats, axis: int) -> Floats:
    """Return the way along an axis of the grids, the same for all lines of one grid, so that patterns stay straight."""
    steps = np.linalg.norm(np.diff(points, axis=axis), axis=-1).mean(axis=3 - axis, keepdims=True)
    way = np.concatenate([np.zeros_like(np.take(steps, [0], axis)), np.cumsum(steps, axis)], axis)
    return np.broadcast_to(way, points.shape[:3])
