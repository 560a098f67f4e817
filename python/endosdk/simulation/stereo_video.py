"""A stereo video: the camera moves along the organ's path, and every frame is a sample with its own truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from endosdk.datasets.dataset import Sample, read_colours
from endosdk.errors import StorageFailed
from endosdk.io.new_folders import made_folder
from endosdk.io.whole_files import whole_path
from endosdk.simulation.camera import Pose, StereoCamera, look, rectified_pair
from endosdk.simulation.curve import Floats, bezier
from endosdk.simulation.effects import Effects, affected
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.sample import DisparityLimits, Placed, draw_pair, load_scene, pose_fault, smaller
from endosdk.simulation.scene import Scene, draw_scene

FRAME_RATE = 25.0
FLIGHT_TRIALS = 6
PREVIEWS = 8  # frames by which a flight is judged
INSTANTS = 4  # pictures that make one blurred frame
SWAY_SECONDS = (1.5, 4.0)


@dataclass(frozen=True)
class Flight:
    """The camera's way through an organ as a function of time."""

    scene: Scene
    start: float  # place on the path
    speed: float  # of the place, per frame
    aside: Floats  # (3,) mm off the path
    astray: Floats  # (3,) deviation of the target, as a share of its distance
    roll: float
    sway: Floats  # (3,3) strength, period in frames and phase of the hand's sway: sideways, up, roll

    def pose(self, frame: float) -> Pose:
        """Return the pose at a frame, or between two."""
        path = self.scene.path
        control = np.asarray(path.control)
        place = self.start + self.speed * frame
        here, ahead = bezier(control, np.array([place, min(1.0, place + path.look_ahead)]))
        strength, period, phase = self.sway
        waves = strength * np.sin(2 * np.pi * frame / period + phase)
        position = here + self.aside * (1.0 + waves[0])
        target = ahead if path.target is None else np.asarray(path.target)
        distance = float(np.linalg.norm(target - position))
        return look(position, target + self.astray * (1.0 + waves[1]) * distance, self.roll + float(waves[2]))


def draw_flight(scene: Scene, frames: int, trial: int) -> Flight:
    """Draw one way of ``frames`` frames; the same scene and trial give the same."""
    rng = np.random.default_rng((scene.seed, 11, trial))
    path = scene.path
    low, high = path.span
    speed = (high - low) * float(rng.uniform(0.002, 0.006))
    length = min(speed * frames, high - low)
    side = rng.normal(size=3)
    return Flight(
        scene,
        start=float(rng.uniform(low, high - length)),
        speed=length / frames,
        aside=np.asarray(side / np.linalg.norm(side) * rng.uniform(0.1, 0.8) * path.wander),
        astray=np.asarray(rng.normal(size=3) * path.jitter * 0.8),
        roll=float(rng.uniform(-np.pi, np.pi) if path.roll else rng.uniform(-0.3, 0.3)),
        sway=np.stack([
            np.array([0.25, 0.2, 0.04]) * rng.uniform(0.4, 1.0, 3),
            FRAME_RATE * rng.uniform(*SWAY_SECONDS, 3),
            rng.uniform(0, 2 * np.pi, 3),
        ]),
    )  # fmt: skip


def render_video(
    renderer: Renderer, seed: int, organ: str, camera: StereoCamera, limits: DisparityLimits, effects: Effects,
    frames: int, wanted: Callable[[int], bool],
) -> Iterator[Sample]:  # fmt: skip
    """Yield those of the seed's frames that are ``wanted``. No tool is in a video: it would have to move by itself."""
    scene = replace(affected(draw_scene(seed, organ), effects), instrument=None)
    load_scene(renderer, scene, camera)
    flight, scale, reach = place_flight(renderer, scene, camera, limits, frames)
    pair = rectified_pair(camera)
    for frame in range(frames):
        if not wanted(frame):
            continue
        placed = Placed(scene, flight.pose(frame), scale, reach)
        steps = np.linspace(-0.5, 0.5, INSTANTS) * effects.shutter if effects.shutter else [0.0]
        instants = tuple(flight.pose(frame + float(step)) for step in steps)
        _, sample = draw_pair(renderer, placed, pair, limits, effects, instants, frame)
        info = {**sample.info, "frame": frame, "frames_per_second": FRAME_RATE}
        yield replace(sample, id=f"{seed:09d}-{frame:04d}", info=info)
    renderer.clear()


def place_flight(
    renderer: Renderer, scene: Scene, camera: StereoCamera, limits: DisparityLimits, frames: int
) -> tuple[Flight, float, float]:
    """Return the first flight without fault, or the best tried; the organ's one scale; the lamp's one reach."""
    small = smaller(camera)
    preview = rectified_pair(small).left
    largest = max(limits.largest * scene.nearest_share, 4 * limits.smallest)
    tried: list[tuple[float, int, Flight]] = []
    judged = np.unique(np.linspace(0, frames - 1, PREVIEWS).round())
    for trial in range(FLIGHT_TRIALS):
        flight = draw_flight(scene, frames, trial)
        depths = [renderer.depth(preview, flight.pose(float(frame)), 1.0) for frame in judged]
        # Single frames may be far from all walls, or right at one: a video is judged as a whole.
        fault = float(np.mean([pose_fault(depth, limits.smallest / largest) for depth in depths]))
        tried.append((fault, trial, flight))
        if fault == 0.0:
            break
    flight = min(tried)[2]
    reach = float(np.median([renderer.depth(preview, flight.pose(float(frame)), 1.0) for frame in judged]))
    # One scale for the whole video, from every frame at full size: nothing may come too near in any of them.
    scale = 1.0
    pair = rectified_pair(camera)
    for _ in range(2):
        near = min(
            float(renderer.depth(view, flight.pose(frame), scale).min())
            for frame in range(frames)
            for view in (pair.left, pair.right)
        )
        scale *= 1.002 * camera.focal_px * camera.baseline_mm / near / largest
    return flight, scale, scale * reach


def write_video(path: Path, folders: list[Path]) -> None:
    """Write the frames in sample folders as one MP4, left and right side by side. Raises StorageFailed."""
    import cv2

    frames = (np.hstack([read_colours(folder / f"{view}.png") for view in ("left", "right")]) for folder in folders)
    first = next(frames)
    size = (first.shape[1], first.shape[0])
    made_folder(path.parent, "out")
    with whole_path(path, "out") as partial:
        writer = cv2.VideoWriter(str(partial), cv2.VideoWriter.fourcc(*"mp4v"), FRAME_RATE, size)
        try:
            if not writer.isOpened():
                raise StorageFailed(
                    "out", "OpenCV must be able to write MPEG-4 video", f"{path}: it has no such writer"
                )
            for frame in chain([first], frames):
                writer.write(np.ascontiguousarray(frame[..., ::-1]))
        finally:
            writer.release()
        # OpenCV does not say when the disk is full.
        if _count_frames(partial) != len(folders):
            raise StorageFailed(
                "out", "the video must be writable", f"{path}: it cannot be read back; is the disk full?"
            )


def _count_frames(path: Path) -> int:
    """Return how many frames of a film can be read."""
    import cv2

    film = cv2.VideoCapture(str(path))
    count = 0
    while film.grab():
        count += 1
    film.release()
    return count
