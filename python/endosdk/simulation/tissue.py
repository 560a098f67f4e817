"""What tissue looks like: every range of colour, vessel, texture and wetness in one place, and a draw from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from endosdk.simulation.tissue_pictures import TissuePicture

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Tissue:
    """Look of one surface; lengths in mm of the organ, colours sRGB 0..255, strengths 0..1."""

    kind: str
    base: Colour
    second: Colour  # blotches fade from base to this
    blotch_mm: float
    blotch: float
    vessel_colour: Colour
    vessel_density: float  # trees per 1000 mm^2
    vessel_mm: float  # diameter of a trunk
    deep: float  # bluish vessels under the surface
    network: float  # closed capillary meshes
    network_mm: float
    grain: float  # fine contrast of the surface
    grain_mm: float
    speckle: float  # dark lobule dots, as on liver
    pits: float
    pit_mm: float
    bump: float  # slope of the fine relief that breaks up highlights
    bump_mm: float
    lobes: float  # slope of the coarse relief, as of fat
    lobe_mm: float
    fibres: float
    roughness: float
    gloss: float
    mucus: float
    stain: float  # share of area under blood or bile
    stain_colour: Colour
    metallic: bool = False
    bubbles: float = 0.0  # in the film on it; drawn only where asked for
    picture: TissuePicture | None = None  # that gives its colours; None: they are drawn


@dataclass(frozen=True)
class TissueRange:
    """Bounds from which one kind of tissue is drawn."""

    base: tuple[Colour, Colour]
    second: tuple[Colour, Colour]
    vessel: tuple[Colour, Colour]
    vessel_density: tuple[float, float]
    vessel_mm: tuple[float, float]
    deep: tuple[float, float] = (0.0, 0.4)
    network: tuple[float, float] = (0.0, 0.3)
    grain: tuple[float, float] = (0.02, 0.12)
    speckle: tuple[float, float] = (0.0, 0.0)
    pits: tuple[float, float] = (0.0, 0.1)
    bump: tuple[float, float] = (0.02, 0.12)
    lobes: tuple[float, float] = (0.0, 0.04)
    fibres: tuple[float, float] = (0.0, 0.15)
    roughness: tuple[float, float] = (0.14, 0.38)
    gloss: tuple[float, float] = (0.3, 1.0)
    mucus: tuple[float, float] = (0.0, 0.5)
    blotch: tuple[float, float] = (0.2, 0.9)


RED = ((120.0, 20.0, 15.0), (185.0, 55.0, 45.0))
TISSUES: dict[str, TissueRange] = {
    "colon": TissueRange(
        base=((205, 120, 90), (240, 170, 145)), second=((180, 80, 60), (225, 130, 100)), vessel=RED,
        vessel_density=(0.1, 0.8), vessel_mm=(0.5, 1.2), network=(0.0, 0.6), pits=(0.0, 0.35),
    ),
    "gastric": TissueRange(
        base=((195, 95, 75), (230, 145, 120)), second=((165, 60, 50), (215, 110, 90)), vessel=RED,
        vessel_density=(0.0, 0.4), vessel_mm=(0.3, 0.9), pits=(0.1, 0.5), mucus=(0.1, 0.7),
    ),
    "duct": TissueRange(
        base=((210, 150, 95), (240, 195, 155)), second=((190, 110, 70), (225, 150, 110)), vessel=RED,
        vessel_density=(0.2, 1.2), vessel_mm=(0.25, 0.7), pits=(0.0, 0.2), fibres=(0.0, 0.3),
    ),
    "serosa": TissueRange(
        base=((220, 155, 150), (245, 200, 195)), second=((195, 115, 110), (225, 150, 140)), vessel=RED,
        vessel_density=(0.4, 2.0), vessel_mm=(0.3, 1.0), deep=(0.1, 0.7), network=(0.0, 0.3), gloss=(0.5, 1.2),
    ),
    "liver": TissueRange(
        base=((85, 28, 32), (150, 62, 58)), second=((70, 22, 35), (130, 50, 75)), vessel=((60, 8, 10), (140, 40, 45)),
        vessel_density=(0.0, 0.5), vessel_mm=(0.3, 0.8), speckle=(0.1, 0.6), bump=(0.03, 0.15), gloss=(0.6, 1.6),
    ),
    "spleen": TissueRange(
        base=((42, 28, 40), (85, 50, 65)), second=((30, 22, 34), (70, 40, 60)), vessel=((40, 5, 10), (100, 30, 40)),
        vessel_density=(0.0, 0.3), vessel_mm=(0.3, 0.8), gloss=(0.6, 1.8), fibres=(0.0, 0.25), network=(0.0, 0.15),
    ),
    "fat": TissueRange(
        base=((220, 160, 100), (245, 205, 160)), second=((205, 125, 85), (235, 165, 120)), vessel=RED,
        vessel_density=(0.1, 1.0), vessel_mm=(0.25, 0.8), lobes=(0.08, 0.3), gloss=(0.4, 1.2), network=(0.0, 0.2),
    ),
    "peritoneum": TissueRange(
        base=((170, 120, 140), (225, 180, 185)), second=((140, 80, 110), (205, 140, 150)), vessel=RED,
        vessel_density=(0.3, 1.6), vessel_mm=(0.3, 1.2), deep=(0.2, 0.9), fibres=(0.05, 0.4), network=(0.0, 0.4),
    ),
    "muscle": TissueRange(
        base=((150, 60, 50), (200, 95, 80)), second=((120, 40, 40), (180, 85, 75)), vessel=RED,
        vessel_density=(0.1, 0.8), vessel_mm=(0.2, 0.7), fibres=(0.2, 0.8), lobes=(0.02, 0.15),
    ),
}  # fmt: skip
STAINS: dict[str, tuple[Colour, Colour]] = {
    "blood": ((110, 5, 5), (190, 20, 15)),
    "bile": ((120, 90, 10), (200, 160, 40)),
    "mucus": ((200, 190, 160), (235, 225, 200)),
}
BLOTCH_MM, NETWORK_MM, GRAIN_MM, PIT_MM, BUMP_MM, LOBE_MM = (
    (6.0, 40.0), (1.2, 5.0), (0.2, 0.7), (0.35, 0.9), (1.0, 5.0), (3.0, 9.0),
)  # fmt: skip
STAIN_SHARES = (0.6, 0.2, 0.2)
STAINED_SHARE = 0.2  # of surfaces
SMOOTH_SHARE = 0.25  # of surfaces nearly without texture: they are common in life and hard to match


def draw_tissue(rng: np.random.Generator, kind: str) -> Tissue:
    """Draw one look of this kind of tissue."""
    ranges = TISSUES[kind]
    smooth = 0.25 if rng.random() < SMOOTH_SHARE else 1.0
    stain = str(rng.choice(list(STAINS), p=STAIN_SHARES))
    stained = rng.random() < STAINED_SHARE
    return Tissue(
        kind=kind,
        base=_colour(rng, ranges.base),
        second=_colour(rng, ranges.second),
        blotch_mm=float(rng.uniform(*BLOTCH_MM)),
        blotch=float(rng.uniform(*ranges.blotch)),
        vessel_colour=_colour(rng, ranges.vessel),
        vessel_density=float(rng.uniform(*ranges.vessel_density)) * smooth,
        vessel_mm=float(rng.uniform(*ranges.vessel_mm)),
        deep=float(rng.uniform(*ranges.deep)),
        network=float(rng.uniform(*ranges.network)) * smooth,
        network_mm=float(rng.uniform(*NETWORK_MM)),
        grain=float(rng.uniform(*ranges.grain)) * smooth,
        grain_mm=float(rng.uniform(*GRAIN_MM)),
        speckle=float(rng.uniform(*ranges.speckle)),
        pits=float(rng.uniform(*ranges.pits)) * smooth,
        pit_mm=float(rng.uniform(*PIT_MM)),
        bump=float(rng.uniform(*ranges.bump)),
        bump_mm=float(rng.uniform(*BUMP_MM)),
        lobes=float(rng.uniform(*ranges.lobes)),
        lobe_mm=float(rng.uniform(*LOBE_MM)),
        fibres=float(rng.uniform(*ranges.fibres)) * smooth,
        roughness=float(rng.uniform(*ranges.roughness)),
        gloss=float(rng.uniform(*ranges.gloss)),
        mucus=float(rng.uniform(*ranges.mucus)),
        stain=float(rng.uniform(0.03, 0.25)) if stained else 0.0,
        stain_colour=_colour(rng, STAINS[stain]),
    )


def draw_metal(rng: np.random.Generator, dark: bool) -> Tissue:
    """Draw the look of an instrument: a dark composite shaft, or bare steel."""
    level = float(rng.uniform(20, 60) if dark else rng.uniform(120, 190))
    tint = rng.uniform(0.95, 1.05, 3)
    base = (level * float(tint[0]), level * float(tint[1]), level * float(tint[2]))
    return Tissue(
        kind="shaft" if dark else "steel", base=base, second=base, blotch_mm=10.0, blotch=0.3,
        vessel_colour=base, vessel_density=0.0, vessel_mm=0.5, deep=0.0, network=0.0, network_mm=2.0,
        grain=float(rng.uniform(0.03, 0.12)), grain_mm=0.3, speckle=0.0, pits=0.0, pit_mm=0.5,
        bump=float(rng.uniform(0.01, 0.05)), bump_mm=1.0, lobes=0.0, lobe_mm=5.0,
        fibres=float(rng.uniform(0.2, 0.7)), roughness=float(rng.uniform(0.2, 0.45)),
        gloss=float(rng.uniform(0.4, 1.0) if dark else rng.uniform(1.5, 3.0)), mucus=0.0,
        stain=0.0, stain_colour=base, metallic=not dark,
    )  # fmt: skip


def _colour(rng: np.random.Generator, bounds: tuple[Colour, Colour]) -> Colour:
    low, high = np.asarray(bounds[0], float), np.asarray(bounds[1], float)
    # One common draw keeps the hue plausible; a small draw of each channel's own varies it.
    mix = np.clip(rng.uniform(0, 1) + rng.uniform(-0.2, 0.2, 3), 0, 1)
    red, green, blue = (low + (high - low) * mix).tolist()
    return (red, green, blue)
