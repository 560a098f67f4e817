"""Calibrate a stereo rig from pairs that show a board, with OpenCV; views that do not fit are refused one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from endosdk.calibration.boards import Board, BoardView, Picture, same_order
from endosdk.calibration.parameter_errors import ParameterErrors, parameter_errors
from endosdk.calibration.rectified_points import rectify_points, row_correlation
from endosdk.calibration.rig import StereoCalibration
from endosdk.calibration.view_collector import LEAST_TILT
from endosdk.errors import EndoError, InvalidArgument

__all__ = [
    "BoardCalibration",
    "calibrate_board",
    "calibrate_views",
    "find_corners",
    "rectify_points",
    "row_correlation",
    "same_order",
]

Points = npt.NDArray[np.float64]

# Three poses are the least that fix focal length and principal point; with fewer the solution is arbitrary.
MIN_PAIRS = 3
TILT_ADVICE = "tilt the board more, both ways: its left side nearer, then its right side, its top, its bottom"
STEPS, CHANGE = 100, 1e-7
# A view is refused whose error is so many times that of the view in the middle, and at least so many px.
OUTLYING, LEAST_OUTLYING_PX = 3.0, 0.5


@dataclass(frozen=True)
class BoardCalibration:
    """A rig and how well it explains its board pictures, in px.

    ``reprojection_px`` is the root mean square over all corners of both views; the row figures are the median and 95th
    percentile of the rows by which matching corners differ after rectification. ``view_px`` holds the error of each
    view that was used, ``refused`` why others were not. ``errors`` says how well the numbers are known.
    """

    calibration: StereoCalibration
    reprojection_px: float
    row_median_px: float
    row_p95_px: float
    views: tuple[BoardView, ...] = ()
    view_px: dict[str, float] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    errors: ParameterErrors | None = None


@dataclass(frozen=True)
class _Fit:
    calibration: StereoCalibration
    error: float
    view_errors: list[float]
    poses: list[tuple[Points, Points]]


def find_corners(picture: Picture, pattern: tuple[int, int]) -> Points | None:
    """Return the inner corners [N,2] of a board with (columns, rows) of them, or None. Takes seconds at 1920x1080."""
    found = Board(pattern, 1.0).find(picture)
    return np.array(list(found.values())) if found else None


def calibrate_board(
    left: Sequence[Points], right: Sequence[Points], pattern: tuple[int, int], square_mm: float, size: tuple[int, int]
) -> BoardCalibration:
    """Calibrate from matching corners [N,2] of each pair that shows a whole chessboard; no view is refused."""
    if len(left) != len(right):
        raise InvalidArgument("pairs", "must each have both views", (len(left), len(right)))
    board = Board(pattern, square_mm).points()
    views = [BoardView(str(i), board, a, b) for i, (a, b) in enumerate(zip(left, right, strict=True))]
    return calibrate_views(views, size, refuse=False)


def calibrate_views(views: Sequence[BoardView], size: tuple[int, int], *, refuse: bool = True) -> BoardCalibration:
    """Calibrate from views of a board in pictures of ``size`` (width, height).

    With ``refuse``, the view that fits worst is left out, and the rest solved again, until none stands out. Raises
    InvalidArgument where the views are too few or too much alike, InvalidCalibration where they show what is no stereo
    rig, such as swapped cameras.
    """
    import cv2

    if len(views) < MIN_PAIRS:
        raise InvalidArgument("pairs", f"must be at least {MIN_PAIRS} that show the board", len(views))
    try:
        return _calibrated(views, size, refuse)
    except (cv2.error, np.linalg.LinAlgError, EndoError) as error:
        # Of views that are alike the fit is arbitrary: what is wrong with the rig that it finds would mislead.
        if isinstance(error, EndoError) and are_tilted(views):
            raise
        rule = f"must show enough to calibrate from: {TILT_ADVICE}; show it near and far, all over the picture"
        raise InvalidArgument("pairs", rule, f"{len(views)} that do not") from error


def are_tilted(views: Sequence[BoardView]) -> bool:
    """Tell whether the views show a board tilted both ways, without which the focal length is not known."""
    return float(np.ptp([_tilt(view) for view in views], axis=0).min()) >= LEAST_TILT


def _tilt(view: BoardView) -> Points:
    """Return how much farther one end of the board is than the other, along its rows and columns, as logarithms."""
    import cv2

    places = view.board[:, :2]
    plane = np.asarray(cv2.findHomography(places, view.left)[0])
    low, middle, high = places.min(axis=0), places.mean(axis=0), places.max(axis=0)
    ends = np.array([[low[0], middle[1]], [high[0], middle[1]], [middle[0], low[1]], [middle[0], high[1]]])
    depth = np.log(ends @ plane[2, :2] + plane[2, 2])
    return np.array([depth[1] - depth[0], depth[3] - depth[2]])


def _calibrated(views: Sequence[BoardView], size: tuple[int, int], refuse: bool) -> BoardCalibration:
    used, refused = list(views), {}
    while True:
        fit = _solve(used, size)
        worst = int(np.argmax(fit.view_errors))
        limit = max(OUTLYING * float(np.median(fit.view_errors)), LEAST_OUTLYING_PX)
        if not refuse or fit.view_errors[worst] <= limit or len(used) <= MIN_PAIRS:
            break
        why = f"does not fit the others: {fit.view_errors[worst]:.2f} px, at most {limit:.2f} px are usual"
        refused[used.pop(worst).name] = why
    median, p95 = row_correlation(fit.calibration, [view.left for view in used], [view.right for view in used])
    return BoardCalibration(
        fit.calibration,
        fit.error,
        median,
        p95,
        tuple(used),
        {view.name: error for view, error in zip(used, fit.view_errors, strict=True)},
        refused,
        parameter_errors(fit.calibration, used, fit.poses),
    )


def _solve(views: Sequence[BoardView], size: tuple[int, int]) -> _Fit:
    """Fit a rig to all views.

    Each camera alone gives the start; then both are refined together with the pose between them, which on a rig with a
    baseline of a few mm makes rows agree several times better than keeping the single cameras' numbers.
    """
    import cv2

    board, a, b = (
        [np.asarray(getattr(view, part), np.float32)[:, None] for view in views] for part in ("board", "left", "right")
    )
    # The sixth-order radial term is held at zero: from few poses it grows without making rows agree better.
    fixed = cv2.CALIB_FIX_K3
    _, k1, d1, *_ = cv2.calibrateCamera(board, a, size, None, None, flags=fixed)
    _, k2, d2, *_ = cv2.calibrateCamera(board, b, size, None, None, flags=fixed)
    together = fixed | cv2.CALIB_USE_INTRINSIC_GUESS
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, STEPS, CHANGE)
    error, *solved = cv2.stereoCalibrateExtended(
        board, a, b, k1, d1, k2, d2, size, np.eye(3), np.zeros(3), flags=together, criteria=stop
    )
    k1, d1, k2, d2, rotation, translation = (np.asarray(part, dtype=np.float64) for part in solved[:6])
    turns, places, view_errors = solved[8:11]
    calibration = StereoCalibration(*size, k1, k2, d1.ravel(), d2.ravel(), rotation, translation.ravel())
    poses = [(np.asarray(turn), np.asarray(place)) for turn, place in zip(turns, places, strict=True)]
    per_view = np.sqrt((np.asarray(view_errors) ** 2).mean(axis=1))
    return _Fit(calibration, float(error), per_view.tolist(), poses)
