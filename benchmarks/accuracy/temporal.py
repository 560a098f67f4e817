"""What `stream(temporal=True)` gains: flicker, error against truth, and what trails behind a moving tool.

    python -m benchmarks.accuracy.temporal --films DIR --scenes 2 --json benchmarks/results/accuracy/temporal.json

Films are rendered with truth, see `films`: a scene that stands still, a flight, and a flight with an instrument that
moves. They are kept in DIR and rendered once. Every film is streamed twice, without the filter and with it.
`benchmarks.speed.temporal` measures what the filter costs.

- flicker: standard deviation in time of each pixel of a still scene.
- jump: change of the error from a frame to the next, along the motion of the surface, where both frames show it.
- jump at the pixel: the same at one pixel. An edge that passes makes it jump, with the filter and without.
- trail: share of pixels around the tool whose error is above 3 px.
- quick: the same flight with one of four frames, as where a camera moves fast or frames are dropped.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import fields
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from benchmarks.accuracy.films import KINDS, FilmFrame, film, film_seeds
from benchmarks.record import write_record
from endosdk import DepthEstimator
from endosdk.simulation.rasteriser import Rasteriser

FIRST_SEED = 950_000
SAME_PX = 0.5  # by which disparities of one surface in two frames may differ from what its motion says
SETTLED = 5  # frames before the filter counts
PARTS = tuple(part.name for part in fields(FilmFrame))
TRAIL_PX = 3.0
FILM = "film_sha256"  # of the pixels of all its views
AROUND_TOOL_PX = 12
QUICK = 4  # frames of a flight of which one is shown
FRAMES = {"still": 20, "flight": 30, "tool": 30}


def kept_film(folder: Path, renderer: list[Rasteriser], kind: str, seed: int) -> list[FilmFrame]:
    """Return a film, rendered where it is not in the folder yet."""
    path = folder / f"{seed}-{kind}.npz"
    if not path.is_file():
        if not renderer:
            renderer.append(Rasteriser())
        frames = film(renderer[0], kind, seed, FRAMES[kind])
        np.savez_compressed(path, **{name: np.stack([getattr(one, name) for one in frames]) for name in PARTS})
    with np.load(path) as saved:
        parts = [saved[name] for name in PARTS]
    return [FilmFrame(*one) for one in zip(*parts, strict=True)]


def digest(frames: list[FilmFrame]) -> str:
    """Return the SHA-256 of a film's views, left and right in turns."""
    found = sha256()
    for one in frames:
        found.update(one.left.tobytes())
        found.update(one.right.tobytes())
    return found.hexdigest()


def answers(estimator: DepthEstimator, frames: list[FilmFrame], temporal: bool) -> np.ndarray:
    """Return disparities [n,H,W]."""
    results = estimator.stream(((one.left, one.right) for one in frames), temporal=temporal)
    return np.stack([one.disparity for one in results])


def jumps(frames: list[FilmFrame], off: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return changes of the error [n-1,H,W] along the motion, NaN where only one frame shows the surface; and tools."""
    before = np.stack([one.before for one in frames])[1:]
    height, width = before.shape[1:3]
    x, y = (np.nan_to_num(np.rint(before[..., k]), nan=-1).astype(int) for k in (0, 1))
    inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
    at = np.arange(len(before))[:, None, None], y.clip(0, height - 1), x.clip(0, width - 1)
    former = np.stack([one.disparity for one in frames])[:-1]
    seen = inside & (np.abs(former[at] - before[..., 2]) < SAME_PX)
    return np.where(seen, np.abs(off[1:] - off[:-1][at]), np.nan), np.stack([one.tool for one in frames])[1:]


def measured(frames: list[FilmFrame], kind: str, plain: np.ndarray, steady: np.ndarray) -> dict[str, float]:
    """Return the numbers of one film; ratios are with the filter over without."""
    truth = np.stack([one.disparity for one in frames])[SETTLED:]
    off = [answer[SETTLED:] - truth for answer in (plain, steady)]
    error = [float(np.nanmean(np.abs(one))) for one in off]
    steps = [jumps(frames[SETTLED:], one) for one in off]
    jump = [float(np.nanmean(one)) for one, _ in steps]
    fixed = [float(np.nanmean(np.abs(np.diff(one, axis=0)))) for one in off]
    found = {
        "error_px": error[0],
        "error_ratio": error[1] / error[0],
        "jump_px": jump[0],
        "jump_ratio": jump[1] / jump[0],
        "jump_ratio_at_the_pixel": fixed[1] / fixed[0],
    }
    if kind == "still":
        flicker = [float(answer[SETTLED:].std(axis=0).mean()) for answer in (plain, steady)]
        found |= {"flicker_px": flicker[0], "flicker_ratio": flicker[1] / flicker[0]}
    if kind == "tool":
        size = 2 * AROUND_TOOL_PX + 1
        around = np.stack([cv2.dilate(one.tool.astype(np.uint8), np.ones((size, size))) for one in frames])[SETTLED:]
        near = (around > 0) & np.isfinite(truth)
        on, beside = ([float(np.nanmean(one[tool == side])) for one, tool in steps] for side in (True, False))
        found |= {
            "jump_ratio_on_the_tool": on[1] / on[0],
            "jump_ratio_beside_the_tool": beside[1] / beside[0],
            "trail_plain": float((np.abs(off[0][near]) > TRAIL_PX).mean()),
            "trail_steady": float((np.abs(off[1][near]) > TRAIL_PX).mean()),
            "error_ratio_near_tool": float(np.abs(off[1][near]).mean() / np.abs(off[0][near]).mean()),
        }
    return {name: round(value, 4) for name, value in found.items()}


def quick_ratio(estimator: DepthEstimator, frames: list[FilmFrame]) -> float:
    """Return the error with the filter over that without, where few frames of a flight are shown."""
    shown = frames[::QUICK]
    truth = np.stack([one.disparity for one in shown])[1:]
    plain, steady = (answers(estimator, shown, temporal=on)[1:] for on in (False, True))
    return float(np.nanmean(np.abs(steady - truth)) / np.nanmean(np.abs(plain - truth)))


def films(args: argparse.Namespace) -> Iterator[tuple[str, int, list[FilmFrame]]]:
    """Yield every film."""
    args.films.mkdir(parents=True, exist_ok=True)
    renderer: list[Rasteriser] = []
    for seed in islice(film_seeds(FIRST_SEED), args.scenes):
        for kind in KINDS:
            yield kind, seed, kept_film(args.films, renderer, kind, seed)


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--films", type=Path, required=True, help="folder that keeps the rendered films")
    parser.add_argument("--scenes", type=int, default=2)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    estimator = DepthEstimator(args.model, threads=2)
    record: dict[str, Any] = {kind: {} for kind in KINDS}
    for kind, seed, frames in films(args):
        plain, steady = (answers(estimator, frames, temporal=on) for on in (False, True))
        record[kind][str(seed)] = {FILM: digest(frames), **measured(frames, kind, plain, steady)}
        if kind == "flight":
            record[kind][str(seed)]["error_ratio_quick"] = round(quick_ratio(estimator, frames), 4)
        print(kind, seed, json.dumps(record[kind][str(seed)]))
    for kind in KINDS:
        films_of = list(record[kind].values())
        record[kind]["mean"] = {
            name: round(float(np.mean([one[name] for one in films_of])), 4) for name in films_of[0] if name != FILM
        }
    record["films"] = (
        f"scenes of seed {FIRST_SEED} on with an instrument, each as {', '.join(KINDS)}; rendered as drawn"
    )
    command = f"python -m benchmarks.accuracy.temporal --scenes {args.scenes} --model {args.model}"
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})


if __name__ == "__main__":
    main()
