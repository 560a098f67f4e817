"""Pictures a person understands at a glance: colour maps with scales, and one overview of a result."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from endosdk.runtime.result import DepthResult, Reason

Picture = npt.NDArray[np.uint8]
Map = npt.NDArray[np.floating]

_INK = (235, 235, 235)
_PAPER = (24, 24, 28)
_NO_ANSWER = (70, 70, 76)
_MARGIN = 12  # px between panels
_CAPTION = 34  # px above each panel
_BAR = 110  # px right of each panel, for its scale
_LEGEND = 240  # px right of the panel of reasons

# Three families, so that no panel can be taken for another. Each is perceptual: its ends differ in lightness.
_COLOURS = {"value": "COLORMAP_VIRIDIS", "trust": "COLORMAP_BONE", "error": "COLORMAP_MAGMA"}

# Of the reasons, from the lowest bit on: one for each.
_REASON_COLOURS = (
    (214, 120, 40),
    (150, 80, 190),
    (60, 120, 200),
    (200, 60, 70),
    (240, 220, 90),
    (90, 90, 90),
)
REASON_STYLE = {
    reason: (colour, str(reason.name).lower().replace("_", " "))
    for reason, colour in zip(Reason, _REASON_COLOURS, strict=True)
}


def colour_map(values: Map, low: float, high: float, family: str = "value") -> Picture:
    """Colour a map [H, W] between ``low`` and ``high``; brighter is more, NaN is gray. RGB uint8 [H, W, 3].

    ``family``: ``value`` is Viridis (depth, disparity), ``trust`` black to white by way of blue (confidence), ``error``
    Magma. All three are perceptual: equal steps look equal. None needs red to be told from green.
    """
    import cv2

    span = max(high - low, 1e-9)
    levels = np.nan_to_num(np.clip((values - low) / span, 0, 1) * 255).astype(np.uint8)
    coloured = cv2.cvtColor(cv2.applyColorMap(levels, getattr(cv2, _COLOURS[family])), cv2.COLOR_BGR2RGB)
    coloured[~np.isfinite(values)] = _NO_ANSWER
    return np.asarray(coloured, dtype=np.uint8)


def robust_range(values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """Second and 98th percentile of the finite values, so that a few outliers do not flatten the colours."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(finite, (2, 98))
    return float(low), float(max(high, low + 1e-3))


def overview(left: Picture, result: DepthResult, truth: Map | None = None) -> Picture:
    """Left view, depth (or disparity), confidence and reasons, each with its legend beside it. RGB uint8.

    ``left`` is the rectified left view, as large as the maps. With ``truth``, the true disparity [H, W] in px with NaN
    where it is unknown, there are two panels more: the truth in the colours of the answer, and the error in px.
    """
    height = result.disparity.shape[0]
    values = result.depth_map
    metric = values is not None
    if values is None:
        values = np.where(result.reasons == 0, result.disparity, np.nan)
    low, high = robust_range(values)
    name = "depth (mm)" if metric else "disparity (px)"
    scale = _scale(height, low, high, ends=("near", "far") if metric else ("far", "near"))
    sure = _scale(height, 0.0, 1.0, family="trust", ends=("unsure", "sure"))
    reasons = f"reasons ({100 * result.valid_share:.0f} % of pixels are valid)"
    rows: list[list[Panel]] = [
        [("left view, rectified", left, None), (name, colour_map(values, low, high), scale)],
        [
            ("confidence", colour_map(result.confidence, 0.0, 1.0, "trust"), sure),
            (reasons, _reasons(result.reasons), _reasons_legend(result)),
        ],
    ]
    if truth is not None:
        error = np.where(result.reasons == 0, np.abs(result.disparity - truth), np.nan)
        worst = max(1.0, robust_range(error)[1])
        rows[0].append((f"true {name}", colour_map(_like_the_answer(truth, result), low, high), scale))
        rows[1].append(("absolute error (px)", colour_map(error, 0.0, worst, "error"), _error_scale(height, worst)))
    return _grid(rows)


def _like_the_answer(truth: Map, result: DepthResult) -> Map:
    """Turn a true disparity into depth where the answer is depth."""
    rig = result.geometry
    if rig is None:
        return truth
    with np.errstate(divide="ignore"):
        depth = rig.depth_of(truth)
    return np.asarray(np.where(depth > 0, depth, np.nan))


def preview(left: Picture, result: DepthResult, low: float, high: float) -> Picture:
    """Left view and depth (or disparity) beside it with its scale from ``low`` to ``high``. RGB uint8, even sides."""
    values = result.depth_map if result.depth_map is not None else result.disparity
    shown = np.where(result.reasons == 0, values, np.nan)
    picture = np.hstack([left, colour_map(shown, low, high), _scale(left.shape[0], low, high)])
    height, width = picture.shape[:2]
    return np.ascontiguousarray(np.pad(picture, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge"))


def error_overview(left: Picture, disparity: Map, truth: Map, caption: str) -> Picture:
    """Four panels: left view, answer, truth, and the error where both are known; disparities [H, W] in px. RGB uint8.

    Answer and truth share one scale. The error's scale ends at its 98th percentile, or at 1 px if that is less.
    """
    height = left.shape[0]
    low, high = robust_range(truth)
    error = np.abs(disparity - truth)
    worst = max(1.0, robust_range(error)[1])
    values = _scale(height, low, high, ends=("far", "near"))
    coloured = colour_map(error, 0.0, worst, "error")
    return _grid(
        [
            [(caption, left, None), ("answer (px)", colour_map(disparity, low, high), values)],
            [
                ("truth (px)", colour_map(truth, low, high), values),
                ("absolute error (px)", coloured, _error_scale(height, worst)),
            ],
        ]
    )


def _reasons(reasons: npt.NDArray[np.uint8]) -> Picture:
    picture = np.full((*reasons.shape, 3), _PAPER, np.uint8)
    for reason, (colour, _) in REASON_STYLE.items():
        picture[(reasons & reason.value) != 0] = colour
    return picture


def _reasons_legend(result: DepthResult) -> Picture:
    """Every reason with its colour and its share of the pixels."""
    legend = np.full((result.reasons.shape[0], _LEGEND, 3), _PAPER, np.uint8)
    shares = result.reason_shares
    for row, (reason, (colour, label)) in enumerate(REASON_STYLE.items()):
        y = 20 + 28 * row
        legend[max(0, y - 13) : y + 2, 8:26] = colour
        _text(legend, f"{label} {100 * shares[str(reason.name)]:.1f} %", (34, y), 0.5)
    return legend


def _error_scale(height: int, worst: float) -> Picture:
    return _scale(height, 0.0, worst, family="error", ends=("right", "wrong"))


def _scale(
    height: int, low: float, high: float, *, family: str = "value", ends: tuple[str, str] | None = None
) -> Picture:
    """Draw a ramp with its numbers, and a word at each end: the one of the low values stands below."""
    bar = np.full((height, _BAR, 3), _PAPER, np.uint8)
    ramp = np.linspace(high, low, height, dtype=np.float32)[:, None]
    bar[:, 8:28] = colour_map(np.repeat(ramp, 20, axis=1), low, high, family)
    digits = 0 if high - low > 20 else 1 if high - low > 2 else 2
    for share in np.linspace(0, 1, 6):
        value = high + share * (low - high)
        y = int(np.clip(share * height + 6, 16, height - 6))
        _text(bar, f"{value:.{digits}f}", (34, y), 0.55)
    if ends is not None and height >= 160:
        _text(bar, ends[1], (34, 36), 0.5)
        _text(bar, ends[0], (34, height - 26), 0.5)
    return bar


Panel = tuple[str, Picture, Picture | None]  # title, picture, legend beside it


def _grid(rows: list[list[Panel]]) -> Picture:
    """Lay panels out; the legends of one column get the same room."""
    room = [max(_BAR if side is None else side.shape[1] for _, _, side in column) for column in zip(*rows, strict=True)]
    laid = [np.hstack([_panel(*panel, wide) for panel, wide in zip(row, room, strict=True)]) for row in rows]
    return np.ascontiguousarray(np.vstack(laid))


def _panel(title: str, picture: Picture, side: Picture | None, room: int) -> Picture:
    height, width = picture.shape[:2]
    panel = np.full((height + _CAPTION + _MARGIN, width + room + _MARGIN, 3), _PAPER, np.uint8)
    panel[_CAPTION : _CAPTION + height, _MARGIN : _MARGIN + width] = picture
    if side is not None:
        left = _MARGIN + width
        panel[_CAPTION : _CAPTION + height, left : left + side.shape[1]] = side
    _text(panel, title, (_MARGIN, _CAPTION - 10), 0.7)
    return panel


def _text(picture: Picture, text: str, at: tuple[int, int], scale: float) -> None:
    import cv2

    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, _INK, 1, cv2.LINE_AA)
