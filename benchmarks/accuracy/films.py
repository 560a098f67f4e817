"""Rendered films with truth: a scene that stands still, a flight, and a flight with an instrument that moves.

The truth knows motion too: where each frame's surfaces were in the frame before.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endosdk.simulation.camera import Pose, StereoCamera, rectified_pair
from endosdk.simulation.instrument import instrument_parts
from endosdk.simulation.meshes import build_mesh
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.sample import DisparityLimits, Placed, draw_light, load_scene, paint_part, smaller
from endosdk.simulation.scene import Scene, draw_scene
from endosdk.simulation.sensor import expose
from endosdk.simulation.stereo_video import place_flight

CAMERA = StereoCamera(width=640, height=480, focal_px=300.0, baseline_mm=5.0)
LIMITS = DisparityLimits(2.0, 60.0)
KINDS = ("still", "flight", "tool")
SWING = 0.2  # of the instrument, sideways, as a share of its distance
SWING_FRAMES = 25

Map = NDArray[np.float32]
Picture = NDArray[np.uint8]


@dataclass(frozen=True)
class FilmFrame:
    """One pair of a film with the truth of its left view; ``tool`` marks the instrument's pixels.

    ``before`` [H,W,3] is what the pixel's surface was in the frame before: x, y and disparity; NaN in a first frame.
    """

    left: Picture
    right: Picture
    disparity: Map
    tool: NDArray[np.bool_]
    before: Map


@dataclass(frozen=True)
class _Layer:
    """What one surface alone gives both views: disparity and light."""

    disparity: tuple[Map, Map]
    light: tuple[Map, Map]

    def under(self, other: _Layer) -> _Layer:
        """Both layers together: the nearer surface is seen."""
        nearer = [
            np.nan_to_num(b, nan=0.0) > np.nan_to_num(a, nan=0.0)
            for a, b in zip(self.disparity, other.disparity, strict=True)
        ]
        return _Layer(
            tuple(np.where(n, b, a) for n, a, b in zip(nearer, self.disparity, other.disparity, strict=True)),
            tuple(np.where(n[..., None], b, a) for n, a, b in zip(nearer, self.light, other.light, strict=True)),
        )


def film_seeds(first: int) -> Iterator[int]:
    """Yield the seeds of scenes that have an instrument."""
    seed = first
    while True:
        if draw_scene(seed, "mix").instrument is not None:
            yield seed
        seed += 1


def film(renderer: Renderer, kind: str, seed: int, frames: int) -> list[FilmFrame]:
    """Render a film of one of `KINDS`. Every frame has noise of its own."""
    scene = draw_scene(seed, "mix")
    load_scene(renderer, replace(scene, instrument=None), CAMERA)
    flight, scale, reach = place_flight(renderer, scene, CAMERA, LIMITS, frames)
    poses = [flight.pose(0 if kind == "still" else k) for k in range(frames)]
    layers = [_layer(renderer, scene, pose, scale, reach) for pose in (poses[:1] if kind == "still" else poses)]
    tools: list[_Layer] = []
    swings = [np.zeros(3)] * frames
    if kind == "tool":
        swings, tools = _tool_layers(renderer, scene, poses[0], scale, reach, frames)
    renderer.clear()
    shown = [_exposed(scene, layers[min(k, len(layers) - 1)], tools[k] if tools else None, k) for k in range(frames)]
    return [
        replace(one, before=frame_before(one, poses[k - 1 : k + 1], swings[k - 1 : k + 1], scale))
        for k, one in enumerate(shown)
    ]


def frame_before(frame: FilmFrame, poses: list[Pose], swings: list[NDArray[np.float64]], scale: float) -> Map:
    """Return where the frame's surfaces were, from the poses and the tool's places (organ mm) before and now."""
    if len(poses) < 2:  # a first frame
        return np.full((*frame.disparity.shape, 3), np.nan, np.float32)
    rays = np.linalg.inv(CAMERA.matrix) @ _pixels().reshape(3, -1)
    reach = CAMERA.focal_px * CAMERA.baseline_mm
    points = rays * (reach / scale / frame.disparity.astype(np.float64)).ravel()
    tissue = poses[0].axes @ (poses[1].axes.T @ points + (poses[1].position - poses[0].position)[:, None])
    seen = np.where(frame.tool.ravel(), points + (swings[0] - swings[1])[:, None], tissue)
    pixels = CAMERA.matrix @ (seen / seen[2])
    return (
        np.stack([pixels[0], pixels[1], reach / scale / seen[2]], axis=-1)
        .reshape(*frame.disparity.shape, 3)
        .astype(np.float32)
    )


def _pixels() -> NDArray[np.float64]:
    y, x = np.mgrid[: CAMERA.height, : CAMERA.width].astype(np.float64)
    return np.stack([x, y, np.ones_like(x)])


def _layer(renderer: Renderer, scene: Scene, pose: Pose, scale: float, reach: float) -> _Layer:
    pair = rectified_pair(CAMERA)
    views = (pair.left, pair.right)
    left, right = (pair.disparity(renderer.depth(view, pose, scale)) for view in views)
    placed = Placed(scene, pose, scale, reach)
    lights = [draw_light(renderer, v, placed, pair, d, (pose,)) for v, d in zip(views, (left, right), strict=True)]
    return _Layer((left, right), (lights[0], lights[1]))


def _tool_layers(
    renderer: Renderer, scene: Scene, pose: Pose, scale: float, reach: float, frames: int
) -> tuple[list[NDArray[np.float64]], list[_Layer]]:
    """The instrument alone, swinging before the camera: its places and what is seen. The tissue's depth places it."""
    assert scene.instrument is not None
    preview = rectified_pair(smaller(CAMERA)).left
    depth = renderer.depth(preview, pose, 1.0)
    parts = instrument_parts(scene.instrument, depth, preview, pose)
    renderer.clear()
    for part in parts:
        mesh = build_mesh(part.shape, (part.seed, 0))
        renderer.add(mesh, part.tissue, paint_part(part, mesh, CAMERA.width))
    away = float(np.median(depth)) * scene.instrument.hover
    across = np.array([np.sin(scene.instrument.angle), -np.cos(scene.instrument.angle), 0.0])
    swings = [SWING * away * np.sin(2 * np.pi * frame / SWING_FRAMES) * across for frame in range(frames)]
    moved = [replace(pose, position=pose.position - pose.axes.T @ swing) for swing in swings]
    return swings, [_layer(renderer, scene, each, scale, reach) for each in moved]


def _exposed(scene: Scene, tissue: _Layer, tool: _Layer | None, number: int) -> FilmFrame:
    seen = tissue if tool is None else tissue.under(tool)
    left, right = expose(*seen.light, scene.sensor, (scene.seed, 7, number))
    marked = np.asarray(seen.disparity[0] != tissue.disparity[0])
    return FilmFrame(left, right, seen.disparity[0], marked, np.full((*marked.shape, 3), np.nan, np.float32))
