"""One endoscopic scene as plain data, drawn from a seed. No renderer is known here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.simulation import organs
from endosdk.simulation.camera import Pose, look
from endosdk.simulation.curve import bezier
from endosdk.simulation.organs import Part, Path
from endosdk.simulation.sensor import Sensor, draw_sensor
from endosdk.simulation.tissue import Tissue, draw_metal

ORGANS = ("intestine", "stomach", "ducts", "abdomen")
# Names that stand for several organs, and how often each comes. "gi" holds the three of the paper.
MIXTURES = {
    "gi": {"intestine": 0.45, "stomach": 0.35, "ducts": 0.2},
    "mix": {"intestine": 0.28, "stomach": 0.17, "ducts": 0.1, "abdomen": 0.45},
    "lap": {"abdomen": 0.7, "stomach": 0.12, "intestine": 0.12, "ducts": 0.06},
}
LAP = "lap"  # the mixture that has instruments near the lens, see tools
SHAPES = "shapes"  # scenes without any organ, see objects
INSTRUMENT_SHARE = 0.25
# Nearest surface of a scene, as a share of the largest disparity allowed: mostly close, as in life.
NEAREST_SHARE = (0.35, 0.99)


@dataclass(frozen=True)
class Lamp:
    """The light carried by the camera: two emitters, each at an offset in mm from the middle of the rig."""

    emitters: tuple[tuple[float, float, float], tuple[float, float, float]]
    tint: tuple[float, float, float]
    falloff: float  # power of distance; 2 is a point in empty space, less where walls throw light back
    beam: float  # power of the cosine off axis
    ambient: float  # light that has bounced, as a share of the direct light at the typical distance


@dataclass(frozen=True)
class Instrument:
    """A tool reaching into the picture. Placed once the depth behind its tip is known."""

    tip: tuple[float, float]  # where the tip appears, share of width and height
    angle: float  # direction of the shaft in the picture, radians
    hover: float  # depth of the tip as a share of the depth of the tissue behind
    approach: float  # how much nearer the shaft is where it leaves the picture, as a share of the tip's depth
    radius: float  # of the shaft, as a share of the tip's depth
    jaw: float  # opening, radians
    shaft: Tissue
    steel: Tissue


@dataclass(frozen=True)
class Scene:
    """All that a renderer needs, and nothing of how it renders."""

    seed: int
    organ: str
    parts: tuple[Part, ...]
    path: Path
    lamp: Lamp
    sensor: Sensor
    instrument: Instrument | None
    nearest_share: float


def check_organ(name: str) -> None:
    """Raise InvalidArgument unless the name is an organ, a mixture, or `SHAPES`."""
    known = (*ORGANS, *MIXTURES, SHAPES)
    if name not in known:
        raise InvalidArgument("organ", f"must be one of {', '.join(known)}", name)


def draw_scene(seed: int, organ: str) -> Scene:
    """Draw the scene of this seed; ``organ`` is one of `ORGANS`, or of `MIXTURES` to let the seed choose."""
    check_organ(organ)
    if organ == SHAPES:
        raise InvalidArgument("organ", "shapes hold no organ", organ)
    if seed < 0:
        raise InvalidArgument("seed", "must not be negative", seed)
    chooser = np.random.default_rng((seed, 0))
    if organ in MIXTURES:
        shares = MIXTURES[organ]
        organ = str(chooser.choice(list(shares), p=list(shares.values())))
    rng = np.random.default_rng((seed, 1))
    parts, path = organs.DRAW[organ](rng)
    tools = np.random.default_rng((seed, 2))
    return Scene(
        seed=seed,
        organ=organ,
        parts=parts,
        path=path,
        lamp=_draw_lamp(np.random.default_rng((seed, 3))),
        sensor=draw_sensor(np.random.default_rng((seed, 4))),
        instrument=_draw_instrument(tools) if tools.random() < INSTRUMENT_SHARE else None,
        nearest_share=float(np.random.default_rng((seed, 5)).uniform(*NEAREST_SHARE) ** 0.5),
    )


def candidate_poses(scene: Scene) -> Iterator[Pose]:
    """Yield, without end, poses along the scene's path; the same scene yields the same poses."""
    rng = np.random.default_rng((scene.seed, 6))
    path = scene.path
    control = np.asarray(path.control)
    while True:
        t = float(rng.uniform(*path.span))
        here, ahead = bezier(control, np.array([t, min(1.0, t + path.look_ahead)]))
        side = rng.normal(size=3)
        position = here + side / np.linalg.norm(side) * rng.uniform(0, path.wander)
        target = ahead if path.target is None else np.asarray(path.target)
        distance = float(np.linalg.norm(target - position))
        target = target + rng.normal(size=3) * path.jitter * distance
        yield look(position, target, float(rng.uniform(-np.pi, np.pi) if path.roll else rng.uniform(-0.3, 0.3)))


def _draw_lamp(rng: np.random.Generator) -> Lamp:
    across = rng.uniform(2.0, 7.0)
    tilt = rng.uniform(-0.6, 0.6)
    x, y = across * np.cos(tilt), across * np.sin(tilt)
    depth = rng.uniform(-3.0, 1.0)
    tint = rng.uniform(0.92, 1.08, 3)
    return Lamp(
        emitters=((float(x), float(y), float(depth)), (float(-x), float(-y), float(depth))),
        tint=(float(tint[0]), float(tint[1]), float(tint[2])),
        falloff=float(rng.uniform(1.2, 2.0)),
        beam=float(rng.uniform(0.3, 2.5)),
        ambient=float(rng.uniform(0.03, 0.2)),
    )


def _draw_instrument(rng: np.random.Generator) -> Instrument:
    return Instrument(
        tip=(float(rng.uniform(0.2, 0.8)), float(rng.uniform(0.2, 0.8))),
        angle=float(rng.uniform(0, 2 * np.pi)),
        hover=float(rng.uniform(0.6, 0.92)),
        approach=float(rng.uniform(0.1, 0.5)),
        radius=float(rng.uniform(0.05, 0.14)),
        jaw=float(rng.uniform(0.05, 0.45)),
        shaft=draw_metal(rng, dark=bool(rng.random() < 0.6)),
        steel=draw_metal(rng, dark=False),
    )
