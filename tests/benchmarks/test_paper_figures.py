"""The report's figures say what was measured on what, and nothing covers the curves."""

import json
from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from benchmarks.paper import figures
from benchmarks.paper.experiments import GROUPS

RECORD = Path(__file__).resolve().parents[2] / "benchmarks" / "results" / "paper" / "ablations.json"


@pytest.fixture
def drawn(monkeypatch):
    """Figures that would have been saved."""
    kept = []
    monkeypatch.setattr(figures, "_save", lambda figure, file: kept.append(figure) or file)
    return kept


@pytest.mark.parametrize("group", figures.CURVES)
def test_legend_stands_beside_the_curves_and_the_title_says_what_they_leave_out(drawn, group):
    rows = json.loads(RECORD.read_text())["groups"][group]
    figures.draw_curves(rows, GROUPS[group], Path("unused.png"))
    (figure,) = drawn
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    legend = axes.get_legend().get_window_extent()
    assert not legend.overlaps(axes.bbox)
    assert legend.x1 <= figure.bbox.x1
    assert axes.get_title().replace("\n", " ") == GROUPS[group].curves
    assert bool(GROUPS[group].curves) == (group in ("range", "refinement"))


def test_bars_say_on_which_pairs_the_error_was_measured(drawn):
    record = json.loads(RECORD.read_text())
    figures.draw_bars(record["groups"]["range"], "Maximum disparity", Path("unused.png"))
    assert drawn[0].axes[0].get_ylabel() == f"mean error, first {record['pairs']} test pairs, px"
