"""The field of view: a circle, an octagon, rounded corners or bars, not the same in both eyes, and text beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.noise import Array

SHAPES = ("circle", "octagon", "rounded", "bars")
DARK_LEVELS = (2.0, 12.0)  # grey levels outside
WORDS = (
    "REC",
    "00:41:07",
    "ZOOM 1.2x",
    "L",
    "R",
    "CAM 2",
    "30",
    "LIGHT 80%",
    "2D/3D",
    "PAT 0417",
    "AUTO",
    "NBI",
    "ICG",
)


@dataclass(frozen=True)
class Field:
    """The field of view of one eye; places and sizes as shares of the width."""

    shape: str  # one of `SHAPES`
    x: float  # of its middle
    y: float
    across: float  # half its width
    down: float  # half its height
    level: float  # grey level outside
    noise: float  # grey levels outside


@dataclass(frozen=True)
class Label:
    """A line of text over the picture of one eye or of both, in a box without truth."""

    text: str
    x: float
    y: float
    size: float  # height of a capital
    level: float  # its grey level
    eyes: tuple[int, ...]


def draw_fields(rng: np.random.Generator, aspect: float) -> tuple[Field, Field]:
    """Draw the fields of both eyes; ``aspect`` is height over width."""
    shape = str(rng.choice(SHAPES, p=(0.4, 0.2, 0.2, 0.2)))
    if shape in ("circle", "octagon"):
        across = float(rng.uniform(0.36, 0.6))
        down = across
    else:
        across = float(rng.uniform(0.4, 0.5))
        down = aspect * float(rng.uniform(0.42, 0.5))
    level = float(rng.uniform(*DARK_LEVELS))
    fields = []
    for _ in range(2):
        move = rng.normal(0, 0.012, 2)
        grow = float(np.exp(rng.normal(0, 0.012)))
        fields.append(
            Field(
                shape, 0.5 + float(move[0]), 0.5 * aspect + float(move[1]), across * grow, down * grow,
                float(np.clip(level + rng.normal(0, 1.0), *DARK_LEVELS)), float(rng.uniform(0.4, 3.5)),
            )
        )  # fmt: skip
    return fields[0], fields[1]


def draw_labels(rng: np.random.Generator, aspect: float) -> tuple[Label, ...]:
    """Draw one to four lines of text near the corners."""
    labels = []
    for _ in range(int(rng.integers(1, 5))):
        eyes = ((0, 1), (0, 1), (0,), (1,))[int(rng.integers(4))]
        labels.append(
            Label(
                str(rng.choice(WORDS)), float(rng.choice([0.02, 0.8]) + rng.uniform(0, 0.05)),
                float(aspect * rng.choice([0.07, 0.93]) + rng.uniform(-0.02, 0.02)), float(rng.uniform(0.02, 0.04)),
                float(rng.uniform(120, 255)), eyes,
            )
        )  # fmt: skip
    return tuple(labels)


def inside(field: Field, size: tuple[int, int]) -> Array:
    """Return how much of each pixel [H,W] lies in the field, 0..1, with an edge about two pixels wide."""
    height, width = size
    rows, columns = np.indices((height, width), np.float32)
    x = np.abs(columns + 0.5 - field.x * width)
    y = np.abs(rows + 0.5 - field.y * width)
    across, down = field.across * width, field.down * width
    if field.shape == "circle":
        deep = across - np.hypot(x, y)
    elif field.shape == "octagon":
        deep = across - np.maximum(np.maximum(x, y), (x + y) * np.sqrt(0.5))
    elif field.shape == "rounded":
        corner = 0.35 * min(across, down)
        beyond = np.hypot(np.maximum(x - across + corner, 0), np.maximum(y - down + corner, 0))
        deep = np.where(beyond > 0, corner - beyond, np.minimum(across - x, down - y))
    else:
        deep = np.minimum(across - x, down - y)
    return np.asarray(np.clip(0.5 * deep + 0.5, 0.0, 1.0), np.float32)


def darken_outside(view: Array, field: Field, weight: Array, rng: np.random.Generator) -> Array:
    """Put the noisy dark around a view [H,W,3] whose pixels lie inside by ``weight`` [H,W]."""
    dark = field.level + field.noise * rng.standard_normal(view.shape, dtype=np.float32)
    return np.asarray(dark + (view - dark) * weight[..., None], np.float32)


def write_label(view: Array, label: Label) -> NDArray[np.bool_]:
    """Write a label into a view [H,W,3], in place; return the box [H,W] that it covers."""
    import cv2

    height, width = view.shape[:2]
    scale = label.size * width / 21.0  # a capital of this font is 21 px tall
    stroke = max(1, round(0.6 * scale))
    (wide, tall), below = cv2.getTextSize(label.text, cv2.FONT_HERSHEY_SIMPLEX, scale, stroke)
    at = (round(label.x * width), round(label.y * width))
    ink = np.zeros((height, width), np.uint8)
    cv2.putText(ink, label.text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, 255, stroke, cv2.LINE_AA)
    view += (label.level - view) * (ink[..., None] / np.float32(255.0))
    box = np.zeros((height, width), np.bool_)
    box[max(0, at[1] - tall - 2) : max(0, at[1] + below + 2), max(0, at[0] - 2) : at[0] + wide + 2] = True
    return box
