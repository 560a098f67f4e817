"""Which surfaces make an organ, and the path of the camera in it; every range of shape is here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from endosdk.simulation.curve import bezier
from endosdk.simulation.shapes import Blob, Shape, Tube, Vector
from endosdk.simulation.tissue import Tissue, draw_tissue


@dataclass(frozen=True)
class Part:
    """One surface of a scene."""

    shape: Shape
    tissue: Tissue
    seed: int
    texture_px: int = 1536


@dataclass(frozen=True)
class Path:
    """The camera's Bézier path and how freely it looks around."""

    control: tuple[Vector, ...]
    span: tuple[float, float]  # stretch of the path that is used
    look_ahead: float
    wander: float  # mm off the path
    jitter: float  # of the target, as a share of its distance
    target: Vector | None = None  # None: look along the path
    roll: bool = True


def _part(rng: np.random.Generator, shape: Shape, kind: str, texture_px: int = 1536) -> Part:
    return Part(shape, draw_tissue(rng, kind), int(rng.integers(2**31)), texture_px)


def _vector(values: np.ndarray) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _bent_path(rng: np.random.Generator, length: float, bend: float) -> tuple[Vector, ...]:
    """Control points of a path along z that leaves the axis more the further it goes."""
    steps = np.linspace(0.0, 1.0, 5)
    aside = np.cumsum(rng.normal(0, bend, (5, 2)) * steps[:, None], 0) * length
    aside[:2] = 0.0
    return tuple(_vector(np.array([x, y, length * t])) for (x, y), t in zip(aside, steps, strict=True))


def _polyps(rng: np.random.Generator, control: tuple[Vector, ...], radius: float) -> list[Part]:
    parts = []
    for _ in range(int(rng.choice([0, 1, 2, 3], p=[0.5, 0.25, 0.15, 0.1]))):
        here, ahead = bezier(np.asarray(control), np.array([t := rng.uniform(0.3, 0.7), t + 0.01]))
        axis = (ahead - here) / np.linalg.norm(ahead - here)
        aside = np.cross(axis, rng.normal(size=3))
        aside /= np.linalg.norm(aside)
        size = radius * rng.uniform(0.1, 0.28)
        blob = Blob(
            centre=_vector(here + aside * radius * rng.uniform(0.8, 0.95)),
            axes=(size * rng.uniform(0.7, 1.1), size * rng.uniform(0.7, 1.1), size * rng.uniform(0.8, 1.5)),
            pole=_vector(-aside), inside=False, waves=0.25, wave_mm=size * 1.4, fine=0.04,
        )  # fmt: skip
        parts.append(_part(rng, blob, "colon", 512))
    return parts


def draw_intestine(rng: np.random.Generator) -> tuple[tuple[Part, ...], Path]:
    """Draw a stretch of colon, or (with dense folds all around) of small bowel."""
    radius = float(rng.uniform(22, 34))
    small = bool(rng.random() < 0.25)
    control = _bent_path(rng, radius * float(rng.uniform(7, 10)), float(rng.uniform(0.03, 0.16)))
    wall = Tube(
        control=control,
        radius=radius,
        inside=True,
        fold_spacing=radius * float(rng.uniform(0.2, 0.4) if small else rng.uniform(0.7, 1.5)),
        fold_height=float(rng.uniform(0.08, 0.2) if small else rng.uniform(0.12, 0.5)),
        fold_width=radius * float(rng.uniform(0.05, 0.08) if small else rng.uniform(0.08, 0.18)),
        fold_lean=float(rng.uniform(-0.4, 0.4)),
        sectors=0 if small else 3,
        taeniae=0.0 if small else float(rng.uniform(0.0, 0.12)),
        swelling=float(rng.uniform(0.0, 0.18)),
        waves=float(rng.uniform(0.03, 0.12)),
        wave_mm=radius * float(rng.uniform(0.7, 1.8)),
    )
    aside = bool(rng.random() < 0.35)
    path = Path(
        control,
        (0.12, 0.55),
        look_ahead=float(rng.uniform(0.08, 0.2)),
        wander=0.4 * radius,
        jitter=0.7 if aside else 0.2,
    )
    return (_part(rng, wall, "colon"), *_polyps(rng, control, radius)), path


def draw_stomach(rng: np.random.Generator) -> tuple[tuple[Part, ...], Path]:
    """Draw a deformed closed lumen with folds that run towards its outlet."""
    width = float(rng.uniform(40, 60))
    axes = (width, width * float(rng.uniform(0.65, 1.0)), width * float(rng.uniform(1.0, 1.6)))
    wall = Blob(
        centre=(0.0, 0.0, 0.0),
        axes=axes,
        pole=(0.0, 0.0, 1.0),
        inside=True,
        waves=float(rng.uniform(0.1, 0.3)),
        wave_mm=width * float(rng.uniform(0.8, 1.6)),
        fine=float(rng.uniform(0.003, 0.02)),
        rugae=int(rng.integers(8, 22)) if rng.random() < 0.75 else 0,
        ruga_height=float(rng.uniform(0.03, 0.14)),
        ruga_width=float(rng.uniform(0.3, 0.6)),
        outlet=float(rng.uniform(0.1, 0.4)) if rng.random() < 0.6 else 0.0,
    )
    control = ((0.0, 0.0, -0.75 * axes[2]), (*(rng.normal(0, 6, 2).tolist()), 0.0), (0.0, 0.0, 0.6 * axes[2]))
    path = Path(
        tuple(_vector(np.asarray(c)) for c in control),
        (0.05, 0.5),
        look_ahead=0.4,
        wander=0.35 * width,
        jitter=float(rng.uniform(0.15, 0.6)),
    )
    return (_part(rng, wall, "gastric"),), path


def draw_ducts(rng: np.random.Generator) -> tuple[tuple[Part, ...], Path]:
    """Draw a narrow, smooth, bent duct with side branches."""
    radius = float(rng.uniform(9, 14))
    control = _bent_path(rng, radius * float(rng.uniform(9, 13)), float(rng.uniform(0.06, 0.2)))
    look_of_wall = draw_tissue(rng, "duct")
    shared = {"waves": float(rng.uniform(0.03, 0.1)), "wave_mm": radius * float(rng.uniform(0.8, 2.0))}
    folds = bool(rng.random() < 0.4)
    trunk = Tube(
        control=control, radius=radius, inside=True, sectors=0,
        fold_spacing=radius * float(rng.uniform(0.8, 1.6)) if folds else 0.0,
        fold_height=float(rng.uniform(0.05, 0.25)), fold_width=radius * float(rng.uniform(0.08, 0.25)),
        fold_lean=float(rng.uniform(-0.4, 0.4)), **shared,
    )  # fmt: skip
    parts = [Part(trunk, look_of_wall, int(rng.integers(2**31)))]
    for _ in range(int(rng.integers(1, 4))):
        t = float(rng.uniform(0.35, 0.75))
        here, ahead = bezier(np.asarray(control), np.array([t, t + 0.01]))
        axis = (ahead - here) / np.linalg.norm(ahead - here)
        aside = np.cross(axis, rng.normal(size=3))
        aside /= np.linalg.norm(aside)
        lean = float(rng.uniform(0.4, 1.1))
        out = np.cos(lean) * axis + np.sin(lean) * aside
        reach = radius * float(rng.uniform(4, 7))
        branch = Tube(
            control=tuple(_vector(here + out * reach * k + axis * 0.25 * reach * k * k) for k in (0.0, 0.5, 1.0)),
            radius=radius * float(rng.uniform(0.45, 0.8)), inside=True, sectors=0, **shared,
        )  # fmt: skip
        parts.append(Part(branch, look_of_wall, int(rng.integers(2**31)), 1024))
    path = Path(control, (0.12, 0.5), look_ahead=0.15, wander=0.3 * radius, jitter=float(rng.uniform(0.1, 0.4)))
    return tuple(parts), path


def draw_abdomen(rng: np.random.Generator) -> tuple[tuple[Part, ...], Path]:
    """Draw the belly through a laparoscope: a wall behind, organs in front, sometimes one that fills the view."""
    wall = Blob(
        centre=(0.0, 0.0, 60.0), axes=(130.0, 115.0, float(rng.uniform(80, 130))), pole=(0.0, 0.0, 1.0), inside=True,
        waves=float(rng.uniform(0.1, 0.35)), wave_mm=float(rng.uniform(60, 150)), fine=float(rng.uniform(0.001, 0.008)),
    )  # fmt: skip
    parts = [_part(rng, wall, str(rng.choice(["peritoneum", "fat", "muscle", "serosa"])))]
    if rng.random() < 0.5:
        parts.append(_filling_organ(rng))
    for _ in range(int(rng.integers(2, 8))):
        parts.append(_loop(rng) if rng.random() < 0.3 else _organ(rng))
    path = Path(
        control=((0.0, 0.0, -6.0), (4.0, -2.0, 2.0), (0.0, 0.0, 8.0)), span=(0.0, 1.0), look_ahead=0.1, wander=14.0,
        jitter=float(rng.uniform(0.05, 0.25)), target=(0.0, 0.0, 110.0),
    )  # fmt: skip
    return tuple(parts), path


def _filling_organ(rng: np.random.Generator) -> Part:
    size = rng.uniform(70, 130, 3)
    near = rng.uniform(60, 90)
    aside = rng.normal(0, 28, 2)
    centre = np.array([aside[0], aside[1], near + size[2]])
    blob = Blob(
        centre=_vector(centre), axes=_vector(size), pole=_vector(-centre + rng.normal(0, 20, 3)), inside=False,
        waves=float(rng.uniform(0.04, 0.16)), wave_mm=float(rng.uniform(50, 150)), fine=float(rng.uniform(5e-4, 6e-3)),
    )  # fmt: skip
    return _part(rng, blob, str(rng.choice(["serosa", "liver", "peritoneum", "fat", "spleen", "muscle"])))


def _organ(rng: np.random.Generator) -> Part:
    direction = np.array([rng.uniform(-1.2, 1.2), rng.uniform(-1.0, 1.0), 1.0])
    size = rng.uniform(28, 85) * rng.uniform(0.6, 1.4, 3)
    centre = direction * (rng.uniform(70, 140) + 0.7 * size.mean()) / np.linalg.norm(direction) * 1.15
    blob = Blob(
        centre=_vector(centre), axes=_vector(size), pole=_vector(-centre), inside=False,
        waves=float(rng.uniform(0.08, 0.4)), wave_mm=float(rng.uniform(1.2, 2.6) * size.mean()),
        fine=float(rng.uniform(5e-4, 6e-3)),
    )  # fmt: skip
    return _part(rng, blob, str(rng.choice(["serosa", "liver", "fat", "spleen", "peritoneum", "muscle"])), 832)


def _loop(rng: np.random.Generator) -> Part:
    """Draw a loop of bowel, seen from outside."""
    radius = float(rng.uniform(11, 22))
    depth = rng.uniform(95, 150)
    start = np.array([rng.uniform(-110, -40), rng.uniform(-60, 60), depth])
    stop = np.array([rng.uniform(40, 110), rng.uniform(-60, 60), depth + rng.uniform(-15, 30)])
    middle = [start + (stop - start) * k + rng.normal(0, 30, 3) * np.array([1.0, 1.0, 0.4]) for k in (0.3, 0.7)]
    tube = Tube(
        control=tuple(_vector(p) for p in (start, *middle, stop)), radius=radius, inside=False,
        waves=float(rng.uniform(0.03, 0.1)), wave_mm=radius * float(rng.uniform(0.8, 2.0)),
    )  # fmt: skip
    return _part(rng, tube, "serosa", 1024)


DRAW: dict[str, Callable[[np.random.Generator], tuple[tuple[Part, ...], Path]]] = {
    "intestine": draw_intestine,
    "stomach": draw_stomach,
    "ducts": draw_ducts,
    "abdomen": draw_abdomen,
}
