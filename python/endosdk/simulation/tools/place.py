"""Where tools stand in the picture: in front of the tissue, up to the nearest that the rig may show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation import surfaces
from endosdk.simulation.camera import Pose
from endosdk.simulation.curve import Floats
from endosdk.simulation.noise import Array
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.surfaces import mesh_of
from endosdk.simulation.texture import Surface, TissueTexture
from endosdk.simulation.tissue import Tissue
from endosdk.simulation.tools import pieces
from endosdk.simulation.tools.materials import draw_material
from endosdk.simulation.tools.pieces import Piece

COUNTS = (0.1, 0.4, 0.35, 0.15)  # shares of scenes with 0, 1, 2 and 3 instruments
EXTRAS = {"needle": 0.2, "thread": 0.1, "clips": 0.15, "gauze": 0.12, "net": 0.05, "tube": 0.08, "trocar": 0.08}
SHAFT_MM = (1.2, 4.5)  # radius
WIDEST = 0.16  # radius of a shaft, as a share of its distance
PLACES = 6  # that are tried for an instrument; the one that fits best is taken
TILE_RADII = 6.0  # a texture repeats along a tool after so many radii


@dataclass(frozen=True)
class BareView:
    """The picture before any tool is in it."""

    rig: SceneRig
    depth: Array  # [H,W] mm of the left view
    reach: float  # mm at which the lamp has unit strength

    @property
    def nearest(self) -> float:
        """Depth in mm of the nearest that the rig may show."""
        return self.rig.camera.depth_of(self.rig.limit)

    def sight(self, place: Floats) -> Floats:
        """Return the ray with z = 1 through a pixel."""
        return np.array([*((place - np.asarray(self.rig.centre)) / self.rig.camera.focal_px), 1.0])

    def before(self, rng: np.random.Generator, place: Floats) -> float:
        """Draw a depth in mm between the nearest and the tissue at a pixel; near ones are as likely as far ones."""
        height, width = self.depth.shape
        column, row = (int(np.clip(p, 3, side - 4)) for p, side in zip(place, (width, height), strict=True))
        tissue = float(self.depth[row - 3 : row + 4, column - 3 : column + 4].min())
        far = max(0.97 * min(tissue, 10 * self.reach), 1.05 * self.nearest)
        return float(self.nearest * (far / self.nearest) ** rng.uniform(0.15, 1.0))


def draw_tools(rng: np.random.Generator, view: BareView) -> tuple[list[Surface], dict[str, Any]]:
    """Draw all tools of a scene in mm of the left camera, and say what they are."""
    found: list[Surface] = []
    names: list[str] = []
    for _ in range(int(rng.choice(len(COUNTS), p=COUNTS))):
        name, parts = pieces.instrument(rng)
        names.append(name)
        tried = (_instrument(rng, view, parts) for _ in range(PLACES))
        placed = min(tried, key=lambda place: _excess(view, place[0], place[2]))
        found += _made(rng, view, *placed)
    for name, share in EXTRAS.items():
        if rng.random() < share:
            names.append(name)
            found += _made(rng, view, *_extra(rng, view, name))
    return found, {"tools": names}


def into_organ(surface: Surface, pose: Pose, scale: float) -> Surface:
    """Return a surface in the organ's coordinates, which the renderer enlarges by ``scale`` about the camera."""
    mesh, look, texture = surface
    axes = pose.axes.astype(np.float32)
    positions = mesh.positions.astype(np.float64) / scale @ pose.axes + pose.position
    moved = replace(
        mesh, positions=positions.astype(np.float32), normals=mesh.normals @ axes, tangents=mesh.tangents @ axes
    )
    return moved, look, texture


def _instrument(rng: np.random.Generator, view: BareView, parts: list[Piece]) -> tuple[list[Piece], float, float]:
    """Stand an instrument in the picture: its wrist at a pixel, its shaft out of it; return parts, radius, distance."""
    camera = view.rig.camera
    place = rng.uniform((0.12, 0.12), (0.88, 0.88)) * (camera.width, camera.height)
    distance = view.before(rng, place)
    radius = min(float(rng.uniform(*SHAFT_MM)), WIDEST * distance)
    wrist = distance * view.sight(place)
    # The shaft leaves towards a point beside the camera, most often from below or from a side.
    turn = rng.uniform(-0.35, 1.35) * np.pi
    away = rng.uniform(0.7, 2.5) * distance
    entry = np.array([np.cos(turn) * away, np.sin(turn) * away, rng.uniform(-0.3, 0.9) * distance])
    axis = entry - wrist
    axis = axis / np.linalg.norm(axis)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side = side / max(float(np.linalg.norm(side)), 1e-9)
    frame = np.stack([axis, side, np.cross(axis, side)], 1) * radius
    return [part.moved(frame, wrist) for part in parts], radius, distance


def _extra(rng: np.random.Generator, view: BareView, name: str) -> tuple[list[Piece], float, float]:
    camera = view.rig.camera
    place = rng.uniform((0.1, 0.1), (0.9, 0.9)) * (camera.width, camera.height)
    distance = view.before(rng, place)
    if name == "trocar":
        # Nearer than all else, and so wide that its edge is an arc at one side.
        distance = view.nearest * float(rng.uniform(1.15, 1.6))
        radius = distance * camera.width / camera.focal_px * float(rng.uniform(0.5, 0.65))
        shift = rng.normal(0, 0.12, 2) * radius
        parts = pieces.trocar(rng)
        return [p.moved(radius * np.eye(3), np.array([*shift, distance])) for p in parts], 0.1 * radius, distance
    parts, size, tile = _loose(rng, name)
    size = min(size, 0.3 * distance)
    turn = (
        pieces.about(0, rng.normal(0, 0.6)) @ pieces.about(1, rng.normal(0, 0.6)) @ pieces.about(2, rng.uniform(0, 6.3))
    )
    return [p.moved(size * turn, distance * view.sight(place)) for p in parts], tile * size, distance


def _loose(rng: np.random.Generator, name: str) -> tuple[list[Piece], float, float]:
    """Draw a thing that lies about: its parts, its size in mm, and the share of it that a texture tile covers."""
    if name == "needle":
        return pieces.needle(rng), float(rng.uniform(3, 9)), 0.05
    if name == "thread":
        radius = float(rng.uniform(0.008, 0.03))
        return [Piece(pieces.thread(rng, np.zeros(3), radius), "violet")], float(rng.uniform(5, 15)), 0.05
    if name == "clips":
        return pieces.clips(rng), float(rng.uniform(2, 7)), 0.1
    if name == "gauze":
        return [Piece(surfaces.sheet(rng), "cloth")], float(rng.uniform(6, 30)), float(rng.uniform(0.03, 0.12))
    if name == "net":
        return [Piece(surfaces.net(rng), "white")], float(rng.uniform(8, 30)), 0.1
    radius = float(rng.uniform(0.06, 0.25))  # a drain or a vessel loop
    return [Piece(pieces.thread(rng, np.zeros(3), radius), "plastic")], float(rng.uniform(6, 20)), radius


def _made(
    rng: np.random.Generator, view: BareView, parts: list[Piece], radius: float, distance: float
) -> list[Surface]:
    """Give parts their materials, and move the whole away where it would come too near."""
    factor = _excess(view, parts, distance)
    shade = float(np.clip((factor * distance / view.reach) ** 1.3, 0.1, 1.0))
    found = []
    looks: dict[str, tuple[Tissue, TissueTexture]] = {}
    for part in parts:
        tile = TILE_RADII * radius * factor
        if part.material not in looks:
            looks[part.material] = draw_material(rng, part.material, (tile, tile), shade)
        patches = part.patches.moved(part.patches.points * factor)
        found.append((mesh_of(patches, tile, np.zeros(3)), *looks[part.material]))
    return found


def _excess(view: BareView, parts: list[Piece], distance: float) -> float:
    """Return by what factor parts must move away for nothing to come too near, at least 1."""
    visible = [points[_in_front(points, view)] for points in (part.patches.points for part in parts)]
    closest = min((float(points[..., 2].min()) for points in visible if len(points)), default=view.nearest)
    return max(1.0, view.nearest / max(closest, 0.02 * distance))


def _in_front(points: Floats, view: BareView) -> NDArray[np.bool_]:
    """Return which of the points [...,3] either view may show: a shaft passes beside the camera, out of sight."""
    camera = view.rig.camera
    depth = np.maximum(points[..., 2], 1e-6)
    column = points[..., 0] / depth * camera.focal_px + view.rig.centre[0]
    row = points[..., 1] / depth * camera.focal_px + view.rig.centre[1]
    disparity = camera.focal_px * camera.baseline_mm / depth
    seen = (points[..., 2] > 0) & (column > -0.1 * camera.width) & (column - disparity < 1.1 * camera.width)
    return np.asarray(seen & (row > -0.1 * camera.height) & (row < 1.1 * camera.height))
