"""What surfaces a scene can hold, as plain numbers; lengths in mm of the organ before the scene is scaled."""

from __future__ import annotations

from dataclasses import dataclass

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Tube:
    """A bent tube along a Bézier curve: a gut or a duct seen from inside, a bowel loop seen from outside."""

    control: tuple[Vector, ...]
    radius: float
    inside: bool
    fold_spacing: float = 0.0  # 0: no folds
    fold_height: float = 0.0  # as a share of the radius
    fold_width: float = 2.0
    fold_lean: float = 0.0  # how far a fold's crest is pushed along the tube, as a share of its height
    sectors: int = 3  # folds per turn; the bands between them are the taeniae
    taeniae: float = 0.0
    swelling: float = 0.0  # bulge of the wall between folds
    waves: float = 0.08  # irregularity, as a share of the radius
    wave_mm: float = 30.0


@dataclass(frozen=True)
class Blob:
    """A displaced ellipsoid: an organ from outside, a stomach or a belly from inside.

    ``pole`` is the direction, from the centre, of the part that the camera looks at: textures stretch least there.
    """

    centre: Vector
    axes: Vector  # two across the pole, one along it
    pole: Vector
    inside: bool
    waves: float = 0.1
    wave_mm: float = 50.0
    fine: float = 0.01
    rugae: int = 0  # number of folds that run towards the pole; 0: none
    ruga_height: float = 0.0
    ruga_width: float = 0.35
    outlet: float = 0.0  # depth of the funnel at the pole, as a share of the radius


@dataclass(frozen=True)
class Rod:
    """A round bar with closed ends between two points, of one radius at each end."""

    start: Vector
    stop: Vector
    radius_start: float
    radius_stop: float


Shape = Tube | Blob | Rod
