"""The figures of the report: each redoes one of the paper's, from what has been run; what has not is left out."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from PIL import Image

from benchmarks.methods.kept_patchmatch import kept_match
from benchmarks.methods.patchmatch import PatchMatchSettings
from benchmarks.paper.experiments import EXPERIMENTS, GROUPS, LABELS
from benchmarks.paper.paper_records import PaperRecords
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.sgbm import fill_holes
from endosdk.runtime.overview import colour_map, robust_range

# What is drawn of a run's epochs: the key in its curve, and how the axis is called.
CURVES = {
    "loss": "training loss",
    "test_epe": "mean error on test pairs, px",
    "test_epe_in_range": "mean error on test pairs, truth in range, px",
}
DOTS_PER_INCH = 110
MOST_LABELLED = 300.0  # ratio of the ends of an axis up to which its minor ticks have labels


def draw_all(args: argparse.Namespace) -> list[Path]:
    """Draw every figure that there are results for; return the files."""
    args.docs.mkdir(parents=True, exist_ok=True)
    reader = open_dataset(args.test_data or args.data, "test", layout=args.layout)
    written = [draw_histogram(reader, args.docs / "histogram.png", args.pairs)]
    records = PaperRecords(args.results)
    for group in GROUPS.keys() - {"table1"}:
        rows = {run.label: records.ablated.get(run.name) for run in EXPERIMENTS if run.group == group}
        known = {label: row for label, row in rows.items() if row and row["curve"]}
        if len(known) > 1:  # one run alone compares nothing
            for measure in CURVES:
                file = args.docs / f"{group}_{measure.removeprefix('test_')}.png"
                written.append(draw_curves(known, GROUPS[group].title, measure, file))
    written.append(draw_methods(args, reader, reader[0], args.docs / "methods.png"))
    return written


def draw_histogram(reader: DatasetReader, file: Path, limit: int | None = None) -> Path:
    """Draw how often each disparity occurs in the truth (Fig. 4)."""
    edges = np.arange(0, 81, 1.0)
    counts = np.zeros(edges.size - 1)
    for index in range(min(limit or len(reader), len(reader))):
        truth = reader[index].disparity
        counts += np.histogram(truth[np.isfinite(truth)], edges)[0]
    figure = Figure(figsize=(6, 3.2), layout="constrained")
    axes = figure.add_subplot()
    axes.bar(edges[:-1], 100 * counts / max(counts.sum(), 1), width=1.0, align="edge", color="#a0522d")
    axes.set(xlabel="disparity, px", ylabel="share of pixels, %", title=f"Disparities of {reader.name}, test split")
    return _save(figure, file)


def draw_curves(rows: dict[str, dict[str, Any]], title: str, measure: str, file: Path) -> Path:
    """Draw one measure of the curves against epochs; further seeds of a run are thin lines of its colour."""
    figure = Figure(figsize=(7.5, 3.8), layout="constrained")
    axes = figure.add_subplot()
    colours: dict[str, str] = {}
    for label, values in rows.items():
        first = label.partition(", seed ")[0]
        known = first in colours
        (line,) = axes.plot(
            values["curve"]["epochs"],
            values["curve"][measure],
            color=colours.get(first),
            linewidth=0.7 if known else 1.6,
            label=None if known else first,
        )
        colours.setdefault(first, line.get_color())
    axes.set(xlabel="epoch", ylabel=CURVES[measure], yscale="log", title=title)
    axes.yaxis.set_minor_locator(LogLocator(subs=(2, 4, 6, 8)))
    axes.yaxis.set_major_formatter("{x:g}")
    low, high = axes.get_ylim()
    # Over more, the labels would meet.
    axes.yaxis.set_minor_formatter("{x:g}" if high < MOST_LABELLED * low else NullFormatter())
    # Beside the axes: curves are everywhere within.
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, fontsize=9)
    axes.grid(alpha=0.3, which="both")
    return _save(figure, file)


def draw_methods(args: argparse.Namespace, reader: DatasetReader, sample: Sample, file: Path) -> Path:
    """Draw one pair as every method of the set's tables answers it, with its error beside (Fig. 6).

    Holes are filled, as in the rows of the tables that bear the same names.
    """
    from benchmarks.paper.tables import method_of, patchmatch_folder

    tables = [json.loads(file.read_text()) for file in sorted(args.results.glob("paper/table1*.json"))]
    rows = {name: row for table in tables if table["sha256"] == reader.sha256 for name, row in table["methods"].items()}
    methods = {name: method_of(name, rows[name], args.runs) for name in LABELS if name in rows}
    if "patchmatch" in methods:
        kept = kept_match(patchmatch_folder(args.runs, reader), PatchMatchSettings())
        methods["patchmatch"] = lambda sample: kept(sample)[0]
    answers = {name: method(sample).disparity for name, method in methods.items() if method is not None}
    low, high = robust_range(sample.disparity)
    figure = Figure(figsize=(7, 2.6 * (len(answers) + 1)), layout="constrained")
    grid = figure.subplots(len(answers) + 1, 2, squeeze=False)
    _show(grid[0][0], sample.left, "left view")
    _show(grid[0][1], colour_map(sample.disparity, low, high), f"truth, {low:.0f} to {high:.0f} px")
    for axes, (name, disparity) in zip(grid[1:], answers.items(), strict=True):
        filled = fill_holes(disparity)
        error = np.abs(filled - sample.disparity)
        holes = ", holes filled" if np.isnan(disparity).any() else ""
        _show(axes[0], colour_map(filled, low, high), LABELS[name] + holes)
        _show(axes[1], colour_map(error, 0.0, 3.0), f"error, 0 to 3 px; mean {np.nanmean(error):.3f} px")
    return _save(figure, file)


def _show(axes: Any, picture: Any, title: str) -> None:
    axes.imshow(picture)
    axes.set_title(title, fontsize=9)
    axes.axis("off")


def _save(figure: Figure, file: Path) -> Path:
    figure.set_dpi(DOTS_PER_INCH)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    # With a palette the pictures, which the page holds, take a third of the space.
    Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB").quantize(256).save(file, optimize=True)
    return file
