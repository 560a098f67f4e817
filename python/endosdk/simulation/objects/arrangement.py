"""Where objects stand and what they look like: a backdrop, walls, and a crowd of anything in front of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from endosdk.simulation import surfaces
from endosdk.simulation.curve import Floats
from endosdk.simulation.patterns import Picture, draw_pattern
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.scene import Lamp
from endosdk.simulation.surfaces import Patches, mesh_of
from endosdk.simulation.texture import FLAT_TILE, Surface, TissueTexture
from endosdk.simulation.tissue import draw_metal

WIRE_PX = (0.6, 4.0)  # radius of a wire in the picture
OBJECTS: dict[str, tuple[float, Callable[[np.random.Generator], Patches]]] = {
    "sheet": (0.16, surfaces.sheet),
    "box": (0.16, surfaces.box),
    "comb": (0.08, surfaces.comb),
    "body": (0.18, surfaces.body),
    "plate": (0.14, surfaces.plate),
    "rod": (0.08, surfaces.rod),
    "spring": (0.06, surfaces.spring),
    "net": (0.06, surfaces.net),
}
WIRES_SHARE = 0.08
WALLS = {"wall": 0.35, "room": 0.25, "floor": 0.25, "none": 0.15}
CROWDS = ((0.15, (1, 4)), (0.5, (5, 18)), (0.35, (19, 45)))
SIZES = (0.03, 0.75)  # of an object, as a share of the frame width
TILES_PX = (60.0, 500.0)  # what one texture covers in the picture


def draw_objects(rng: np.random.Generator, rig: SceneRig) -> tuple[list[Surface], dict[str, Any]]:
    """Draw all surfaces of a scene, in mm of the left camera, and say what they are."""
    pictures = [draw_pattern(rng) for _ in range(int(rng.integers(5, 11)))]
    wall = str(rng.choice(list(WALLS), p=list(WALLS.values())))
    found = [_painted(rng, rig, patches, pictures, distance) for patches, distance in _walls(rng, rig, wall)]
    crowd = CROWDS[int(rng.choice(len(CROWDS), p=[share for share, _ in CROWDS]))][1]
    names: list[str] = []
    for _ in range(int(rng.integers(crowd[0], crowd[1] + 1))):
        name, patches, distance = _placed_object(rng, rig)
        names.append(name)
        found.append(_painted(rng, rig, patches, pictures, distance))
    return found, {"wall": wall, "objects": names, "patterns": [name for name, _ in pictures]}


def draw_lamp(rng: np.random.Generator) -> Lamp:
    """Draw two emitters beside the camera, or anywhere behind it, and how much light comes from all sides."""
    tint = rng.uniform(0.85, 1.15, 3)
    reach = 5.0 if rng.random() < 0.5 else 300.0
    places = rng.uniform(-reach, reach, (2, 3))
    places[:, 2] = -np.abs(places[:, 2])
    first, second = ((float(x), float(y), float(z)) for x, y, z in places)
    return Lamp(
        emitters=(first, second),
        tint=(float(tint[0]), float(tint[1]), float(tint[2])),
        falloff=float(rng.uniform(0.0, 1.2)),
        beam=float(rng.uniform(0.0, 1.0)),
        ambient=float(rng.uniform(0.1, 1.0)),
    )


def _painted(
    rng: np.random.Generator, rig: SceneRig, patches: Patches, pictures: list[tuple[str, Picture]], distance: float
) -> Surface:
    """Give patches a picture; ``distance`` in mm decides how large its details are."""
    tile_px = float(np.exp(rng.uniform(*np.log(TILES_PX)))) * rig.camera.width / 480
    picture = pictures[int(rng.integers(len(pictures)))][1]
    albedo = np.full((*picture.shape[:2], 4), int(rng.integers(0, 128)), np.uint8)
    albedo[..., :3] = picture if rng.random() < 0.7 else picture[..., rng.permutation(3)]
    metal = draw_metal(rng, dark=bool(rng.random() < 0.85))
    look = replace(metal, gloss=float(rng.uniform(0.0, 1.5)), roughness=float(rng.uniform(0.2, 0.9)))
    mesh = mesh_of(patches, tile_px * distance / rig.camera.focal_px, np.zeros(3))
    return mesh, look, TissueTexture(albedo, FLAT_TILE, mesh.size_mm, mesh.size_mm[0])


def _placed_object(rng: np.random.Generator, rig: SceneRig) -> tuple[str, Patches, float]:
    """Draw an object and stand it anywhere in range, turned at random."""
    names = list(OBJECTS)
    shares = np.array([OBJECTS[name][0] for name in names] + [WIRES_SHARE])
    choice = int(rng.choice(len(shares), p=shares / shares.sum()))
    size_px = float(np.exp(rng.uniform(*np.log(SIZES)))) * rig.camera.width
    if choice < len(names):
        name, patches = names[choice], OBJECTS[names[choice]][1](rng)
    else:
        thickness = 2 * float(rng.uniform(*WIRE_PX)) * rig.camera.width / 480 / size_px
        name, patches = "wires", surfaces.wires(rng, thickness)
    # Even in disparity half of the time, even in its logarithm otherwise: near things and far things both come.
    low, high = rig.farthest, rig.nearest
    even = rng.random() < 0.5
    disparity = rng.uniform(low, high) if even else np.exp(rng.uniform(np.log(low), np.log(high)))
    distance = rig.camera.depth_of(float(disparity))
    place = rng.uniform((-0.1, -0.1), (1.15, 1.1)) * (rig.camera.width, rig.camera.height)
    sight = np.array([*((place - rig.centre) / rig.camera.focal_px), 1.0])
    half = min(0.5 * size_px * distance / rig.camera.focal_px, 0.5 * distance)
    points = half * patches.points @ _turn(rng) + distance * sight
    # A corner that would come too near moves the whole object away, along its line of sight: it looks the same.
    nearest = rig.camera.depth_of(rig.nearest)
    closest = max(float(points[..., 2].min()), 0.02 * distance)
    points = points * max(1.0, nearest / closest)
    return name, patches.moved(points), distance * max(1.0, nearest / closest)


def _turn(rng: np.random.Generator) -> Floats:
    """Draw a rotation; half of them leave the front nearly in front."""
    basis, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    turn = basis * np.sign(np.diag(upper))
    if rng.random() < 0.5:
        tilted = np.eye(3) + 0.5 * rng.normal(size=(3, 3))
        basis, upper = np.linalg.qr(tilted)
        turn = basis * np.sign(np.diag(upper))
    return np.asarray(turn if np.linalg.det(turn) > 0 else -turn)


def _walls(rng: np.random.Generator, rig: SceneRig, kind: str) -> Iterator[tuple[Patches, float]]:
    """Yield a backdrop that fills the view, and the walls in front of it, each with its typical distance."""
    yield _plane(rng, rig, rig.farthest * float(rng.uniform(0.5, 1.0)), 0.0, 0.0)
    middle = rig.farthest * (rig.nearest / rig.farthest) ** float(rng.uniform(0.05, 0.6))
    room = min(middle - 0.6 * rig.farthest, rig.nearest - middle)
    if kind == "wall":
        yield _plane(rng, rig, middle, room, 0.0)
    elif kind == "floor":
        yield _plane(rng, rig, middle, 0.5 * room, float(rng.uniform(0.02, 0.15)))
    elif kind == "room":
        distance = rig.camera.depth_of(middle)
        half = np.array([rig.camera.width, rig.camera.height, 0.0]) * 0.5 * distance / rig.camera.focal_px
        half = half * rng.uniform(0.55, 1.1, 3) + np.array([0, 0, distance])
        turn = np.linalg.qr(np.eye(3) + 0.12 * rng.normal(size=(3, 3)))[0]
        turn = turn * np.sign(np.diag(turn))
        yield Patches(surfaces.boxes(np.zeros((1, 3)), half[None]).points @ turn), distance


def _plane(
    rng: np.random.Generator, rig: SceneRig, middle: float, change: float, relief: float
) -> tuple[Patches, float]:
    """Return a plane with ``middle`` px of disparity in the middle, and waves of ``relief`` of its distance.

    At the borders it has at most ``change`` px more or less. Disparity is linear over the picture of a plane, which
    gives its normal.
    """
    camera = rig.camera
    product = camera.focal_px * camera.baseline_mm
    slope = rng.normal(size=2)
    slope = slope / np.abs(slope).sum() * change * float(rng.uniform(0.0, 0.7)) / (0.8 * camera.width)
    normal = np.array([slope[0] * camera.focal_px, slope[1] * camera.focal_px, middle])
    places = [(x * camera.width, y * camera.height) for x in (-0.15, 1.35) for y in (-0.15, 1.15)]
    corners = [np.array([*((np.array(place) - rig.centre) / camera.focal_px), 1.0]) for place in places]
    reached = np.array([sight * product / max(float(normal @ sight), 0.3 * middle) for sight in corners])
    unit = normal / np.linalg.norm(normal)
    across = np.cross([0.0, 1.0, 0.0], unit)
    across = across / np.linalg.norm(across)
    down = np.cross(unit, across)
    spin = float(rng.uniform(0, 2 * np.pi))  # patterns run in any direction
    across, down = np.cos(spin) * across + np.sin(spin) * down, np.cos(spin) * down - np.sin(spin) * across
    origin = np.array([0.0, 0.0, product / middle])
    low = [float(((reached - origin) @ axis).min()) for axis in (across, down)]
    high = [float(((reached - origin) @ axis).max()) for axis in (across, down)]
    side = 64 if relief else 16
    u, v = np.meshgrid(np.linspace(low[0], high[0], side), np.linspace(low[1], high[1], side))
    points = origin + u[..., None] * across + v[..., None] * down
    if relief:
        scale = 0.4 * float(origin[2]) * camera.width / camera.focal_px
        bumps = surfaces.waves(rng, u / scale, v / scale) + 0.4 * surfaces.waves(rng, 3 * u / scale, 3 * v / scale)
        points = points + (relief * float(origin[2]) * bumps)[..., None] * unit
    return Patches(points[None]), float(origin[2])
