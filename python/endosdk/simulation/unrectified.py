"""Pairs as a real rig takes them: distorted, slightly turned, with the calibration that undoes both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endosdk.calibration.rig import StereoCalibration
from endosdk.datasets.dataset import Sample
from endosdk.simulation.camera import Pose, RectifiedPair, StereoCamera, View, aligned_pair
from endosdk.simulation.curve import Floats
from endosdk.simulation.effects import Effects, affected, subsample_chroma, turning
from endosdk.simulation.noise import Array
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.sample import (
    NO_EFFECTS,
    DisparityLimits,
    Placed,
    draw_light,
    draw_pair,
    load_scene,
    place_camera,
)
from endosdk.simulation.scene import draw_scene
from endosdk.simulation.sensor import expose

# How far a rig strays from the ideal one.
FOCAL_SHARE = (0.94, 1.04)  # raw focal length against the ideal one
FOCAL_DIFFERENCE = 0.012  # deviation between the two lenses, as a share
CENTRE_PX = 9.0  # deviation of the principal point, at 960 px width
TURN_DEGREES = 0.6  # deviation of each angle between the cameras
SHIFT_SHARE = 0.03  # deviation of the right camera's place, as a share of the baseline
BARREL = (-0.20, -0.08)  # k1; k2 keeps the lens one-to-one out to the corners
SHARPNESS = 1.3  # resolution of the undistorted picture that is warped, against the raw one


@dataclass(frozen=True)
class RawViews:
    """What the two chips saw, RGB uint8 [H,W,3], and the calibration of their rig."""

    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    calibration: StereoCalibration


def draw_rig(seed: int, camera: StereoCamera) -> StereoCalibration:
    """Draw a misaligned rig with distorting lenses around the ideal one."""
    rng = np.random.default_rng((seed, 8))
    focal = camera.focal_px * rng.uniform(*FOCAL_SHARE)
    matrices, lenses = [], []
    for _ in range(2):
        own = focal * (1.0 + rng.normal(0, FOCAL_DIFFERENCE))
        centre = (np.array([camera.width, camera.height]) - 1) / 2 + rng.normal(0, CENTRE_PX * camera.width / 960, 2)
        matrices.append(np.array([[own, 0, centre[0]], [0, own * rng.uniform(0.995, 1.005), centre[1]], [0, 0, 1.0]]))
        barrel = rng.uniform(*BARREL)
        lenses.append(np.array([barrel, 0.22 * barrel * barrel + 0.025, *rng.normal(0, 8e-4, 2), 0.0]))
    axis = rng.normal(0, np.radians(TURN_DEGREES), 3)
    shift = camera.baseline_mm * (np.array([-1.0, 0.0, 0.0]) + rng.normal(0, SHIFT_SHARE, 3))
    return StereoCalibration(
        camera.width, camera.height, matrices[0], matrices[1], lenses[0], lenses[1], _turn(axis), shift
    )


def _turn(axis: Floats) -> Floats:
    import cv2

    return np.asarray(cv2.Rodrigues(axis)[0], np.float64)


def render_raw_sample(
    renderer: Renderer,
    rig: StereoCalibration,
    seed: int,
    organ: str,
    limits: DisparityLimits,
    effects: Effects = NO_EFFECTS,
) -> tuple[Sample, RawViews]:
    """Render what a rig sees of the seed's scene, and the sample in its rectified frame, with the truth.

    The sample's own pictures are drawn in that frame directly, without the lens, so they are what perfect
    rectification would give.
    """
    geometry = rig.rectification()
    pair = aligned_pair(geometry.P1[:, :3], geometry.width, geometry.height, geometry.baseline_mm)
    camera = StereoCamera(geometry.width, geometry.height, geometry.focal_px, geometry.baseline_mm)
    scene = affected(draw_scene(seed, organ), effects)
    load_scene(renderer, scene, camera)
    placed = place_camera(renderer, scene, camera, limits)
    instants = turning(placed.pose, effects.motion_px, camera.focal_px, seed)
    placed, sample = draw_pair(renderer, placed, pair, limits, effects, instants)
    # The rig's frame is the rectified left camera's; a raw camera is that one, or its neighbour, turned back.
    apart = np.array([-geometry.baseline_mm, 0.0, 0.0])
    raw = [
        _through_lens(renderer, placed, pair, instants, matrix, lens, turn.T, turn.T @ shift, (rig.width, rig.height))
        for matrix, lens, turn, shift in (
            (rig.left_matrix, rig.left_distortion, geometry.R1, np.zeros(3)),
            (rig.right_matrix, rig.right_distortion, geometry.R2, apart),
        )
    ]
    renderer.clear()
    left, right = expose(raw[0], raw[1], scene.sensor, (seed, 9))
    if effects.chroma:
        left, right = subsample_chroma(left), subsample_chroma(right)
    return sample, RawViews(left, right, rig)


def _through_lens(
    renderer: Renderer,
    placed: Placed,
    pair: RectifiedPair,
    instants: tuple[Pose, ...],
    matrix: Floats,
    lens: Floats,
    rotation: Floats,
    translation: Floats,
    size: tuple[int, int],
) -> Array:
    """Return the linear light [H,W,3] behind a distorting lens, warped from an undistorted view that covers it."""
    import cv2

    columns, rows = np.meshgrid(np.arange(size[0], dtype=np.float64), np.arange(size[1], dtype=np.float64))
    rays = straight_rays(np.stack([columns.ravel(), rows.ravel()], 1), matrix, lens)
    low, high = rays.min(0), rays.max(0)
    focal = SHARPNESS * matrix[0, 0]
    width, height = (int(np.ceil(focal * (high[k] - low[k]))) + 5 for k in range(2))
    wide = np.array([[focal, 0, 2.0 - focal * low[0]], [0, focal, 2.0 - focal * low[1]], [0, 0, 1.0]])
    view = View(wide, width, height, rotation, translation)
    disparity = pair.disparity(renderer.depth(view, placed.pose, placed.scale))
    light = draw_light(renderer, view, placed, pair, disparity, instants)
    places = (rays * focal + wide[:2, 2]).astype(np.float32).reshape(size[1], size[0], 2)
    warped = cv2.remap(light, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, np.float32)


def straight_rays(pixels: Floats, matrix: Floats, lens: Floats) -> Floats:
    """Return x/z and y/z [N,2] of the rays that a lens bends onto pixels [N,2], exact to 1e-4 px."""
    import cv2

    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-12)
    rays = cv2.undistortPoints(pixels[:, None], matrix, lens, R=None, P=None, criteria=criteria)
    return np.asarray(rays, np.float64)[:, 0]
