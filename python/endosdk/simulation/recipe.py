"""What determines a data set: drawn by the user, written beside the set, and kept for the sets that are published."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.effects import Effects
from endosdk.simulation.sample import DisparityLimits
from endosdk.simulation.scene import LAP, SHAPES, check_organ

# Seeds of one set: training from the start of its block, testing from the middle, so that they never meet.
SEED_BLOCK = 1_000_000
TEST_OFFSET = 500_000
MOST_FRAMES = 9999
RENDERERS = ("gl", "cycles")
# raw adds what a distorted, misaligned rig sees, and its calibration; drawn gives every scene a rig of its own
RIGS = ("ideal", "raw", "drawn")
ASPECTS = ("fixed", "drawn")
PUBLISHED = Path(__file__).with_name("recipes")


@dataclass(frozen=True)
class Recipe:
    """What determines a data set, given one version of the generator and of the renderer."""

    organ: str = "mix"
    pairs: int = 100
    test_pairs: int = 0
    seed: int = 1
    renderer: str = "gl"
    rig: str = "ideal"
    camera: StereoCamera = field(default_factory=StereoCamera)
    limits: DisparityLimits = field(default_factory=DisparityLimits)
    effects: Effects = field(default_factory=Effects)
    frames: int = 0  # of a video for each seed; 0: one pair for each seed
    aspect: str = "fixed"  # drawn: the height of each frame is one of 4:3, 5:4 and 16:9
    faults: bool = False  # spoil the pictures as real endoscopes do

    def __post_init__(self) -> None:
        check_organ(self.organ)
        for name, known in (("renderer", RENDERERS), ("rig", RIGS), ("aspect", ASPECTS)):
            if getattr(self, name) not in known:
                raise InvalidArgument(name, f"must be one of {', '.join(known)}", getattr(self, name))
        if self.aspect == "drawn" and self.rig != "drawn":
            raise InvalidArgument("aspect", "can be drawn only with the rig", self.rig)
        if self.faults and (self.rig == "raw" or self.frames):
            raise InvalidArgument("faults", "are those of single pairs of an ideal or a drawn rig", self.rig)
        if self.organ in (LAP, SHAPES) and (self.rig == "raw" or self.frames):
            raise InvalidArgument("organ", "lap and shapes are single pairs of an ideal or a drawn rig", self.organ)
        if self.organ == SHAPES:
            self._check_shapes()
        self._check_counts()
        self._check_frames()

    def _check_counts(self) -> None:
        for name in ("pairs", "test_pairs"):
            if not 0 <= getattr(self, name) <= TEST_OFFSET:
                raise InvalidArgument(name, f"must be within 0..{TEST_OFFSET}", getattr(self, name))
        if self.pairs + self.test_pairs == 0:
            raise InvalidArgument("pairs", "at least one pair must be asked for", 0)
        check_seed(self.seed)
        if self.limits.largest > 0.5 * self.camera.width:
            rule = f"the largest disparity must be at most half the width of {self.camera.width} px"
            raise InvalidArgument("limits", rule, self.limits.largest)

    def _check_frames(self) -> None:
        if not 0 <= self.frames <= MOST_FRAMES:
            raise InvalidArgument("frames", f"must be within 0..{MOST_FRAMES}", self.frames)
        if self.frames and self.rig != "ideal":
            raise InvalidArgument("rig", "must be ideal for videos", self.rig)
        if self.effects.motion_px and self.frames:
            rule = "must be 0 for videos, whose blur is set by the shutter"
            raise InvalidArgument("motion_px", rule, self.effects.motion_px)
        if self.effects.shutter and not self.frames:
            rule = "must be 0 without video; single pairs take motion_px"
            raise InvalidArgument("shutter", rule, self.effects.shutter)

    def _check_shapes(self) -> None:
        """Raise InvalidArgument for what scenes of objects do not have."""
        if self.renderer != "gl":
            raise InvalidArgument("renderer", "must be gl for shapes", self.renderer)
        if self.effects != Effects():
            raise InvalidArgument("effects", "those of organs must be left out for shapes", self.effects.described())

    def tasks(self) -> list[tuple[str, int]]:
        """Return (split, seed) of every pair, or of every video."""
        start = self.seed * SEED_BLOCK
        train = [("train", start + k) for k in range(self.pairs)]
        return train + [("test", start + TEST_OFFSET + k) for k in range(self.test_pairs)]

    def names(self, seed: int) -> list[str]:
        """Return the ids of the samples that a seed gives."""
        return [f"{seed:09d}-{frame:04d}" for frame in range(self.frames)] if self.frames else [f"{seed:09d}"]

    def described(self) -> dict[str, Any]:
        """Return all settings as plain values; the later ones only where used, so that older sets stay the same."""
        plain = asdict(self)
        plain["effects"] = self.effects.described()
        if self.effects == Effects():
            del plain["effects"]
        for name, unused in (("frames", 0), ("aspect", "fixed"), ("faults", False)):
            if plain[name] == unused:
                del plain[name]
        return plain


def check_seed(seed: int) -> None:
    """Raise InvalidArgument for a seed that no set may have."""
    if not 0 <= seed < 10_000:
        raise InvalidArgument("seed", "must be within 0..9999", seed)


@dataclass(frozen=True)
class Published:
    """A set that others can make again: its recipe, and what a few of its samples must be with which renderer."""

    name: str
    recipe: Recipe
    generator_version: str
    renderer: str  # version with which the hashes hold to the bit
    expected: dict[str, str]  # split/id: sha256


def published_names() -> tuple[str, ...]:
    """Return the names of the sets whose recipes come with the package."""
    return tuple(sorted(path.stem for path in PUBLISHED.glob("*.json")))


def published(name: str) -> Published:
    """Return a set whose recipe comes with the package. Raises InvalidArgument for another name."""
    if name not in published_names():
        raise InvalidArgument("recipe", f"must be one of {', '.join(published_names())}", name)
    plain = json.loads((PUBLISHED / f"{name}.json").read_text())
    settings = plain["recipe"]
    if "limits" in settings:
        settings["limits"] = DisparityLimits(**settings["limits"])
    return Published(name, Recipe(**settings), plain["generator_version"], plain["renderer"], plain["expected"])
