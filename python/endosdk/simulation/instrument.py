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
    direction = np.array([np.cos(tool.angle), np.sin(tool.angle), 0.0])
    # Long enough to leave the picture whatever the angle.
    out = direction * 1.7 * view.width / view.matrix[0, 0] * tip[2]
    steps = np.linspace(0.05, 1.0, 60)[:, None]
    for approach in np.arange(tool.approach, 0.8, 0.05):
        out[2] = -approach * tip[2]
        way = tip + steps * out
        places = way @ view.matrix.T
        columns, rows = np.round(places[:, :2] / places[:, 2:]).astype(int).T
        seen = (columns >= 0) & (columns < view.width) & (rows >= 0) & (rows < view.height)
        if (way[seen, 2] < 0.95 * depth[rows[seen], columns[seen]]).all():
            break
    return np.asarray(out)


def _world(point: Floats, pose: Pose) -> Vector:
    x, y, z = (float(v) for v in pose.position + pose.axes.T @ point)
    return (x, y, z)
