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
    direction = np.array([np.cos(tool.angle), np.sin(tool.angle), 0.0])
    # Long enough to leave the picture whatever the angle.
    length = 1.7 * view.width / view.matrix[0, 0] * far
    out = direction * length
    out[2] = -tool.approach * far
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


def _world(point: Floats, pose: Pose) -> Vector:
    x, y, z = (float(v) for v in pose.position + pose.axes.T @ point)
    return (x, y, z)
