"""The picture of error against time: every name beside its own point."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.accuracy.pareto_front import LEADER_GAP, label_points
from benchmarks.methods.classical import classical_method
from endosdk.datasets.dataset import Sample
from tests.training.warped_scenes import warped_pair

RECORD = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "accuracy" / "pareto_front.json"


def labelled(points):
    """Positions of points, boxes of their names and, for those with a leader, where it starts, px."""
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xscale="log", yscale="log")
    for point in points.values():
        axes.plot(point["ms"], point["epe_px"], "o")
    axes.margins(0.15)
    figure.draw_without_rendering()
    label_points(axes, points)
    places = axes.transData.transform([(point["ms"], point["epe_px"]) for point in points.values()])
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts if text.get_text()}
    starts = {}
    for text in axes.texts:
        if not text.get_text():  # a leader, which starts at its name
            name = next(name for name, point in points.items() if text.xy == (point["ms"], point["epe_px"]))
            starts[name] = places[list(points).index(name)] + np.array(text.xyann) * figure.dpi / 72
    return dict(zip(points, places, strict=True)), boxes, starts


def distance(box, point):
    return np.hypot(*np.maximum(0, np.maximum(box.min - point, point - box.max)))


def scattered(seed):
    rng = np.random.default_rng(seed)
    times, errors = 10 ** rng.uniform(0.5, 2.5, 12), 10 ** rng.uniform(-0.7, 0.3, 12)
    return {f"model-{i}": {"ms": ms, "epe_px": epe} for i, (ms, epe) in enumerate(zip(times, errors, strict=True))}


def crowded(seed):
    """Points of which most need a leader."""
    rng = np.random.default_rng(seed)
    return {f"m{i}": {"ms": 10 ** rng.uniform(1.0, 1.3), "epe_px": 10 ** rng.uniform(-0.7, -0.5)} for i in range(9)} | {
        "far": {"ms": 1000.0, "epe_px": 2.0}
    }


@pytest.mark.parametrize("points", [json.loads(RECORD.read_text())["points"], *map(scattered, range(30))])
def test_every_name_stands_nearest_to_its_own_point_and_covers_nothing(points):
    places, boxes, _ = labelled(points)
    assert boxes.keys() == points.keys()
    for name, box in boxes.items():
        assert min(places, key=lambda other: distance(box, places[other])) == name
        assert all(distance(box, place) > 0 for place in places.values())
        assert not any(box.overlaps(other) for its, other in boxes.items() if its != name)


@pytest.mark.parametrize("points", [crowded(seed) for seed in range(30)])
def test_no_leader_passes_by_the_point_of_another(points):
    places, _, starts = labelled(points)
    for name, start in starts.items():
        along = np.linspace(start, places[name], 200)
        others = [place for other, place in places.items() if np.hypot(*(place - places[name])) >= LEADER_GAP]
        assert all(np.hypot(*(along - place).T).min() >= LEADER_GAP - 0.5 for place in others), name


def test_names_of_points_in_one_place_are_all_written():
    _, boxes, _ = labelled({f"model-{i}": {"ms": 10.0, "epe_px": 0.5} for i in range(40)})
    assert len(boxes) == 40


def test_block_matching_of_the_picture_answers_everywhere():
    left, right, truth = warped_pair(3, (64, 160), (3.0, 20.0))
    sample = Sample("3", left, right, truth, None, None, focal_px=100.0, baseline_mm=5.0)
    answer = classical_method("bm", {}, filled=True)(sample)
    assert np.isfinite(answer.disparity).all() and answer.milliseconds > 0
