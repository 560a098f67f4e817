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
from endosdk.evaluation.scores import ScoreBoard
from endosdk.evaluation.sgbm import SgbmBaseline, SgbmSettings, fill_holes

FloatMap = npt.NDArray[np.float32]

# Every combination is tried. Smoothness weights follow from the block size, as OpenCV advises.
SEARCHED: dict[str, tuple[Any, ...]] = {
    "block_size": (5, 9, 11, 15, 19),
    "uniqueness_ratio": (0, 5, 10),
    "speckle_window": (0, 100),
    "left_right_tolerance": (1, 2),
}


class BlockMatcher:
    """StereoBM on gray pictures, with holes as NaN."""

    def __init__(self, max_disparity: int = 80, block_size: int = 21) -> None:
        import cv2

        self.max_disparity = max_disparity
        self._matcher: Any = cv2.StereoBM.create(max_disparity, block_size)

    def compute(self, left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8]) -> FloatMap:
        """Disparity, px, float32 [H, W] of a rectified RGB pair uint8 [H, W, 3]."""
        import cv2

        if left.shape[1] <= self.max_disparity:
            raise InvalidArgument("left", f"must be wider than {self.max_disparity} px", left.shape[1])
        gray = [cv2.cvtColor(view, cv2.COLOR_RGB2GRAY) for view in (left, right)]
        fixed = self._matcher.compute(*gray)
        return np.where(fixed > 0, fixed.astype(np.float32) / 16, np.float32(np.nan)).astype(np.float32)


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


def search_sgbm(samples: Sequence[Sample], grid: dict[str, tuple[Any, ...]] | None = None) -> dict[str, Any]:
    """Try every setting on training pairs; the best has the smallest mean error with its holes filled.

    Filled, because in the table every method answers for every pixel: leaving out what is hard must not win.
    """
    if not samples:
        raise InvalidArgument("samples", "must be at least one training pair", 0)
    tried = []
    for settings in _settings(grid or SEARCHED):
        matcher, board = SgbmBaseline(settings), ScoreBoard()
        for sample in samples:
            board.add(fill_holes(matcher.compute(sample.left, sample.right)), sample.disparity)
        measures = board.result()["all"]
        tried.append({"settings": asdict(settings), "epe": measures["epe_px"], "kpe_3": measures["kpe_3"]})
    tried.sort(key=lambda entry: float(entry["epe"]))
    return {"pairs": [sample.id for sample in samples], "best": tried[0]["settings"], "tried": tried}


def _settings(grid: dict[str, tuple[Any, ...]]) -> Iterable[SgbmSettings]:
    return (SgbmSettings(**dict(zip(grid, values, strict=True))) for values in itertools.product(*grid.values()))
