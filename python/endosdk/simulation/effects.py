"""What a set may add to or leave out of a scene: motion blur, subsampled chroma, bubbles, lamps, the chips' faults."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import Pose
from endosdk.simulation.curve import Floats
from endosdk.simulation.organs import Part
from endosdk.simulation.scene import Scene
from endosdk.simulation.tissue import TISSUES
from endosdk.simulation.tissue_pictures import TissuePicture

MOST_INSTANTS = 8
BUBBLES = (0.2, 1.0)
MUCOSAE = ("colon", "gastric", "duct")
# Values of the two chips without an effect.
WITHOUT: dict[str, dict[str, Any]] = {
    "vignetting": {"vignette": 0.0},
    "glare": {"glare": 0.0},
    "exposure_difference": {"gain_difference": 0.0, "tint_difference": (0.0, 0.0, 0.0)},
    "noise": {"noise": 0.0, "shot_noise": 0.0},
    "compression": {"jpeg_quality": 0},
}


@dataclass(frozen=True)
class Effects:
    """What a real camera, or a real organ, adds; the strengths are those that the scene's seed drew."""

    motion_px: float = 0.0  # single pairs: longest streak that a turn of the hand leaves while the shutter is open
    shutter: float = 0.0  # video: share of the time between two frames that the shutter is open
    chroma: bool = False  # one colour for four pixels, as in 4:2:0 video
    bubbles: bool = False  # in the film on the mucosa
    emitters: int = 2  # places from which light comes
    vignetting: bool = True  # the corners are darker
    glare: bool = True  # light scattered over the picture
    exposure_difference: bool = True  # of brightness and tint, between the two chips
    noise: bool = True  # of both chips
    compression: bool = True  # JPEG, in half of the pairs
    textures: tuple[TissuePicture, ...] = ()  # from which the colours of tissue come; none: they are drawn

    def __post_init__(self) -> None:
        if not 0 <= self.motion_px <= 50:
            raise InvalidArgument("motion_px", "must be within 0..50 px", self.motion_px)
        if not 0 <= self.shutter <= 1:
            raise InvalidArgument("shutter", "must be within 0..1", self.shutter)
        if self.emitters not in (1, 2):
            raise InvalidArgument("emitters", "must be 1 or 2", self.emitters)

    def described(self) -> dict[str, Any]:
        """Return all settings as plain values; the later ones only where used, so that older sets stay the same."""
        default = Effects()
        first = ("motion_px", "shutter", "chroma")
        plain = {k: v for k, v in vars(self).items() if k in first or v != getattr(default, k)}
        return plain | ({"textures": [one.described for one in self.textures]} if self.textures else {})


def affected(scene: Scene, effects: Effects) -> Scene:
    """Return the scene with what these effects change in it."""
    if effects.emitters == 1:
        one = scene.lamp.emitters[0]
        scene = replace(scene, lamp=replace(scene.lamp, emitters=(one, one)))
    for effect, values in WITHOUT.items():
        if not getattr(effects, effect):
            scene = replace(scene, sensor=replace(scene.sensor, **values))
    if effects.bubbles:
        strength = float(np.random.default_rng((scene.seed, 12)).uniform(*BUBBLES))
        parts = [
            replace(part, tissue=replace(part.tissue, bubbles=strength)) if part.tissue.kind in MUCOSAE else part
            for part in scene.parts
        ]
        scene = replace(scene, parts=tuple(parts))
    if effects.textures:
        scene = replace(scene, parts=tuple(_pictured(scene, effects.textures)))
    return scene


def _pictured(scene: Scene, pictures: tuple[TissuePicture, ...]) -> Iterator[Part]:
    """Give every surface of tissue the colours of one of the pictures, by the seed of the scene."""
    rng = np.random.default_rng((scene.seed, 24))
    for part in scene.parts:
        picture = pictures[int(rng.integers(len(pictures)))]
        tissue = part.tissue
        yield replace(part, tissue=replace(tissue, picture=picture)) if tissue.kind in TISSUES else part


def turning(pose: Pose, motion_px: float, focal_px: float, seed: int) -> tuple[Pose, ...]:
    """Return the poses of a hand that turns while the shutter is open, around ``pose`` in the middle."""
    import cv2

    if motion_px == 0:
        return (pose,)
    rng = np.random.default_rng((seed, 10))
    streak = motion_px * float(rng.uniform(0.2, 1.0))
    axis: Floats = rng.normal(size=3) * np.array([1.0, 1.0, 0.3])
    turn = axis / np.linalg.norm(axis) * streak / focal_px
    count = int(np.clip(np.ceil(streak) + 1, 2, MOST_INSTANTS))
    return tuple(
        Pose(pose.position, np.asarray(cv2.Rodrigues(turn * step)[0], np.float64) @ pose.axes)
        for step in np.linspace(-0.5, 0.5, count)
    )


def subsample_chroma(picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return RGB [H,W,3] after the colour of each 2 x 2 pixels was averaged; brightness keeps every pixel."""
    import cv2

    height, width = picture.shape[:2]
    coded = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2YCrCb))
    small = cv2.resize(coded[..., 1:], ((width + 1) // 2, (height + 1) // 2), interpolation=cv2.INTER_AREA)
    coded[..., 1:] = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(coded, cv2.COLOR_YCrCb2RGB), np.uint8)
