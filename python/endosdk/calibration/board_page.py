"""A calibration on one page, HTML without anything from elsewhere: errors of views, coverage, and what is uncertain."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from endosdk.calibration.board import BoardCalibration
from endosdk.calibration.view_collector import GRID, coverage

STYLE = """body{font:15px/1.45 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#1c2733}
h1{font-size:1.5rem}h2{font-size:1.1rem;margin-top:2rem}table{border-collapse:collapse}
td,th{padding:.15rem .8rem .15rem 0;text-align:right}td:first-child,th:first-child{text-align:left}
th{border-bottom:1px solid #9ab}.note{color:#566}"""
BAR_PX, BAR_HEIGHT, NAME_PX = 420, 18, 220
CELL = 90, 66
DEGREES = 180 / math.pi


class LeftOut(NamedTuple):
    """A view that is not used, or several for the same reason."""

    name: str
    reason: str
    views: int = 1


def board_page(result: BoardCalibration, left_out: Sequence[LeftOut], nearest_mm: Mapping[str, float | None]) -> str:
    """Return the page; ``left_out`` are the views not used, ``nearest_mm`` the nearest depth of each model."""
    c = result.calibration
    parts = [
        "<!doctype html><html lang=en><meta charset=utf-8><title>Stereo calibration</title>",
        f"<style>{STYLE}</style><h1>Stereo calibration</h1>",
        f"<p>{c.width} x {c.height} px, {c.model} model, baseline {c.baseline_mm:.3f} mm, "
        f"{len(result.views)} views used, {sum(one.views for one in left_out)} left out.</p>",
        "<h2>Errors</h2>",
        f"<p>Corners are reproduced to {result.reprojection_px:.3f} px (root mean square). After rectification, rows "
        f"of matching corners differ by {result.row_median_px:.3f} px (median) and {result.row_p95_px:.3f} px (95th "
        "percentile).</p>",
        _bars(result),
        _left_out(left_out),
        "<h2>Coverage</h2><p>Corners in each part of the left picture. Depth is least certain where none are.</p>",
        _coverage(result),
        _depths(result),
        _parameters(result),
        _nearest(nearest_mm),
    ]
    return "\n".join(parts) + "</html>\n"


def _bars(result: BoardCalibration) -> str:
    """Return one bar for each view's error, px."""
    largest = max(result.view_px.values(), default=1.0)
    lines = [
        f"<svg width={NAME_PX + BAR_PX + 70} height={BAR_HEIGHT * len(result.view_px) + 4} role=img "
        "aria-label='error of each view'>"
    ]
    for i, (name, error) in enumerate(result.view_px.items()):
        y = BAR_HEIGHT * i
        width = BAR_PX * error / max(largest, 1e-9)
        short = name if len(name) <= 32 else name[:15] + " ... " + name[-12:]
        lines.append(
            f"<text x=0 y={y + 13} font-size=12>{html.escape(short)}</text>"
            f"<rect x={NAME_PX} y={y + 2} width={width:.1f} height={BAR_HEIGHT - 5} fill='#3b6ea5'/>"
            f"<text x={NAME_PX + width + 6:.1f} y={y + 13} font-size=12>{error:.3f} px</text>"
        )
    return "".join(lines) + "</svg>"


def _left_out(views: Sequence[LeftOut]) -> str:
    if not views:
        return "<p>No view was left out.</p>"
    rows = "".join(f"<tr><td>{html.escape(one.name)}<td>{html.escape(one.reason)}" for one in views)
    return f"<h2>Left out</h2><table><tr><th>view<th>reason{rows}</table>"


def _coverage(result: BoardCalibration) -> str:
    counts = coverage(list(result.views), (result.calibration.width, result.calibration.height))
    columns, rows = GRID
    width, height = CELL
    cells = []
    for y, x in np.ndindex(rows, columns):
        share = counts[y, x] / max(int(counts.max()), 1)
        shade = f"hsl(210 55% {97 - 62 * share:.0f}%)"
        ink = "#fff" if share > 0.55 else "#1c2733"
        cells.append(
            f"<rect x={x * width} y={y * height} width={width} height={height} fill='{shade}' stroke='#9ab'/>"
            f"<text x={(x + 0.5) * width} y={(y + 0.55) * height} text-anchor=middle fill='{ink}'>{counts[y, x]}</text>"
        )
    return f"<svg width={columns * width + 1} height={rows * height + 1} role=img>{''.join(cells)}</svg>"


def _depths(result: BoardCalibration) -> str:
    if result.errors is None:
        return ""
    rows = "".join(
        f"<tr><td>{depth:.0f} mm<td>&plusmn; {middle:.2f} mm<td>&plusmn; {edge:.2f} mm"
        for depth, (middle, edge) in result.errors.depth_mm.items()
    )
    return (
        "<h2>What this means for depth</h2><p>One standard error of a depth that comes from the calibration alone. The "
        "error of matching comes on top: <code>result.sigma</code>.</p>"
        f"<table><tr><th>surface at<th>middle of the picture<th>towards its corners{rows}</table>"
    )


def _parameters(result: BoardCalibration) -> str:
    if result.errors is None:
        return ""
    values, rows = parameter_values(result), []
    for name, error in result.errors.standard_errors.items():
        value, unit = values[name]
        scale = DEGREES if unit == "&deg;" else 1.0
        rows.append(f"<tr><td>{name}<td>{scale * value:.4f}<td>&plusmn; {scale * error:.4f}<td>{unit}")
    return f"<h2>Parameters</h2><table><tr><th>name<th>value<th>standard error<th>{''.join(rows)}</table>"


def parameter_values(result: BoardCalibration) -> dict[str, tuple[float, str]]:
    """Return the value and unit of every number that `ParameterErrors` names."""
    import cv2

    c = result.calibration
    values: dict[str, tuple[float, str]] = {}
    for side, matrix, distortion in (
        ("left", c.left_matrix, c.left_distortion),
        ("right", c.right_matrix, c.right_distortion),
    ):
        for name, place in (("fx", (0, 0)), ("fy", (1, 1)), ("cx", (0, 2)), ("cy", (1, 2))):
            values[f"{side} {name}"] = float(matrix[place]), "px"
        for name, value in zip(("k1", "k2", "p1", "p2"), distortion[:4], strict=True):
            values[f"{side} {name}"] = float(value), ""
    turn = cv2.Rodrigues(c.rotation)[0].ravel()
    for i, axis in enumerate("xyz"):
        values[f"rotation {axis}"] = float(turn[i]), "&deg;"
        values[f"translation {axis}"] = float(c.translation[i]), "mm"
    return values


def _nearest(nearest_mm: Mapping[str, float | None]) -> str:
    if not nearest_mm:
        return ""
    rows = "".join(
        f"<tr><td>{html.escape(name)}<td>{'not stated' if depth is None else f'{math.ceil(depth)} mm'}"
        for name, depth in nearest_mm.items()
    )
    return f"<h2>Nearest depth that each model sees on this rig</h2><table><tr><th>model<th>depth{rows}</table>"
