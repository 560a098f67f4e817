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
_BAR = 96  # px right of each panel, for its scale

REASON_STYLE = {
    Reason.LOW_CONFIDENCE: ((214, 120, 40), "low confidence"),
    Reason.OCCLUDED: ((150, 80, 190), "occluded"),
    Reason.OUTSIDE_OVERLAP: ((60, 120, 200), "outside overlap"),
    Reason.OUT_OF_RANGE: ((200, 60, 70), "out of range"),
    Reason.SATURATED: ((240, 220, 90), "glare"),
}


def colour_map(values: npt.NDArray[np.floating], low: float, high: float) -> Picture:
    """Colour a map [H, W] with Viridis between ``low`` and ``high``; NaN is gray. RGB uint8 [H, W, 3].

    Viridis is perceptual: equal steps look equal, brighter is more, and it can be told apart without red and green.
    """
    import cv2

    span = max(high - low, 1e-9)
    levels = np.nan_to_num(np.clip((values - low) / span, 0, 1) * 255).astype(np.uint8)
    coloured = cv2.cvtColor(cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS), cv2.COLOR_BGR2RGB)
    coloured[~np.isfinite(values)] = _NO_ANSWER
    return np.asarray(coloured, dtype=np.uint8)


def robust_range(values: npt.NDArray[np.floating]) -> tuple[float, float]:
    """Second and 98th percentile of the finite values, so that a few outliers do not flatten the colours."""
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return 0.0, 1.0
    low, high = np.percentile(finite, (2, 98))
    return float(low), float(max(high, low + 1e-3))


def overview(left: Picture, result: DepthResult) -> Picture:
    """Four panels: rectified left view (as large as the maps), depth (or disparity), confidence, reasons. RGB uint8."""
    height = result.disparity.shape[0]
    if result.depth_map is not None:
        name, values, unit = "depth", result.depth_map, "mm"
    else:
        name, values, unit = "disparity", np.where(result.reasons == 0, result.disparity, np.nan), "px"
    low, high = robust_range(values)
    panels = [
        _panel("left view, rectified", left),
        _panel(f"{name} ({unit})", colour_map(values, low, high), _scale(height, low, high)),
        _panel("confidence", colour_map(result.confidence, 0.0, 1.0), _scale(height, 0.0, 1.0)),
        _panel(f"reasons ({100 * result.valid_share:.0f} % of pixels have an answer)", _reasons(result.reasons)),
    ]
    rows = [np.hstack(panels[i : i + 2]) for i in (0, 2)]
    return np.ascontiguousarray(np.vstack(rows))


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
    values = _scale(height, low, high)
    panels = [
        _panel(caption, left),
        _panel("answer (px)", colour_map(disparity, low, high), values),
        _panel("truth (px)", colour_map(truth, low, high), values),
        _panel("absolute error (px)", colour_map(error, 0.0, worst), _scale(height, 0.0, worst)),
    ]
    return np.ascontiguousarray(np.vstack([np.hstack(panels[i : i + 2]) for i in (0, 2)]))


def _reasons(reasons: npt.NDArray[np.uint8]) -> Picture:
    picture = np.full((*reasons.shape, 3), _PAPER, np.uint8)
    for reason, (colour, _) in REASON_STYLE.items():
        picture[(reasons & reason.value) != 0] = colour
    present = [r for r in REASON_STYLE if np.any(reasons & r.value)]
    scale = max(0.5, reasons.shape[0] / 900)
    picture[: int((len(present) + 0.5) * 34 * scale), : int(270 * scale)] = _PAPER
    for row, reason in enumerate(present):
        colour, label = REASON_STYLE[reason]
        share = 100 * float(np.mean((reasons & reason.value) != 0))
        y = int((row + 1) * 34 * scale)
        _text(picture, f"{label} {share:.1f} %", (14 + int(30 * scale), y), scale)
        picture[y - int(16 * scale) : y + 2, 12 : 12 + int(22 * scale)] = colour
    return picture


def _scale(height: int, low: float, high: float) -> Picture:
    bar = np.full((height, _BAR, 3), _PAPER, np.uint8)
    ramp = np.linspace(high, low, height, dtype=np.float32)[:, None]
    bar[:, 8:28] = colour_map(np.repeat(ramp, 20, axis=1), low, high)
    for share in np.linspace(0, 1, 6):
        value = high + share * (low - high)
        digits = 0 if high - low > 20 else 1 if high - low > 2 else 2
        y = int(np.clip(share * height + 6, 16, height - 6))
        _text(bar, f"{value:.{digits}f}", (34, y), 0.55)
    return bar


def _panel(title: str, picture: Picture, scale: Picture | None = None) -> Picture:
    height, width = picture.shape[:2]
    panel = np.full((height + _CAPTION + _MARGIN, width + _BAR + _MARGIN, 3), _PAPER, np.uint8)
    panel[_CAPTION : _CAPTION + height, _MARGIN : _MARGIN + width] = picture
    if scale is not None:
        panel[_CAPTION : _CAPTION + height, _MARGIN + width :] = scale
    _text(panel, title, (_MARGIN, _CAPTION - 10), 0.7)
    return panel


def _text(picture: Picture, text: str, at: tuple[int, int], scale: float) -> None:
    import cv2

    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, scale, _INK, 1, cv2.LINE_AA)
