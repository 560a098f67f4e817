"""What the rules that both views must agree do: to right pairs, and to pairs that no answer should come of.

    python -m benchmarks.accuracy.photometric_consistency --data DIR [--real DIR] --json FILE

A network answers whatever it is shown, also one covered camera. The SDK compares each pixel of the left view with its
match in the right one, and lowers the confidence where the two do not correlate. A frame that is INVALID has no valid
pixel. Every pair is computed without these rules and with them. `--real` names a folder of real pairs:
`scared_rectified`, `chessboard`, `hamlyn_phantom`.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.model_records import evenly, models_parser, record_models
from benchmarks.model_run import model_run
from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, Reason, StereoCalibration, _core
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.io.pictures import read_frame
from endosdk.runtime.maps import MapMemory
from endosdk.runtime.session import StereoSession, padded

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]
WRONG = 3.0  # px of the frame


@dataclass(frozen=True)
class BothAnswers:
    """One pair, computed without the rule and with it."""

    disparity: NDArray[np.float32]
    without: Mask  # pixels that have an answer
    ruled: Mask

    def shares(self) -> dict[str, float]:
        return {"valid_without": round(self.without.mean(), 4), "valid_with": round(self.ruled.mean(), 4)}


class Answerer:
    """A model, run once for each pair."""

    def __init__(self, model: str) -> None:
        self.model = model
        self.session = StereoSession(model_run(model), threads=2)

    def __call__(self, left: Picture, right: Picture, rig: StereoCalibration | None = None) -> BothAnswers:
        found = DepthEstimator(self.model, calibration=rig, threads=2).predict(left, right)
        seen = np.bitwise_and(found.reasons, Reason.OUTSIDE_OVERLAP) == 0  # masks of the lens, which both know
        return BothAnswers(found.disparity, self._valid_without(left, right, rig) & seen, found.reasons == 0)

    def _valid_without(self, left: Picture, right: Picture, rig: StereoCalibration | None) -> Mask:
        """Valid pixels where the right view is not looked at again."""
        height, width = left.shape[:2]
        info = self.session.info
        network = _core.network_size_of(width, height, info.inference_width or 0)
        estimator = DepthEstimator(self.model, calibration=rig, network_size=network, threads=2)
        estimator.predict(left, right)
        multiple = info.input_multiple
        run = NetworkRun(self.session, padded(network[1], multiple), padded(network[0], multiple))
        _core.pack(*estimator.rectified_pair(), run.left, run.right, "rgb")
        run()
        view_scale = network[1] / height, network[0] / width
        maps = MapMemory(calibrated=False).maps(width, height)
        fields = {
            "disparity": run.disparity,
            "confidence": run.confidence,
            "left": run.left,
            "scale": (view_scale[0] / info.output_stride, view_scale[1] / info.output_stride),
            "view_scale": view_scale,
            "gain": 1 / view_scale[1],
            "reach": network[0] / _core.confidence_parts,
            "min_confidence": _core.default_min_confidence,
            "max_candidate_disparity": float(info.max_candidate_disparity or 0),
        }
        _core.postprocess(fields, {"disparity": maps.disparity, "confidence": maps.confidence, "reasons": maps.reasons})
        return np.asarray(maps.reasons == 0)


def wrong_pairs(left: Picture, right: Picture) -> Iterator[tuple[str, Picture, Picture]]:
    """Pairs that do not show one scene at one moment, or nothing at all."""
    black = np.zeros_like(left)
    noise = np.random.default_rng(0).integers(0, 256, (2, *left.shape)).astype(np.uint8)
    yield "both black", black, black
    yield "both white", black + 255, black + 255
    yield "left covered", black, right
    yield "right covered", left, black
    yield "right frozen grey", left, black + 128
    yield "noise", noise[0], noise[1]
    yield "views swapped", right, left
    yield "twice the left", left, left
    yield "right upside down", left, np.ascontiguousarray(right[::-1])
    yield "right 12 rows off", left, np.roll(right, 12, axis=0)
    yield "right mirrored", left, np.ascontiguousarray(right[:, ::-1])


def degraded_pairs(left: Picture, right: Picture) -> Iterator[tuple[str, Picture, Picture]]:
    """Right pairs in bad light."""
    yield "a sixteenth of the light", left // 16, right // 16
    yield "right half as bright", left, right // 2
    yield "defocused", cv2.GaussianBlur(left, (0, 0), 8), cv2.GaussianBlur(right, (0, 0), 8)
    rng = np.random.default_rng(1)
    grain = [np.clip(view + rng.normal(0, 12, view.shape), 0, 255).astype(np.uint8) for view in (left, right)]
    yield "noise of 12 levels", grain[0], grain[1]


def on_truth(answer: Answerer, samples: list[Sample]) -> dict[str, float]:
    """What the rule drops from right pairs, and how wrong that is beside what it keeps."""
    dropped, kept, before, after = [], [], [], []
    for number, sample in enumerate(samples):
        found = answer(sample.left, sample.right)
        with np.errstate(invalid="ignore"):
            error = np.abs(found.disparity - sample.disparity)
        known = np.isfinite(error)
        dropped.append(error[known & found.without & ~found.ruled])
        kept.append(error[known & found.ruled])
        before.append(found.without.mean())
        after.append(found.ruled.mean())
        print(f"pair {number + 1} of {len(samples)}", file=sys.stderr)
    out, rest = np.concatenate(dropped), np.concatenate(kept)
    return {
        "valid_without": round(float(np.mean(before)), 4),
        "valid_with": round(float(np.mean(after)), 4),
        "least_valid_without": round(float(np.min(before)), 4),
        "least_valid_with": round(float(np.min(after)), 4),
        "epe_of_dropped_px": round(float(out.mean()), 3),
        "epe_of_kept_px": round(float(rest.mean()), 3),
        "over_3_px_of_dropped": round(float(np.mean(out > WRONG)), 4),
        "over_3_px_of_kept": round(float(np.mean(rest > WRONG)), 4),
    }


def real_pairs(folder: Path) -> Iterator[tuple[str, Picture, Picture, StereoCalibration | None]]:
    """Real pictures with their rigs."""
    rectified = folder / "scared_rectified"
    yield "scared_rectified", read_frame(rectified / "left.png"), read_frame(rectified / "right.png"), None
    phantom = folder / "hamlyn_phantom"
    left, right = (read_frame(phantom / f"f7_dynamic_deint_{side}_0100.png") for side in "LR")
    yield "hamlyn_phantom", left, right, StereoCalibration.load(phantom, size=left.shape[1::-1])
    board = folder / "chessboard"
    for path in sorted((board / "left").glob("*.png")):
        left, right = read_frame(path), read_frame(board / "right" / path.name.replace("left", "right"))
        yield f"chessboard {path.stem}", left, right, StereoCalibration.load(board, size=left.shape[1::-1])


def measure(model: str, samples: list[Sample], real: Path | None) -> dict[str, Any]:
    answer = Answerer(model)
    views = samples[0].left, samples[0].right
    record: dict[str, Any] = {"right_pairs": {"pairs": len(samples), **on_truth(answer, samples)}}
    record["bad_light"] = {name: answer(*pair).shares() for name, *pair in degraded_pairs(*views)}
    record["wrong_pairs"] = {name: answer(*pair).shares() for name, *pair in wrong_pairs(*views)}
    if real is not None:
        pairs = list(real_pairs(real))
        record["real_pairs"] = {name: answer(*pair).shares() for name, *pair in pairs}
        # Of rigs whose lens maps differ, so that even one camera connected twice gives two pictures.
        record["real_swapped"] = {name: answer(right, left, rig).shares() for name, left, right, rig in pairs}
        record["real_twice_left"] = {name: answer(left, left, rig).shares() for name, left, _, rig in pairs}
    return record


def main() -> None:
    parser = models_parser(__doc__, "so many pairs, evenly from the whole split")
    parser.add_argument("--real", type=Path, help="folder of real pairs")
    args = parser.parse_args()
    reader = open_dataset(args.data, args.split)
    samples = [reader[number] for number in evenly(args.pairs, len(reader))]
    real = " --real DIR" if args.real else ""
    record_models(args, reader, lambda model: measure(model, samples, args.real), real)


if __name__ == "__main__":
    main()
