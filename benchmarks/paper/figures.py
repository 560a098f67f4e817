"""The figures of the report: each redoes one of the paper's, from what has been run; what has not is left out."""

from __future__ import annotations

import argparse
import json
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.methods.kept_patchmatch import kept_match
from benchmarks.methods.patchmatch import PatchMatchSettings
from benchmarks.paper.experiments import GROUPS, LABELS, Group
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.evaluation.sgbm import fill_holes
from endosdk.io.overview import colour_map, robust_range

CURVES = ("loss", "pairs", "range", "refinement")
DOTS_PER_INCH = 110
SMOOTHED = 40  # entries of a curve: a batch's error says little


def draw_all(args: argparse.Namespace) -> list[Path]:
    """Draw every figure that there are results for; return the files."""
    args.docs.mkdir(parents=True, exist_ok=True)
    reader = open_dataset(args.test_data or args.data, "test", layout=args.layout)
    written = [draw_histogram(reader, args.docs / "histogram.png", args.pairs)]
    ablations = args.results / "paper/ablations.json"
    groups = json.loads(ablations.read_text())["groups"] if ablations.exists() else {}
    for group in CURVES:
        known = {label: row for label, row in groups.get(group, {}).items() if row}
        if len(known) > 1:  # one run alone compares nothing
            written.append(draw_curves(known, GROUPS[group], args.docs / f"{group}_loss.png"))
            written.append(draw_bars(known, GROUPS[group].title, args.docs / f"{group}_epe.png"))
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


def draw_curves(rows: dict[str, dict[str, Any]], group: Group, file: Path) -> Path:
    """Draw the training error of the finest map against steps, one curve a run."""
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.add_subplot()
    for label, values in rows.items():
        steps, errors = values["curve"]["steps"], np.array(values["curve"]["epe"])
        width = max(1, min(SMOOTHED, len(errors) // 4))
        smooth = np.convolve(errors, np.ones(width) / width, mode="valid")
        axes.plot(steps[width - 1 :], smooth, label=label)
    axes.set(xlabel="step", ylabel="error in training, px", yscale="log")
    axes.set_title(textwrap.fill(group.curves, 70), fontsize=8)
    figure.suptitle(group.title)
    # Beside the axes: curves are everywhere within.
    axes.legend(loc="upper left", bbox_to_anchor=(1.02, 1.0), borderaxespad=0.0, fontsize=9)
    axes.grid(alpha=0.3)
    return _save(figure, file)


def draw_bars(rows: dict[str, dict[str, Any]], title: str, file: Path) -> Path:
    """Draw the test error of each run of a group; runs that stopped early are hatched."""
    figure = Figure(figsize=(6, 3.2), layout="constrained")
    axes = figure.add_subplot()
    labels = []
    for place, (label, values) in enumerate(rows.items()):
        bar = axes.bar(place, values["epe"], color="#a0522d", hatch=None if values["complete"] else "//")
        axes.bar_label(bar, fmt="%.3f")
        early = "" if values["complete"] else f"\n{values['samples_seen']} of {values['samples_planned']} crops"
        labels.append(label.replace(", ", "\n") + early)
    axes.set_xticks(range(len(labels)), labels, fontsize=8)
    axes.margins(y=0.12)
    (pairs,) = {values["pairs"] for values in rows.values()}  # those of a record are all the same
    axes.set(ylabel=f"mean error, first {pairs} test pairs, px", title=title)
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
