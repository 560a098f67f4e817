"""A tool in the picture: a shaft, a collar and two jaws, placed in front of the tissue that a pose sees."""

from __future__ import annotations

import numpy as np

from endosdk.simulation.camera import Pose, View
from endosdk.simulation.curve import Floats
from endosdk.simulation.noise import Array
from endosdk.simulation.organs import Part
from endosdk.simulation.scene import Instrument
from endosdk.simulation.shapes import Rod, Vector
from endosdk.simulation.tissue import Tissue


def instrument_parts(tool: Instrument, depth: Array, view: View, pose: Pose) -> tuple[Part, ...]:
    """Return the tool's surfaces in organ coordinates; ``depth`` [H,W] is what this view sees without the tool."""
    column = int(tool.tip[0] * (view.width - 1))
    row = int(tool.tip[1] * (view.height - 1))
    around = depth[max(0, row - 6) : row + 7, max(0, column - 6) : column + 7]
    far = float(around.min()) * tool.hover
    sight = np.linalg.inv(view.matrix)
    tip = sight @ np.array([column, row, 1.0]) * far
    out = _clear_way(tool, depth, view, tip)
    axis = out / np.linalg.norm(out)
    radius = tool.radius * far
    side = np.cross(axis, np.array([0.0, 0.0, 1.0]))
    side /= np.linalg.norm(side)
    wrist = tip + axis * 4.0 * radius
    collar = wrist + axis * 3.5 * radius
    pieces: list[tuple[Floats, Floats, float, float, Tissue]] = [
        (collar - axis * 0.3 * radius, tip + out, radius, radius, tool.shaft),
        (wrist, collar, 0.8 * radius, radius * 0.97, tool.steel),
    ]
    for sign in (-1.0, 1.0):
        spread = np.tan(0.5 * tool.jaw) * sign * 4.0 * radius
        point = tip + side * (spread + 0.18 * sign * radius)
        pieces.append((point, wrist + axis * 0.4 * radius, 0.22 * radius, 0.5 * radius, tool.steel))
    parts = []
    for number, (start, stop, first, last, tissue) in enumerate(pieces):
        rod = Rod(_world(start, pose), _world(stop, pose), first, last)
        parts.append(Part(rod, tissue, number, 256))
    return tuple(parts)


def _clear_way(tool: Instrument, depth: Array, view: View, tip: Floats) -> Floats:
    """Return the way from the tip out of the picture, bent towards the camera until no tissue is in it."""
    seen = view.matrix @ tip / tip[2]
    direction = np.array([np.cos(tool.angle), np.sin(tool.angle)])
    # Where the shaft leaves the picture: at the first border that its direction reaches.
    borders = np.where(direction > 0, (view.width, view.height), 0.0) - seen[:2]
    edge = np.append(seen[:2] + direction * (borders / np.where(direction == 0, 1e-9, direction)).min(), 1.0)
    steps = np.linspace(0.05, 0.95, 40)[:, None]
    for approach in np.arange(tool.approach, 0.9, 0.05):
        out = np.linalg.inv(view.matrix) @ edge * (1.0 - approach) * tip[2] - tip
        way = tip + steps * out
        columns, rows = (way[:, :2] / way[:, 2:] @ view.matrix[:2, :2].T + view.matrix[:2, 2]).astype(int).T
        if (way[:, 2] < 0.93 * depth[np.clip(rows, 0, view.height - 1), np.clip(columns, 0, view.width - 1)]).all():
            break
    return np.asarray(out * 1.25)


def _world(point: Floats, pose: Pose) -> Vector:
    x, y, z = (float(v) for v in pose.position + pose.axes.T @ point)
    return (x, y, z)
