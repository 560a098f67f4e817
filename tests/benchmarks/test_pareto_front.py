"""The picture of error against time: every name can be read, and belongs to its own point."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.accuracy.pareto_front import label_points, measure
from benchmarks.methods import classical
from benchmarks.methods.classical import BlockMatcher, classical_method
from endosdk.datasets.dataset import Sample
from endosdk.evaluation import methods
from endosdk.evaluation.methods import Answer, sgbm_method
from endosdk.evaluation.sgbm import SgbmBaseline
from tests.training.warped_scenes import warped_pair

RECORD = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "accuracy" / "pareto_front.json"
LINE_GAP = 8.0  # px between the end of a line and what it connects


def labelled(points):
    """The box of the axes; by name the places of points, the boxes of names, and which names have a line; px."""
    figure = Figure(figsize=(7.2, 4.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(xscale="log", yscale="log")
    for point in points.values():
        axes.plot(point["ms"], point["epe_px"], "o")
    axes.margins(0.15)
    figure.draw_without_rendering()
    label_points(axes, points)
    places = axes.transData.transform([(point["ms"], point["epe_px"]) for point in points.values()])
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    ends = [axes.transData.transform(line.get_path().vertices) for line in axes.patches]
    led = {
        name
        for name, place in zip(points, places, strict=True)
        for one in ends
        if np.hypot(*(one - place).T).min() <= LINE_GAP and distance(boxes[name], one[0]) <= LINE_GAP
    }
    return axes.bbox, dict(zip(points, places, strict=True)), boxes, led


def distance(box, point):
    return np.hypot(*np.maximum(0, np.maximum(box.min - point, point - box.max)))


def scattered(seed):
    rng = np.random.default_rng(seed)
    times, errors = 10 ** rng.uniform(0.5, 2.5, 12), 10 ** rng.uniform(-0.7, 0.3, 12)
    return {f"model-{i}": {"ms": ms, "epe_px": epe} for i, (ms, epe) in enumerate(zip(times, errors, strict=True))}


def check_readable(points):
    """Return what is nearest to each name; no name covers a point or a name, or leaves the axes."""
    axes, places, boxes, led = labelled(points)
    assert boxes.keys() == points.keys()
    for name, box in boxes.items():
        assert all(distance(box, place) > 0 for place in places.values())
        assert not any(box.overlaps(other) for its, other in boxes.items() if its != name)
        assert axes.x0 <= box.x0 and axes.y0 <= box.y0 and box.x1 <= axes.x1 and box.y1 <= axes.y1
    return {name: min(places, key=lambda other: distance(box, places[other])) for name, box in boxes.items()}, led


def test_names_of_the_record_stand_beside_their_points():
    nearest, _ = check_readable(json.loads(RECORD.read_text())["points"])
    assert nearest and all(name == other for name, other in nearest.items())


@pytest.mark.parametrize("points", [scattered(seed) for seed in range(5, 13)])
def test_a_name_that_stands_beside_another_point_has_a_line_to_its_own(points):
    nearest, led = check_readable(points)
    assert {name for name, other in nearest.items() if name != other} <= led


def test_names_of_points_in_one_place_are_all_written():
    _, _, boxes, _ = labelled({f"model-{i}": {"ms": 10.0, "epe_px": 0.5} for i in range(12)})
    assert len(boxes) == 12


def test_block_matching_of_the_picture_answers_everywhere():
    left, right, truth = warped_pair(3, (64, 160), (3.0, 20.0))
    sample = Sample("3", left, right, truth, None, None, focal_px=100.0, baseline_mm=5.0)
    answer = classical_method("bm", {}, filled=True)(sample)
    assert np.isfinite(answer.disparity).all() and answer.milliseconds > 0


def test_a_point_is_the_median_time_and_the_pooled_error_of_its_method():
    truth = np.full((4, 32), 8, np.float32)
    samples = [Sample(str(i), *np.zeros((2, 4, 32, 3), np.uint8), truth, None, None, 100.0, 5.0) for i in range(3)]

    def method(off, *milliseconds):
        times = iter([time for ms in milliseconds for time in (999, ms)])  # before each that counts, one that does not
        return lambda sample: Answer(truth + off[int(sample.id)], milliseconds=next(times))

    found = measure({"a": method((0, 2, 4), 30, 10, 20), "b": method((1, 1, 4), 7, 5, 60)}, samples)
    assert {name: (one["ms"], one["epe_px"], one["kpe_1"], one["kpe_3"]) for name, one in found.items()} == {
        "a": (20, 2, pytest.approx(2 / 3), pytest.approx(1 / 3)),
        "b": (7, 2, pytest.approx(1 / 3), pytest.approx(1 / 3)),
    }


@pytest.mark.parametrize("filled", [False, True])
@pytest.mark.parametrize("name", ["sgbm", "bm"])
def test_rivals_are_timed_for_their_matching_alone(monkeypatch, name, filled):
    """Matching takes 7 ms, filling the holes 100 ms: a user who needs no filled holes does not wait for them."""
    left, right, truth = warped_pair(3, (64, 160), (3.0, 20.0))
    sample = Sample("3", left, right, truth, None, None, focal_px=100.0, baseline_mm=5.0)
    clock = SimpleNamespace(now=0.0, perf_counter=lambda: clock.now)

    def taking(milliseconds, function):
        def run(*arguments):
            clock.now += milliseconds / 1e3
            return function(*arguments)

        return run

    for module in (methods, classical):
        monkeypatch.setattr(module, "time", clock)
        monkeypatch.setattr(module, "fill_holes", taking(100, module.fill_holes))
    for matcher in (SgbmBaseline, BlockMatcher):
        monkeypatch.setattr(matcher, "compute", taking(7, matcher.compute))
    method = sgbm_method(filled=filled) if name == "sgbm" else classical_method(name, {}, filled=filled)
    answer = method(sample)
    assert answer.milliseconds == pytest.approx(7)
    assert np.isfinite(answer.disparity).all() == filled
