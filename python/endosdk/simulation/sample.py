"""Make a finished stereo sample from a seed: build the scene, find a pose, draw both views, take the truth."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from endosdk.datasets.dataset import Sample, find_occlusion
from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import Pose, RectifiedPair, StereoCamera, View, rectified_pair
from endosdk.simulation.effects import Effects, affected, subsample_chroma, turning
from endosdk.simulation.instrument import instrument_parts
from endosdk.simulation.junction import join_lumens
from endosdk.simulation.meshes import Mesh, build_mesh
from endosdk.simulation.noise import Array
from endosdk.simulation.organs import Part
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.scene import Scene, candidate_poses, draw_scene
from endosdk.simulation.sensor import expose
from endosdk.simulation.shadow import near_shadow
from endosdk.simulation.texture import TissueTexture, paint_tissue

GENERATOR_VERSION = "3"
POSE_TRIALS = 8
PREVIEW_PX = 240
TEXTURED_FOR_PX = 960  # width of picture for which the sizes of textures are given
NO_EFFECTS = Effects()
MOST_DISPARITY = 250  # px; files hold up to 255.996
# A pose is refused when little of the picture is near, or when a fold right at the lens takes all the range.
CLOSE_SHARE, CLOSE_DISPARITY = 0.25, 0.33
LENS_SHARE, LENS_DISPARITY = 0.03, 0.85
TOOL_AT_LENS = 5.0  # so much nearer than the tissue, a tool would leave no disparity to anything else


@dataclass(frozen=True)
class DisparityLimits:
    """Disparities, in px, that a sample may hold."""

    smallest: float = 2.0
    largest: float = 69.5

    def __post_init__(self) -> None:
        if not (0 < self.smallest < self.largest <= MOST_DISPARITY):
            rule = f"disparities must satisfy 0 < smallest < largest <= {MOST_DISPARITY} px"
            raise InvalidArgument("limits", rule, (self.smallest, self.largest))
        if self.largest < 4 * self.smallest:
            raise InvalidArgument(
                "limits", "the largest disparity must be at least 4 times the smallest", (self.smallest, self.largest)
            )


@dataclass(frozen=True)
class Placed:
    """A scene whose camera has been placed: what remains is to draw it."""

    scene: Scene
    pose: Pose
    scale: float  # of the organ, about the left camera
    reach: float  # mm, typical distance; the lamp is set to it


def render_sample(
    renderer: Renderer,
    seed: int,
    organ: str,
    camera: StereoCamera,
    limits: DisparityLimits,
    effects: Effects = NO_EFFECTS,
) -> Sample:
    """Render the sample of this seed: a function of its arguments and of ``renderer.version`` alone."""
    scene = affected(draw_scene(seed, organ), effects)
    load_scene(renderer, scene, camera)
    placed = place_camera(renderer, scene, camera, limits)
    instants = turning(placed.pose, effects.motion_px, camera.focal_px, seed)
    _, sample = draw_pair(renderer, placed, rectified_pair(camera), limits, effects, instants)
    renderer.clear()
    return sample


def draw_pair(
    renderer: Renderer,
    placed: Placed,
    pair: RectifiedPair,
    limits: DisparityLimits,
    effects: Effects,
    instants: tuple[Pose, ...],
    frame: int | None = None,
) -> tuple[Placed, Sample]:
    """Draw a placed scene and its truth; return it as it was drawn, since a thin tip may ask for a larger organ.

    ``instants`` are the poses while the shutter is open; the truth is that of ``placed``. Every ``frame`` of a video
    has noise of its own.
    """
    scene = placed.scene
    placed, truth = draw_truth(renderer, placed, pair, limits)
    light = [
        draw_light(renderer, view, placed, pair, disparity, instants)
        for view, disparity in zip((pair.left, pair.right), truth, strict=True)
    ]
    left, right = expose(light[0], light[1], scene.sensor, (scene.seed, 7) if frame is None else (scene.seed, 7, frame))
    if effects.chroma:
        left, right = subsample_chroma(left), subsample_chroma(right)
    sample = Sample(
        id=f"{scene.seed:09d}",
        left=left,
        right=right,
        disparity=truth[0],
        disparity_right=truth[1],
        occlusion=find_occlusion(truth[0], truth[1]),
        focal_px=pair.focal_px,
        baseline_mm=pair.baseline_mm,
        info={"seed": scene.seed, "organ": scene.organ, "renderer": renderer.version, "scene": describe(placed)},
    )
    return placed, sample


def load_scene(renderer: Renderer, scene: Scene, camera: StereoCamera, painted: bool = True) -> None:
    """Build every surface of the scene, as finely painted as the camera sees, and replace what the renderer held.

    Surfaces that are not ``painted`` have depth alone, which takes a fraction of the time.
    """
    renderer.clear()
    for part, mesh in build_parts(scene.parts):
        if painted:
            renderer.add(mesh, part.tissue, paint_part(part, mesh, camera.width))
        else:
            renderer.add(mesh)


def build_parts(parts: tuple[Part, ...]) -> list[tuple[Part, Mesh]]:
    """Build the surfaces of an organ, their lumens joined."""
    meshes = [build_mesh(part.shape, (part.seed, 0)) for part in parts]
    return list(zip(parts, join_lumens([part.shape for part in parts], meshes), strict=True))


def paint_part(part: Part, mesh: Mesh, width: int) -> TissueTexture:
    """Paint a surface as finely as a camera of this width sees it."""
    pixels = max(64, round(part.texture_px * min(width / TEXTURED_FOR_PX, 2.0)))
    return paint_tissue(part.tissue, (part.seed, 1), mesh.size_mm, pixels)


def place_camera(renderer: Renderer, scene: Scene, camera: StereoCamera, limits: DisparityLimits) -> Placed:
    """Find a pose by depth previews, add the instrument, and scale the organ so that disparities are in range.

    An instrument whose shaft would lie right at a lens is left out; the scene that is returned has none.
    """
    preview = rectified_pair(smaller(camera)).left
    wanted = max(limits.largest * scene.nearest_share, 4 * limits.smallest)
    pose = _choose_pose(renderer, scene, preview, limits.smallest / wanted)
    scale = _fit_scale(renderer, pose, camera, wanted)
    if scene.instrument is not None:
        for part in instrument_parts(scene.instrument, renderer.depth(preview, pose, 1.0), preview, pose):
            mesh = build_mesh(part.shape, (part.seed, 0))
            renderer.add(mesh, part.tissue, paint_part(part, mesh, camera.width))
        with_tool = _fit_scale(renderer, pose, camera, wanted)
        if with_tool > TOOL_AT_LENS * scale:
            scene = replace(scene, instrument=None)
            load_scene(renderer, scene, camera)
        else:
            scale = with_tool
    return Placed(scene, pose, scale, scale * float(np.median(renderer.depth(preview, pose, 1.0))))


def _choose_pose(renderer: Renderer, scene: Scene, preview: View, smallest_share: float) -> Pose:
    """Return the first candidate without fault, or the best of all that are tried."""
    tried: list[tuple[float, int, Pose]] = []
    for pose in islice(candidate_poses(scene), POSE_TRIALS):
        fault = pose_fault(renderer.depth(preview, pose, 1.0), smallest_share)
        if fault == 0.0:
            return pose
        tried.append((fault, len(tried), pose))
    return min(tried)[2]


def smaller(camera: StereoCamera) -> StereoCamera:
    """Return the camera of a preview: the same view in few pixels."""
    factor = PREVIEW_PX / camera.width
    height = max(16, round(camera.height * factor))
    return StereoCamera(PREVIEW_PX, height, camera.focal_px * factor, camera.baseline_mm)


def pose_fault(depth: Array, smallest_share: float) -> float:
    """Return 0 for a good pose, else how bad it is. Shares are of the nearest surface's disparity."""
    share = float(depth.min()) / depth
    fault = max(0.0, CLOSE_SHARE - float((share > CLOSE_DISPARITY).mean()))
    fault += max(0.0, LENS_SHARE - float((share > LENS_DISPARITY * 0.8).mean()))
    return fault + 5.0 * float((share < smallest_share).mean())


def _fit_scale(renderer: Renderer, pose: Pose, camera: StereoCamera, wanted: float) -> float:
    """Return the scale at which the largest disparity of either view of a preview is about ``wanted``."""
    small = smaller(camera)
    pair = rectified_pair(small)
    views = (pair.left, pair.right)
    # The left view scales exactly; the right one shifts a little with the scale, hence the second round.
    scale = _largest_disparity(renderer.depth(views[0], pose, 1.0), small) * camera.width / PREVIEW_PX / wanted
    seen = max(_largest_disparity(renderer.depth(view, pose, scale), small) for view in views)
    return scale * seen * camera.width / PREVIEW_PX / wanted


def _largest_disparity(depth: Array, camera: StereoCamera) -> float:
    return camera.disparity_of(float(depth.min()))


def draw_truth(
    renderer: Renderer, placed: Placed, pair: RectifiedPair, limits: DisparityLimits
) -> tuple[Placed, tuple[Array, Array]]:
    """Return both true disparities [H,W] in px, NaN where nothing is seen, and the scene as drawn.

    The preview can miss a thin tip: where the full picture exceeds the limit, the organ is made a little larger.
    """
    while True:
        left, right = (
            pair.disparity(renderer.depth(view, placed.pose, placed.scale)) for view in (pair.left, pair.right)
        )
        seen = float(max(np.nanmax(left), np.nanmax(right)))
        if seen <= limits.largest:
            return placed, (left, right)
        factor = 1.002 * seen / limits.largest
        placed = replace(placed, scale=placed.scale * factor, reach=placed.reach * factor)


def draw_light(
    renderer: Renderer,
    view: View,
    placed: Placed,
    pair: RectifiedPair,
    disparity: Array,
    instants: tuple[Pose, ...],
) -> Array:
    """Return the linear light [H,W,3] that reaches a view at these instants, on average.

    ``disparity`` is what the view sees in the middle of them, in terms of the rectified pair.
    """
    middle = (0.5 * pair.baseline_mm, 0.0, 0.0)
    light = renderer.colour(view, instants[0], placed.scale, placed.scene.lamp, middle, placed.reach)
    for pose in instants[1:]:
        light = light + renderer.colour(view, pose, placed.scale, placed.scene.lamp, middle, placed.reach)
    light = light / np.float32(len(instants)) if len(instants) > 1 else light
    return light if renderer.casts_shadows else light * near_shadow(disparity)[..., None]


def describe(placed: Placed) -> dict[str, Any]:
    """Return what was drawn as plain values for the sample's record."""
    record = asdict(placed.scene)
    for drawn, part in zip(placed.scene.parts, record["parts"], strict=True):
        for later in ("bubbles", "picture"):  # they came later; older sets stay the same
            if not part["tissue"][later]:
                del part["tissue"][later]
        if drawn.tissue.picture is not None:
            part["tissue"]["picture"] = drawn.tissue.picture.described
    if record["instrument"] is not None:
        for tissue in (record["instrument"]["shaft"], record["instrument"]["steel"]):
            del tissue["bubbles"], tissue["picture"]
    record["pose"] = {"position": placed.pose.position.tolist(), "axes": placed.pose.axes.tolist()}
    record["scale"] = placed.scale
    return record
