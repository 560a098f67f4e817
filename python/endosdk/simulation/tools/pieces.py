"""The parts of instruments. Lengths are radii of the shaft; the wrist is the origin, and the shaft runs along +x."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from endosdk.simulation.curve import Floats
from endosdk.simulation.surfaces import Patches, boxes, sweep

SHAFT_LENGTH = 80.0


@dataclass(frozen=True)
class Piece:
    """A part and what it is made of."""

    patches: Patches
    material: str

    def moved(self, turn: Floats, shift: Floats) -> Piece:
        """Return the part after a rotation 3x3 and a shift."""
        return Piece(self.patches.moved(self.patches.points @ turn.T + shift), self.material)


def line(points: Floats, radius: float | Floats, sides: int = 12) -> Patches:
    """Return a closed bar along points [M,3]."""
    thick = np.broadcast_to(np.asarray(radius, np.float64), len(points)).copy()
    centre = np.concatenate([points[:1], points, points[-1:]])
    return sweep(centre[None], np.concatenate([[0.0], thick, [0.0]])[None], sides)


def straight(
    start: tuple[float, float, float], stop: tuple[float, float, float], radius: float, points: int = 16
) -> Patches:
    """Return a closed straight bar."""
    return line(np.linspace(start, stop, points), radius, 24)


def about(axis: int, angle: float) -> Floats:
    """Return a rotation about a coordinate axis."""
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[first, first] = turn[second, second] = np.cos(angle)
    turn[first, second], turn[second, first] = -np.sin(angle), np.sin(angle)
    return turn


def shaft(rng: np.random.Generator) -> list[Piece]:
    """Draw a shaft, with or without rings and a steel collar at its end."""
    material = str(rng.choice(["dark", "steel", "plastic", "white"], p=(0.5, 0.38, 0.06, 0.06)))
    pieces = [Piece(straight((0.3, 0, 0), (SHAFT_LENGTH, 0, 0), 1.0, 160), material)]
    if rng.random() < 0.7:
        pieces.append(Piece(straight((-0.2, 0, 0), (rng.uniform(1.0, 4.0), 0, 0), 1.04), "steel"))
    if rng.random() < 0.3:  # a spring or a row of grooves
        count = int(rng.integers(4, 12))
        for k in range(count):
            x = 4.5 + 0.6 * k
            pieces.append(Piece(straight((x, 0, 0), (x + 0.25, 0, 0), 1.12), "steel"))
    return pieces


def clevis(rng: np.random.Generator) -> list[Piece]:
    """Draw the fork that holds the jaws: two cheeks, a pin, and the pulleys of a wristed tool."""
    long, apart = rng.uniform(0.7, 1.4), rng.uniform(0.5, 0.75)
    cheeks = boxes(np.array([[-long, 0, apart], [-long, 0, -apart]]), np.array([[long, 0.7, 0.14]] * 2))
    pieces = [Piece(cheeks, "steel"), Piece(straight((-1.7 * long, 0, -0.95), (-1.7 * long, 0, 0.95), 0.28), "steel")]
    for z in np.linspace(-0.3, 0.3, int(rng.integers(2, 5))):
        pulley = straight((-1.2 * long, 0, z - 0.05), (-1.2 * long, 0, z + 0.05), rng.uniform(0.4, 0.75))
        pieces.append(Piece(pulley, str(rng.choice(["steel", "gold", "dark"]))))
    return pieces


def grasper(rng: np.random.Generator) -> list[Piece]:
    """Draw two toothed jaws."""
    length, opening, count = rng.uniform(3.0, 8.0), rng.uniform(0.02, 0.45), int(rng.integers(6, 18))
    wide, thick = rng.uniform(0.3, 0.75), rng.uniform(0.18, 0.4)
    pieces = []
    for sign in (-1.0, 1.0):
        jaw = boxes(np.array([[-0.5 * length, sign * thick, 0]]), np.array([[0.5 * length, thick, wide]]))
        jaw = _tapered(jaw, length, rng.uniform(0.2, 0.7))
        centres = np.zeros((count, 3))
        centres[:, 0] = -length * np.linspace(0.15, 0.95, count)
        teeth = _tapered(boxes(centres, np.array([[0.25 * length / count, 0.1, 0.9 * wide]] * count)), length, 0.5)
        turn = about(2, -sign * opening)
        pieces += [Piece(p, "steel").moved(turn, np.array([-1.4, 0, 0])) for p in (jaw, teeth)]
    return pieces


def fenestrated(rng: np.random.Generator) -> list[Piece]:
    """Draw two jaws that are loops of bar."""
    length, opening, wide = rng.uniform(3.5, 8.0), rng.uniform(0.05, 0.5), rng.uniform(0.35, 0.8)
    t = np.linspace(0, 2 * np.pi, 40)
    loop = np.stack([-0.5 * length * (1 - np.cos(t)), np.zeros_like(t), wide * np.sin(t) * (1.2 + 0.2 * np.cos(t))], -1)
    ring = sweep(loop[None], np.full((1, 40), rng.uniform(0.12, 0.25)), 10)
    return [Piece(ring, "steel").moved(about(2, -s * opening), np.array([-1.3, 0.1 * s, 0])) for s in (-1.0, 1.0)]


def scissors(rng: np.random.Generator) -> list[Piece]:
    """Draw two thin blades, bent to one side."""
    length, opening, bend = rng.uniform(3.0, 6.5), rng.uniform(0.05, 0.5), rng.uniform(-0.08, 0.08)
    pieces = []
    for sign in (-1.0, 1.0):
        blade = boxes(np.array([[-0.5 * length, 0, 0.12 * sign]]), np.array([[0.5 * length, 0.4, 0.1]]))
        points = _tapered(blade, length, 0.85).points.copy()
        points[..., 2] += bend * points[..., 0] ** 2
        pieces.append(Piece(blade.moved(points), "steel").moved(about(2, sign * opening), np.array([-1.3, 0, 0])))
    return pieces


def hook(rng: np.random.Generator) -> list[Piece]:
    """Draw a cautery hook or spatula behind its insulator."""
    long, across = rng.uniform(3.0, 7.0), rng.uniform(0.6, 2.0)
    corner = np.array([[0, 0, 0], [-long, 0, 0], [-long - 0.4, 0.2, 0], [-long - 0.5, across, 0]])
    t = np.linspace(0, 3, 30)
    way = np.stack([np.interp(t, np.arange(4), corner[:, k]) for k in range(3)], -1)
    tip = line(way, rng.uniform(0.15, 0.4))
    return [
        Piece(tip, "steel"),
        Piece(straight((0.5, 0, 0), (-0.4 * long, 0, 0), 0.7), str(rng.choice(["white", "dark"]))),
    ]


def suction(rng: np.random.Generator) -> list[Piece]:
    """Draw a blunt tube."""
    long = rng.uniform(2.0, 9.0)
    return [
        Piece(straight((1, 0, 0), (-long, 0, 0), rng.uniform(0.7, 1.0)), str(rng.choice(["steel", "plastic", "dark"])))
    ]


def stapler(rng: np.random.Generator) -> list[Piece]:
    """Draw two long jaws with rows of equal pockets."""
    length, opening, count = rng.uniform(7.0, 14.0), rng.uniform(0.0, 0.35), int(rng.integers(12, 26))
    pieces = []
    for sign, material in ((-1.0, "steel"), (1.0, str(rng.choice(["white", "plastic", "steel"])))):
        jaw = boxes(np.array([[-0.5 * length, 0.5 * sign, 0]]), np.array([[0.5 * length, 0.4, 0.85]]))
        turn = about(2, -sign * opening)
        pieces.append(Piece(_tapered(jaw, length, 0.2), material).moved(turn, np.array([-0.6, 0, 0])))
        for z in (-0.45, 0.0, 0.45):
            centres = np.zeros((count, 3))
            centres[:, 0], centres[:, 1], centres[:, 2] = -length * np.linspace(0.08, 0.92, count), 0.93 * sign, z
            pockets = boxes(centres, np.array([[0.3 * length / count, 0.05, 0.1]] * count))
            pieces.append(Piece(pockets, "dark").moved(turn, np.array([-0.6, 0, 0])))
    return pieces


ENDS: dict[str, tuple[float, Callable[[np.random.Generator], list[Piece]]]] = {
    "grasper": (0.32, grasper),
    "fenestrated": (0.18, fenestrated),
    "scissors": (0.15, scissors),
    "hook": (0.12, hook),
    "suction": (0.1, suction),
    "stapler": (0.13, stapler),
}


def instrument(rng: np.random.Generator) -> tuple[str, list[Piece]]:
    """Draw the name of an instrument and its parts; two in three can bend at the wrist."""
    names = list(ENDS)
    name = names[int(rng.choice(len(names), p=[share for share, _ in ENDS.values()]))]
    end = ENDS[name][1](rng)
    if name in ("grasper", "fenestrated", "scissors"):
        end += clevis(rng)
    bend = np.eye(3)
    if rng.random() < 0.67:
        bend = about(1, rng.uniform(-1.0, 1.0)) @ about(2, rng.uniform(-0.8, 0.8))
    spin = about(0, rng.uniform(0, 2 * np.pi))
    return name, [part.moved(spin @ bend, np.zeros(3)) for part in end] + shaft(rng)


def needle(rng: np.random.Generator) -> list[Piece]:
    """Draw a curved needle of radius 1 with its thread."""
    arc = np.linspace(0, rng.uniform(0.8, 1.3) * np.pi, 40)
    points = np.stack([np.cos(arc), np.sin(arc), np.zeros_like(arc)], -1)
    steel = line(points, 0.05 * np.clip(np.linspace(0.1, 4, 40), 0, 1))
    return [Piece(steel, "steel"), Piece(thread(rng, points[-1], rng.uniform(0.02, 0.04)), _thread_colour(rng))]


def thread(rng: np.random.Generator, start: Floats, radius: float) -> Patches:
    """Draw a thread that wanders off from a point."""
    steps = rng.normal(0, 1.0, (7, 3)) * np.array([1.0, 1.0, 0.3])
    control = start + np.concatenate([np.zeros((1, 3)), np.cumsum(steps, 0)])
    t = np.linspace(0, len(control) - 1, 120)
    way = np.stack([np.interp(t, np.arange(len(control)), control[:, k]) for k in range(3)], -1)
    window = np.hanning(25) / np.hanning(25).sum()
    padded = np.concatenate([np.repeat(way[:1], 12, 0), way, np.repeat(way[-1:], 12, 0)])
    smooth = np.stack([np.convolve(padded[:, k], window, "valid") for k in range(3)], -1)
    return line(smooth, radius, 6)


def _thread_colour(rng: np.random.Generator) -> str:
    return str(rng.choice(["violet", "dark", "white", "plastic"]))


def clips(rng: np.random.Generator) -> list[Piece]:
    """Draw two to six equal clips side by side."""
    count, long = int(rng.integers(2, 7)), rng.uniform(0.5, 1.0)
    bar = np.array([[-long, 0.18, 0], [0, 0.2, 0], [0.12, 0, 0], [0, -0.2, 0], [-long, -0.18, 0]])
    t = np.linspace(0, 4, 30)
    way = np.stack([np.interp(t, np.arange(5), bar[:, k]) for k in range(3)], -1)
    material = str(rng.choice(["steel", "white", "plastic"]))
    pieces = []
    for k in range(count):
        turn = about(2, rng.normal(0, 0.25)) @ about(1, rng.normal(0, 0.25))
        pieces.append(Piece(line(way, 0.08), material).moved(turn, np.array([0, (k - 0.5 * count) * 0.6, 0])))
    return pieces


def trocar(rng: np.random.Generator) -> list[Piece]:
    """Draw the edge of a tube of radius 1, seen from inside it."""
    t = np.linspace(0, 2 * np.pi, 90)
    ring = np.stack([np.cos(t), np.sin(t), np.zeros_like(t)], -1)
    edge = sweep(ring[None], np.full((1, 90), rng.uniform(0.03, 0.1)), 12)
    return [Piece(edge, str(rng.choice(["steel", "white", "dark", "plastic"])))]


def _tapered(patches: Patches, length: float, share: float) -> Patches:
    """Narrow what lies towards -x by up to ``share``."""
    points = patches.points.copy()
    points[..., 1:] *= (1.0 - share * np.clip(-points[..., 0] / length, 0, 1))[..., None]
    return patches.moved(points)
