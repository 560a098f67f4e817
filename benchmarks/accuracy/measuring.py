"""Whether the 95 % intervals of lengths, depths and areas hold the true sizes of rendered polyps and instruments.

    python -m benchmarks.accuracy.measuring --data sets/endosim-gi sets/endosim-lap \
        --json benchmarks/results/accuracy/measuring.json

The scene of each pair is built again without the object: where the truth is nearer, the object is. On each object
depths, spans from edge to edge and the area inside its outline are measured in the model's answer and in the truth, at
the same pixels. The table counts how many intervals hold the truth.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.accuracy.fault_naming import rig_of
from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk import DepthEstimator, DepthResult
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.measure import Measured, area, distance, point_at
from endosdk.simulation.camera import Pose, StereoCamera, rectified_pair
from endosdk.simulation.organ import SHARED_BY
from endosdk.simulation.organs import Part
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.renderer import Renderer
from endosdk.simulation.rigs import SceneRig
from endosdk.simulation.sample import load_scene
from endosdk.simulation.scene import draw_scene
from endosdk.simulation.shapes import Blob

Mask = NDArray[np.bool_]
NEARER = 1.01  # times the disparity behind it: there the object is
SAME_PX = 0.1  # two renderings of a scene differ by no more
LEAST_PIXELS = 1500
INSET_PX = 4  # from the outline: a person points at the object, and not at its edge
SPANS = POINTS = 12  # on each object
KINDS = ("polyp", "instrument")
RIG_FACTS = ("centre", "span", "farthest", "nearest", "limit")


def objects(renderer: Renderer, sample: Sample) -> Iterator[tuple[str, Mask]]:
    """Yield the polyps together, and the instruments together, as masks of the left view."""
    drawn = sample.info["scene"]
    rig = sample.info.get("rig")  # of sets whose scenes have rigs of their own; their neighbours look at one organ
    seed = int(sample.id)
    scene = draw_scene(seed - seed % SHARED_BY if rig else seed, sample.info["organ"])
    polyps = tuple(part for part in scene.parts if isinstance(part.shape, Blob))
    tools = bool(sample.info["tools"]) if rig else drawn["instrument"] is not None
    here = {"polyp": bool(polyps) and scene.organ == "intestine", "instrument": tools}
    if not any(here.values()):
        return
    size = sample.disparity.shape[1], sample.disparity.shape[0]
    camera = StereoCamera(*size, sample.focal_px, sample.baseline_mm)
    pair = SceneRig(camera, *(rig[name] for name in RIG_FACTS)).pair() if rig else rectified_pair(camera)
    pose = Pose(*(np.array(drawn["pose"][name]) for name in ("position", "axes")))

    def behind(parts: tuple[Part, ...]) -> NDArray[np.float32]:
        load_scene(renderer, replace(scene, parts=parts, instrument=None), camera, painted=False)
        return pair.disparity(renderer.depth(pair.left, pose, drawn["scale"]))

    without_tool = behind(scene.parts)
    tool = sample.disparity > NEARER * without_tool
    off = float(np.nanmax(np.abs(sample.disparity - without_tool)[~tool]))
    if off > SAME_PX + (NEARER - 1) * float(np.nanmax(without_tool)):
        raise SystemExit(f"{sample.id}: the scene is another one than the sample shows, {off:.2f} px")
    if here["polyp"]:
        rest = tuple(part for part in scene.parts if part not in polyps)
        yield "polyp", (without_tool > NEARER * behind(rest)) & ~tool
    if here["instrument"]:
        yield "instrument", tool


def pieces(mask: Mask) -> Iterator[Mask]:
    """Yield the parts of a mask that hang together and are large enough, without their edge."""
    inner = cv2.erode(mask.astype(np.uint8), np.ones((2 * INSET_PX + 1,) * 2))
    count, labels = cv2.connectedComponents(inner)
    for label in range(1, count):
        if (piece := labels == label).sum() >= LEAST_PIXELS:
            yield piece


def spans(piece: Mask, rng: np.random.Generator) -> Iterator[tuple[tuple[int, int], tuple[int, int]]]:
    """Yield pairs of pixels (x, y): the ends of a piece along random directions through its middle."""
    rows, columns = np.nonzero(piece)
    if not len(rows):
        return
    at = np.column_stack([columns, rows])
    away = at - at.mean(axis=0)
    for turn in rng.uniform(0, np.pi, SPANS):
        along, across = away @ (np.cos(turn), np.sin(turn)), away @ (-np.sin(turn), np.cos(turn))
        line = np.flatnonzero(np.abs(across) < 1.0)
        if len(line) > 1:
            first, last = line[along[line].argmin()], line[along[line].argmax()]
            yield (int(at[first, 0]), int(at[first, 1])), (int(at[last, 0]), int(at[last, 1]))


def outline(piece: Mask) -> list[tuple[float, float]]:
    """Return the polygon around a piece, as a person would click it."""
    found, _ = cv2.findContours(piece.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    around = max(found, key=cv2.contourArea)
    return [(float(x), float(y)) for x, y in cv2.approxPolyDP(around, 3.0, True)[:, 0]]


def with_true_depth(result: DepthResult, disparity: NDArray[np.float32]) -> DepthResult:
    """Return the answer with the true depth wherever it has one."""
    assert result.geometry is not None
    true = result.geometry.depth_of(disparity)
    known = np.isfinite(result.depth)
    return replace(result, maps=result.maps._replace(depth=np.where(known, true, np.float32(np.nan))))


def measurements(
    result: DepthResult, truth: DepthResult, piece: Mask, rng: np.random.Generator
) -> Iterator[tuple[str, Measured, Measured]]:
    """Yield what is measured, as found and as it is; pixels without depth are passed over."""
    rows, columns = np.nonzero(piece & np.isfinite(result.depth))
    for i in rng.integers(len(rows), size=POINTS if len(rows) else 0):
        x, y = int(columns[i]), int(rows[i])
        yield "depth", point_at(result, x, y).depth, point_at(truth, x, y).depth
    for p, q in spans(piece & np.isfinite(result.depth), rng):
        yield "distance", distance(result, p, q), distance(truth, p, q)
    try:
        found, true = area(result, outline(piece)), area(truth, outline(piece))
    except InvalidArgument:
        return
    yield "area", found.flat, true.flat
    yield "relief", found.relief, true.relief


def score(found: Measured, true: Measured) -> tuple[bool, float, float]:
    """Return whether the interval holds the truth, the error in standard errors, and the relative error."""
    low, high = found.interval
    off = found.value - true.value
    return low <= true.value <= high, off / found.standard_error, abs(off) / true.value


def table(scores: list[tuple[bool, float, float]]) -> dict[str, float]:
    """Return what is said of one kind of measurement."""
    held, off, relative = (np.array(part, float) for part in zip(*scores, strict=True))
    return {
        "measurements": len(scores),
        "within_95": round(float(held.mean()), 4),
        "rms_in_standard_errors": round(float(np.sqrt((off**2).mean())), 3),
        "median_relative_error": round(float(np.median(relative)), 5),
    }


Scores = dict[str, dict[str, list[tuple[bool, float, float]]]]  # by kind of object and by what is measured


def measure_set(
    renderer: Renderer, reader: DatasetReader, model: str, rng: np.random.Generator
) -> tuple[dict[str, int], Scores]:
    """Measure on every object of a set; return how many there are and the scores."""
    counts = dict.fromkeys(KINDS, 0)
    scores: Scores = {kind: defaultdict(list) for kind in KINDS}
    for sample in reader:
        found = [(kind, piece) for kind, mask in objects(renderer, sample) for piece in pieces(mask)]
        if not found:
            continue
        with DepthEstimator(model, calibration=rig_of(sample), threads=1) as estimator:
            result = estimator.predict(sample.left, sample.right)
        truth = with_true_depth(result, sample.disparity)
        for kind, piece in found:
            counts[kind] += 1
            for name, measured, true in measurements(result, truth, piece, rng):
                scores[kind][name].append(score(measured, true))
        print(sample.id, counts, flush=True)
    return counts, scores


def together(parts: Iterable[dict[str, list[tuple[bool, float, float]]]]) -> dict[str, dict[str, float]]:
    """Return the tables of all scores in one."""
    joined = defaultdict(list)
    for part in parts:
        for name, values in part.items():
            joined[name] += values
    return {name: table(values) for name, values in joined.items()}


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, nargs="+", required=True)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    renderer = Rasteriser()
    rng = np.random.default_rng(0)
    sets: dict[str, Any] = {}
    every: list[dict[str, list[tuple[bool, float, float]]]] = []
    readers = [open_dataset(root, "test") for root in args.data]
    for reader in readers:
        counts, scores = measure_set(renderer, reader, args.model, rng)
        kinds = {kind: together([scores[kind]]) for kind in KINDS if counts[kind]}
        data = {"split": reader.split, "sha256": reader.sha256}
        sets[reader.name] = {**data, "objects": counts, **kinds, "all": together(scores.values())}
        every += scores.values()
    record = {"sets": sets, "all": together(every)}
    names = " ".join(reader.name for reader in readers)
    command = f"python -m benchmarks.accuracy.measuring --data {names} --model {args.model}"
    write_record(args.json, record, command=command, hashes={"model_sha256": model_run(args.model).sha256})
    print(json.dumps(record, indent=1))


if __name__ == "__main__":
    main()
