"""The rigs that people own: one is drawn for every scene of a set whose rig is ``drawn``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.simulation.camera import RectifiedPair, StereoCamera, aligned_pair

# Focal length over frame width, and mm between the lenses, of rigs that were measured.
MEASURED = (
    (0.96, 4.1),  # robotic, in vivo
    (0.66, 4.4),  # robotic, calibration boards
    (0.88, 4.1),  # robotic, porcine
    (0.69, 4.4),  # laparoscope, phantom
    (1.09, 5.5),  # silicone heart
    (1.05, 4.8),  # stereo laparoscope of 1920 x 1080
    (0.42, 10.0),  # gastrointestinal capsule, simulated
)
MEASURED_SHARE = 0.5  # of the rigs lie near a measured one; the others anywhere within the bounds
SPREAD = 0.08  # deviation from a measured one, as a share
FOCAL_SHARE = (0.4, 1.15)  # of the frame width
BASELINE_MM = (3.5, 10.0)
CENTRE_SHARE = (0.06, 0.08)  # largest deviation of the principal point from the middle, of width and of height
ASPECTS = ((4, 3), (5, 4), (16, 9))
NEAREST_MM, FARTHEST_MM = 12.0, 250.0
OBJECTS_FARTHEST_MM = 2500.0  # scenes without anatomy shall reach down to no disparity at all
WIDEST_DISPARITY = 0.25  # share of the frame width that a set of drawn rigs reaches unless another limit is given
# What a scene shows, and how often: its farthest and its nearest surface, on a logarithmic scale from the farthest that
# the rig can see, 0, to the nearest, 1.
Spans = dict[str, tuple[float, tuple[float, float], tuple[float, float]]]
OBJECT_SPANS: Spans = {
    "all": (0.5, (0.0, 0.25), (0.85, 1.0)),
    "middle": (0.25, (0.1, 0.4), (0.5, 0.85)),
    "far": (0.1, (0.0, 0.1), (0.3, 0.5)),
    "near": (0.15, (0.5, 0.7), (0.9, 1.0)),
}
# Tissue leaves room for instruments in front of it.
ORGAN_SPANS: Spans = {
    "middle": (0.45, (0.0, 0.0), (0.35, 0.65)),
    "near": (0.3, (0.0, 0.0), (0.65, 1.0)),
    "far": (0.25, (0.0, 0.0), (0.12, 0.35)),
}


@dataclass(frozen=True)
class SceneRig:
    """A rectified rig and how far it looks in one scene: disparities in px."""

    camera: StereoCamera
    centre: tuple[float, float]  # principal point of both views, px
    span: str  # name of what the scene shows
    farthest: float
    nearest: float  # no object comes nearer; an organ by what a preview tells, so within a few per cent
    limit: float  # nothing comes nearer, not even an instrument

    def pair(self) -> RectifiedPair:
        """Return the two views."""
        matrix = self.camera.matrix
        matrix[:2, 2] = self.centre
        return aligned_pair(matrix, self.camera.width, self.camera.height, self.camera.baseline_mm)


def draw_camera(rng: np.random.Generator, width: int, height: int | None) -> tuple[StereoCamera, tuple[float, float]]:
    """Draw a camera and its principal point; without a ``height`` the shape of the frame is drawn, too."""
    if rng.random() < MEASURED_SHARE:
        focal, baseline = MEASURED[int(rng.integers(len(MEASURED)))]
        focal, baseline = focal * np.exp(rng.normal(0, SPREAD)), baseline * np.exp(rng.normal(0, SPREAD))
    else:
        focal, baseline = rng.uniform(*FOCAL_SHARE), rng.uniform(*BASELINE_MM)
    focal, baseline = float(np.clip(focal, *FOCAL_SHARE)) * width, float(np.clip(baseline, *BASELINE_MM))
    across, down = ASPECTS[int(rng.integers(len(ASPECTS)))]
    size = (width, height if height is not None else round(width * down / across / 2) * 2)
    centre = [
        (side - 1) / 2 + float(rng.uniform(-share, share)) * side
        for side, share in zip(size, CENTRE_SHARE, strict=True)
    ]
    return StereoCamera(*size, focal, baseline), (centre[0], centre[1])


def draw_range(
    rng: np.random.Generator, camera: StereoCamera, centre: tuple[float, float], largest: float, spans: Spans
) -> SceneRig:
    """Draw how far a camera looks: disparities up to ``largest`` px, in depths of 12..250 mm, of objects 2.5 m."""
    names = list(spans)
    span = names[int(rng.choice(len(names), p=[spans[name][0] for name in names]))]
    far, near = (float(rng.uniform(*bounds)) for bounds in spans[span][1:])
    top = min(camera.disparity_of(NEAREST_MM), largest)
    farthest = OBJECTS_FARTHEST_MM if spans is OBJECT_SPANS else FARTHEST_MM
    bottom = min(camera.disparity_of(farthest), 0.25 * top)
    return SceneRig(
        camera,
        centre,
        span,
        farthest=top * (bottom / top) ** (1.0 - far),
        nearest=top * (bottom / top) ** (1.0 - near),
        limit=top,
    )
