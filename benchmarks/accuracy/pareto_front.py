"""Error against time of many methods on the same pairs in the same run, and the picture of it.

    python -m benchmarks.accuracy.pareto_front --data DIR --pairs 20 --threads 2 \
        --models fast small=runs/small.onnx larger=fast@640x480 --json FILE --figure docs/images/pareto_front.png

Models go the whole way from frame to full-size maps; StereoSGBM and StereoBM are timed for their matching alone, and
their holes are filled for the error, so that all answer every pixel. All take turns on every pair, because the speed
of a machine changes while they are measured.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING

import cv2
from adjustText import adjust_text

from benchmarks.methods.classical import classical_method
from benchmarks.model_run import model_run
from benchmarks.record import as_given, write_record
from benchmarks.turns import answers_in_turns
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.methods import Method, estimator_method, sgbm_method
from endosdk.evaluation.scores import ScoreBoard

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROUNDS = 300  # of moving the names apart: by number, not by time, so that one record gives one picture
ROOM = (1.3, 1.8)  # share by which names are taken for wider and higher than they are
SHORTEST_LINE = 3  # px


def named_model(entry: str, threads: int) -> tuple[str, str, Method]:
    """Return name, hash and method of ``NAME[=FILE][@WxH]``; the size is that at which frames are seen."""
    name, _, rest = entry.partition("=")
    file, _, size = (rest or name).partition("@")
    width, _, height = size.partition("x")
    network_size = (int(width), int(height)) if size else None
    return name, model_run(file).sha256, estimator_method(file, threads=threads, network_size=network_size)


def measure(methods: dict[str, Method], samples: list[Sample]) -> dict[str, dict[str, float]]:
    """Median time and pooled error of every method."""
    boards = {name: ScoreBoard() for name in methods}
    times: dict[str, list[float]] = {name: [] for name in methods}
    for name, sample, answer in answers_in_turns(methods, samples):
        boards[name].add(answer.disparity, sample.disparity)
        times[name].append(answer.milliseconds)
    points = {}
    for name, board in boards.items():
        scores = board.result()
        points[name] = {"ms": median(times[name])}
        points[name] |= {key: scores["all"][key] for key in ("epe_px", "kpe_1", "kpe_3")}
        points[name] |= {"edges_epe_px": scores["edges"]["epe_px"], "flying": scores["edges"]["flying"]}
    return points


def draw(points: dict[str, dict[str, float]], path: Path, title: str) -> None:
    """Draw error over time, one point a method."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot, ticker

    figure, axes = pyplot.subplots(figsize=(7.2, 4.4), layout="constrained")
    for name, point in points.items():
        ours = name not in ("sgbm", "bm", "wang2020")
        axes.plot(point["ms"], point["epe_px"], "o" if ours else "s", color="C0" if ours else "C7", markersize=7)
    axes.axvline(1000 / 45, color="C3", linewidth=1, linestyle="--")
    axes.text(1000 / 45, 0.99, " 45 FPS", color="C3", va="top", fontsize=8, transform=axes.get_xaxis_transform())
    axes.margins(x=0.15, y=0.1)
    axes.set(xscale="log", yscale="log", xlabel="median time of a frame, ms", ylabel="end-point error, px", title=title)
    axes.set_xticks([10, 20, 50, 100, 200, 500, 1000])
    axes.set_yticks([0.2, 0.3, 0.5, 1.0, 2.0])
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(ticker.NullLocator())
    axes.grid(alpha=0.25)
    figure.draw_without_rendering()  # lays the axes out: labels are placed by what they cover
    label_points(axes, points)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120)
    pyplot.close(figure)


def label_points(axes: Axes, points: dict[str, dict[str, float]]) -> None:
    """Write each name near its point, where it covers neither a point nor another name; a line leads to its point."""
    x, y = ([point[key] for point in points.values()] for key in ("ms", "epe_px"))
    names = [axes.text(*place, name, fontsize=8) for name, *place in zip(points, x, y, strict=True)]
    line = {"arrowstyle": "-", "color": "C7", "linewidth": 0.7, "shrinkB": 4}
    adjust_text(names, x, y, ax=axes, iter_lim=ROUNDS, expand=ROOM, min_arrow_len=SHORTEST_LINE, arrowprops=line)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--pairs", type=int, default=20, help="first so many pairs of the test split")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--models", nargs="+", required=True, metavar="NAME[=FILE][@WxH]")
    parser.add_argument("--json", type=Path, required=True)
    parser.add_argument("--figure", type=Path, required=True)
    args = parser.parse_args()
    if args.pairs < 1:
        parser.error("--pairs must be at least 1")
    cv2.setNumThreads(args.threads)
    reader = open_dataset(args.data, "test")
    if args.pairs > len(reader):
        parser.error(f"--pairs must be at most the {len(reader)} of the test split")
    samples = [reader[index] for index in range(args.pairs)]
    named = [named_model(entry, args.threads) for entry in args.models]
    hashes = {name: sha256 for name, sha256, _ in named}
    methods: dict[str, Method] = {name: method for name, _, method in named}
    methods |= {"sgbm": sgbm_method(filled=True), "bm": classical_method("bm", {}, filled=True)}
    points = measure(methods, samples)
    for name, point in points.items():
        print(f"{name:14} {point['ms']:8.1f} ms  {point['epe_px']:.3f} px, {point['edges_epe_px']:.3f} px near edges")
    command = f"python -m benchmarks.accuracy.pareto_front --data {reader.name} --pairs {args.pairs} "
    command += f"--threads {args.threads} --models {as_given(args.models)}"
    dataset = {"name": reader.name, "split": "test", "pairs": args.pairs, "sha256": reader.sha256}
    found = {"dataset": dataset, "points": points}
    write_record(args.json, found, command=command, hashes={"model_sha256": hashes})
    height, width = samples[0].left.shape[:2]
    draw(points, args.figure, f"{reader.name}, {args.pairs} pairs of {width} x {height}, {args.threads} threads")


if __name__ == "__main__":
    main()
