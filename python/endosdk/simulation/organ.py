"""One finished pair of an organ as a drawn rig sees it, with instruments near the lens in scenes of surgery."""

from __future__ import annotations

from dataclasses import asdict, replace
from functools import lru_cache
from typing import Any

import numpy as np

from endosdk.datasets.dataset import Sample
from endosdk.simulation.effects import Effects, affected, turning
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.sample import DisparityLimits, build_parts, draw_pair, paint_part, place_camera
from endosdk.simulation.scene import LAP, Scene, draw_scene
from endosdk.simulation.texture import TissueTexture
from endosdk.simulation.tissue import Tissue
from endosdk.simulation.tools.place import BareView, draw_tools, into_organ

# So many neighbouring seeds look at one organ, with all else their own: to paint it takes as long as to draw it.
SHARED_BY = 3


def render_organ(renderer: Renderer, seed: int, organ: str, rig: SceneRig, effects: Effects, clean: bool) -> Sample:
    """Render the organ of this seed at the range of a rig; ``clean`` chips add no noise and do not compress.

    The mixture `LAP` stands instruments before the organ, up to the nearest that the rig may show.
    """
    scene = _scene(seed, organ, effects, clean)
    renderer.clear()
    for surface in _surfaces(seed - seed % SHARED_BY, organ, effects, rig.camera.width):
        renderer.add(*surface)
    placed = place_camera(
        renderer, scene, rig.camera, DisparityLimits(min(rig.farthest, 0.25 * rig.nearest), rig.nearest)
    )
    pair = rig.pair()
    described: dict[str, Any] = {}
    if organ == LAP:
        before = BareView(rig, renderer.depth(pair.left, placed.pose, placed.scale), placed.reach)
        found, described = draw_tools(np.random.default_rng((seed, 18)), before)
        for surface in found:
            renderer.add(*into_organ(surface, placed.pose, placed.scale))
    instants = turning(placed.pose, effects.motion_px, rig.camera.focal_px, seed)
    _, sample = draw_pair(renderer, placed, pair, DisparityLimits(0.25 * rig.limit, rig.limit), effects, instants)
    renderer.clear()
    return replace(sample, info={**sample.info, **described, "rig": asdict(rig)})


def _scene(seed: int, organ: str, effects: Effects, clean: bool) -> Scene:
    """Draw the scene of this seed: its organ is that of the first seed that looks at it."""
    own, shared = (affected(draw_scene(one, organ), effects) for one in (seed, seed - seed % SHARED_BY))
    scene = replace(own, organ=shared.organ, parts=shared.parts, path=shared.path, nearest_share=1.0)
    if organ == LAP:
        scene = replace(scene, instrument=None)
    if clean:
        scene = replace(scene, sensor=replace(scene.sensor, noise=0.0, shot_noise=0.0, jpeg_quality=0))
    return scene


@lru_cache(maxsize=1)
def _surfaces(seed: int, organ: str, effects: Effects, width: int) -> list[tuple[Mesh, Tissue, TissueTexture]]:
    """Build and paint the organ of a seed."""
    parts = affected(draw_scene(seed, organ), effects).parts
    return [(mesh, part.tissue, paint_part(part, mesh, width)) for part, mesh in build_parts(parts)]
