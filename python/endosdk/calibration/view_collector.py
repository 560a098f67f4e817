"""Which frames of a moving board to keep, and what to show next: sharp ones that stand still and add something new."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from endosdk.calibration.boards import Board, BoardView, Picture, find_view

Vector = npt.NDArray[np.float64]

GRID = (4, 3)  # columns and rows of the coverage map
PLACES = (
    *("top left", "top", "top", "top right"),
    *("left", "middle", "middle", "right"),
    *("bottom left", "bottom", "bottom", "bottom right"),
)
# A view is blurred where edges are wider than this share of the picture's width, and wider than so many px.
WIDEST_EDGE_SHARE, WIDEST_EDGE_PX = 0.006, 4.0
STILL_SHARE = 0.004  # a board that moves no farther from a frame to the next, as a share of the width, is held still
# A view is new where it differs so much from each one before: place, size (logarithm), tilt about both axes.
NEW = np.array([0.12, 0.12, 0.2, 0.07, 0.07])
LEAST_TILT = 0.15  # between the views tilted most, each way: logarithm of the ratio of opposite sides
LEAST_SIZES = 0.25  # between the nearest and the farthest view
ENOUGH_COVERED = 0.75


@dataclass(frozen=True)
class Offer:
    """What became of one frame: ``taken``, or why not."""

    taken: bool
    reason: str


@dataclass
class ViewCollector:
    """Takes frames of one moving board in pictures of ``size`` (width, height) until ``wanted`` views are enough."""

    board: Board
    size: tuple[int, int]
    wanted: int = 20
    views: list[BoardView] = field(default_factory=list)
    _poses: list[Vector] = field(default_factory=list)
    _before: Vector | None = None  # the board's outline in the frame before

    def offer(self, name: str, left: Picture, right: Picture) -> Offer:
        """Take a frame, or say why it adds nothing."""
        view = find_view(self.board, name, left, right)
        if isinstance(view, str):
            self._before = None
            return Offer(False, view)
        outline = board_outline(self.board, view)
        moved, self._before = self._moved(outline), outline
        width = edge_width(left, view.left)
        if width > max(WIDEST_EDGE_PX, WIDEST_EDGE_SHARE * self.size[0]):
            return Offer(False, f"blurred: edges are {width:.0f} px wide; hold it still, or move it back")
        if moved > STILL_SHARE * self.size[0]:
            return Offer(False, "moving: hold it still")
        pose = board_pose(outline, self.size)
        if self._poses and min(np.max(np.abs(pose - one) / NEW) for one in self._poses) < 1.0:
            return Offer(False, f"like a view before: {self.advice()}")
        self.views.append(view)
        self._poses.append(pose)
        return Offer(True, f"view {len(self.views)} of {self.wanted}")

    @property
    def done(self) -> bool:
        """Whether there are as many views as wanted, and they suffice; twice as many always do."""
        enough = len(self.views) >= self.wanted and self.advice() == ""
        return enough or len(self.views) >= 2 * self.wanted

    def advice(self) -> str:
        """Return what to show next; empty when nothing is missing but more of the same."""
        covered = coverage(self.views, self.size)
        empty = [PLACES[i] for i in np.flatnonzero(covered.ravel() == 0)]
        tilts = np.ptp(self._poses, axis=0) if len(self._poses) > 1 else np.zeros(5)
        if tilts[3] < LEAST_TILT:
            return "tilt it more: its left side nearer, then its right side"
        if tilts[4] < LEAST_TILT:
            return "tilt it more: its top nearer, then its bottom"
        if len(empty) > (1 - ENOUGH_COVERED) * len(PLACES):
            return f"show it at the {empty[0]} of the picture"
        if tilts[2] < LEAST_SIZES:
            return "show it from nearer and from farther away"
        return ""

    def _moved(self, outline: Vector) -> float:
        return 0.0 if self._before is None else float(np.abs(outline - self._before).max())


def coverage(views: list[BoardView], size: tuple[int, int]) -> npt.NDArray[np.int64]:
    """Return how many corners lie in each cell of `GRID` over the left picture, int [rows, columns]."""
    columns, rows = GRID
    counts = np.zeros((rows, columns), np.int64)
    for view in views:
        cells = np.clip((view.left / size * GRID).astype(int), 0, (columns - 1, rows - 1))
        np.add.at(counts, (cells[:, 1], cells[:, 0]), 1)
    return counts


def board_outline(board: Board, view: BoardView) -> Vector:
    """Return where the four outer corners of the whole board lie in the left picture [4,2], seen or not."""
    import cv2

    plane, _ = cv2.findHomography(view.board[:, :2], view.left)
    points = board.points()
    columns, rows = board.pattern
    outer = points[[0, columns - 1, rows * columns - 1, (rows - 1) * columns], :2]
    return np.asarray(cv2.perspectiveTransform(outer[None], plane)[0])


def board_pose(outline: Vector, size: tuple[int, int]) -> Vector:
    """Return place (shares of the picture), size and tilt of a board, as `NEW` compares them."""
    ordered = outline[np.argsort(np.arctan2(*(outline - outline.mean(axis=0)).T[::-1]))]  # from the upper left, around
    sides = np.linalg.norm(np.roll(ordered, -1, axis=0) - ordered, axis=1)
    top, right, bottom, left = np.maximum(sides, 1e-6)
    share = np.sqrt(top * right) / size[0]
    return np.array([*(outline.mean(axis=0) / size), np.log(share), np.log(left / right), np.log(top / bottom)])


def edge_width(picture: Picture, corners: Vector) -> float:
    """Return how many px a step from dark to bright takes on the board; a sharp one about 2."""
    import cv2

    low = np.clip(corners.min(axis=0).astype(int), 0, None)
    high = corners.max(axis=0).astype(int) + 1
    part = picture[low[1] : high[1], low[0] : high[0]]
    gray = (part if part.ndim == 2 else cv2.cvtColor(part, cv2.COLOR_RGB2GRAY)).astype(np.float32)
    slope = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0, scale=1 / 8), cv2.Sobel(gray, cv2.CV_32F, 0, 1, scale=1 / 8))
    contrast = float(np.ptp(np.percentile(gray, (5, 95))))
    return contrast / max(float(np.percentile(slope, 98)), 1e-6)
