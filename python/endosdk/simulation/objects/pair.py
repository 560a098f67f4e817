"""Make a finished pair of objects from a seed, with exact truth for both views."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from endosdk.datasets.dataset import Sample, find_occlusion
from endosdk.simulation.camera import Pose, RectifiedPair, View
from endosdk.simulation.noise import Array
from endosdk.simulation.objects.arrangement import draw_lamp, draw_objects
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.sensor import draw_sensor, expose

HERE = Pose(np.zeros(3), np.eye(3))


def render_objects(renderer: Renderer, seed: int, rig: SceneRig) -> Sample:
    """Render the objects of this seed as a rig sees them; nothing is nearer than the rig's nearest."""
    rng = np.random.default_rng((seed, 20))
    renderer.clear()
    found, described = draw_objects(rng, rig)
    for surface in found:
        renderer.add(*surface)
    lamp = draw_lamp(rng)
    sensor = replace(draw_sensor(rng), noise=0.0, shot_noise=0.0, jpeg_quality=0)
    pair = rig.pair()
    scale, (left, right) = _truth(renderer, pair, rig.nearest)
    reach = rig.camera.depth_of(float(np.nanmedian(left)))
    middle = (0.5 * rig.camera.baseline_mm, 0.0, 0.0)
    light = [renderer.colour(view, HERE, scale, lamp, middle, reach) for view in (pair.left, pair.right)]
    renderer.clear()
    views = expose(light[0], light[1], sensor, (seed, 21))
    scene = {**described, "scale": scale, "lamp": asdict(lamp), "sensor": asdict(sensor)}
    return Sample(
        id=f"{seed:09d}",
        left=views[0],
        right=views[1],
        disparity=left,
        disparity_right=right,
        occlusion=find_occlusion(left, right),
        focal_px=pair.focal_px,
        baseline_mm=pair.baseline_mm,
        info={"seed": seed, "organ": "shapes", "renderer": renderer.version, "scene": scene, "rig": asdict(rig)},
    )


def _truth(renderer: Renderer, pair: RectifiedPair, largest: float) -> tuple[float, tuple[Array, Array]]:
    """Return the scale at which nothing is nearer than allowed, and both true disparities."""
    scale = 1.0

    def seen(view: View) -> Array:
        return pair.disparity(renderer.depth(view, HERE, scale))

    while True:
        left, right = seen(pair.left), seen(pair.right)
        excess = float(max(np.nanmax(left), np.nanmax(right))) / largest
        if excess <= 1.0:
            return scale, (left, right)
        scale *= 1.002 * excess
