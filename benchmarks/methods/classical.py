"""OpenCV's matchers, which people use today, and the search that finds their best settings on training pairs."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.datasets.dataset import Sample
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import Answer, Method
from endosdk.evaluation.sgbm import SgbmBaseline, SgbmSettings, fill_holes, matched
from endosdk.io.progress import progress

FloatMap = npt.NDArray[np.float32]

# Every combination of the first settings is tried; then one setting at a time, the later ones too, until none helps.
GRID: dict[str, tuple[Any, ...]] = {
    "block_size": (3, 5, 9, 13),
    "small_step": (2, 8, 24),
    "large_step": (32, 96, 288),
}
SEARCHED: dict[str, tuple[Any, ...]] = {
    "block_size": (1, 3, 5, 7, 9, 11, 13, 15, 19),
    "small_step": (1, 2, 4, 8, 16, 24, 48),
    "large_step": (16, 32, 64, 96, 160, 288, 512),
    "pre_filter": (0, 23, 31, 47, 63),
    "uniqueness_ratio": (0, 5, 10, 15),
    "speckle_window": (0, 50, 100, 200),
    "left_right_tolerance": (0, 1, 2, 4),
}
LARGEST_COST = 2**14
BM_RANGE_PX = 80


class BlockMatcher:
    """StereoBM on gray pictures, with holes as NaN."""

    def __init__(self, max_disparity: int = BM_RANGE_PX, block_size: int = 21) -> None:
        import cv2

        self.max_disparity = max_disparity
        self._matcher: Any = cv2.StereoBM.create(max_disparity, block_size)

    def compute(self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8]) -> FloatMap:
        """Disparity, px, float32 [H, W] of a rectified RGB pair uint8 [H, W, 3]."""
        return matched(self._matcher, left, right, self.max_disparity)


def classical_method(name: str, settings: dict[str, Any], *, filled: bool) -> Method:
    """Return ``bm``, ``sgbm`` or ``sgbm-hh`` with these settings; ``filled`` makes it answer everywhere."""
    matcher: BlockMatcher | SgbmBaseline
    if name == "bm":
        matcher = BlockMatcher(**settings)
    elif name in ("sgbm", "sgbm-hh"):
        matcher = SgbmBaseline(replace(SgbmSettings(**settings), eight_paths=name == "sgbm-hh"))
    else:
        raise InvalidArgument("method", "must be bm, sgbm or sgbm-hh", name)

    def answer(sample: Sample) -> Answer:
        started = time.perf_counter()
        disparity = matcher.compute(sample.left, sample.right)
        elapsed = 1e3 * (time.perf_counter() - started)
        return Answer(fill_holes(disparity) if filled else disparity, milliseconds=elapsed)

    return answer


def search_sgbm(
    samples: Sequence[Sample],
    *,
    eight_paths: bool = False,
    grid: dict[str, tuple[Any, ...]] | None = None,
    searched: dict[str, tuple[Any, ...]] | None = None,
) -> dict[str, Any]:
    """Search one form's settings on training pairs; the best has the smallest mean error with its holes filled.

    Filled, because in the table every method answers for every pixel: leaving out what is hard must not win.
    """
    if not samples:
        raise InvalidArgument("samples", "must be at least one training pair", 0)
    tried: dict[SgbmSettings, float] = {}
    form = "8 paths" if eight_paths else "3 paths"
    grids = list(_settings(grid or GRID, eight_paths))
    with progress(total=len(grids), title=f"search, {form}") as bar:
        for settings in grids:
            _try(settings, samples, tried)
            bar.update()
        best = min(tried, key=tried.__getitem__)
        better = True
        while better:  # a round that helps is followed by another: settings depend on one another
            better = False
            for near in _neighbours(best, searched or SEARCHED):
                if near not in tried:
                    _try(near, samples, tried)
                    bar.update()
                if tried[near] < tried[best]:
                    best, better = near, True
    ranked = sorted(tried, key=tried.__getitem__)
    return {
        "best": asdict(best),
        "tried": [{"settings": asdict(settings), "epe": tried[settings]} for settings in ranked],
    }


def _try(settings: SgbmSettings, samples: Sequence[Sample], tried: dict[SgbmSettings, float]) -> None:
    matcher, errors, pixels = SgbmBaseline(settings), 0.0, 0
    for sample in samples:
        error = np.abs(fill_holes(matcher.compute(sample.left, sample.right)) - sample.disparity, dtype=np.float64)
        errors, pixels = errors + float(np.nansum(error)), pixels + int(np.isfinite(error).sum())
    tried[settings] = errors / max(pixels, 1)


def _neighbours(settings: SgbmSettings, searched: dict[str, tuple[Any, ...]]) -> Iterable[SgbmSettings]:
    """Change one setting at a time."""
    for name, values in searched.items():
        for value in values:
            changed = replace(settings, **{name: value})
            if changed != settings and _allowed(changed):
                yield changed


def _settings(grid: dict[str, tuple[Any, ...]], eight_paths: bool) -> Iterable[SgbmSettings]:
    for values in itertools.product(*grid.values()):
        settings = SgbmSettings(eight_paths=eight_paths, **dict(zip(grid, values, strict=True)))
        if _allowed(settings):
            yield settings


def _allowed(settings: SgbmSettings) -> bool:
    """Whether OpenCV takes the costs: those of a large step are the higher ones, and its sums have 16 bits."""
    return settings.small_step < settings.large_step and settings.large_step * settings.block_size**2 <= LARGEST_COST
