"""The report's figures say what was measured, and nothing covers the curves."""

from pathlib import Path

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from benchmarks.paper import figures

ROWS = {
    label: {"curve": {"epochs": [1, 2, 3], "loss": [3, 2, 1], "test_epe": [2, 1, 0.5], "test_epe_in_range": [1, 1, 1]}}
    for label in (
        "100 pairs",
        "100 pairs, seed 1",
        "800 pairs and the test pairs",
        "800 pairs and the test pairs, seed 1",
    )
}


@pytest.mark.parametrize("measure", figures.CURVES)
def test_legend_stands_beside_the_curves_and_names_each_setting_once(monkeypatch, measure):
    kept = []
    monkeypatch.setattr(figures, "_save", lambda figure, file: kept.append(figure) or file)
    figures.draw_curves(ROWS, "Number of training pairs", measure, Path("unused.png"))
    (figure,) = kept
    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    legend = axes.get_legend()
    assert not legend.get_window_extent().overlaps(axes.bbox)
    assert legend.get_window_extent().x1 <= figure.bbox.x1
    assert [text.get_text() for text in legend.get_texts()] == ["100 pairs", "800 pairs and the test pairs"]
    assert len(axes.lines) == 4 and axes.get_ylabel() == figures.CURVES[measure]
    assert axes.lines[0].get_color() == axes.lines[1].get_color() != axes.lines[2].get_color()
