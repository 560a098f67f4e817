"""Boards of known size, chessboard and ChArUco, and their corners in a picture."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk.errors import InvalidArgument

Points = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]

MIN_CORNERS = 3  # along each side, the least that OpenCV's detector takes
MIN_SHARED = 8  # corners of a ChArUco board that both views must show
# Half the side of the window in which a corner is refined, as a share of the least distance between two corners: within
# it, a corner has its own two edges alone.
WINDOW = 0.5
REFINED = 100, 1e-4  # most steps, and the step in px that ends them
DICTIONARIES = ("4X4_50", "4X4_100", "4X4_250", "5X5_100", "5X5_250", "6X6_250", "APRILTAG_36h11")


@dataclass(frozen=True)
class Board:
    """A flat board with (columns, rows) of inner corners; with ``marker_mm`` a ChArUco board, else a chessboard.

    A ChArUco board may be seen in part, which is what the edge of an endoscope's view needs. ``marker_mm`` is the side
    of a marker, ``dictionary`` the set it is from, under OpenCV's name.
    """

    pattern: tuple[int, int]
    square_mm: float
    marker_mm: float | None = None
    dictionary: str = "4X4_50"

    def __post_init__(self) -> None:
        if min(self.pattern) < MIN_CORNERS:
            rule = f"must be at least {MIN_CORNERS} x {MIN_CORNERS} inner corners"
            raise InvalidArgument("pattern", rule, self.pattern)
        if not self.square_mm > 0:
            raise InvalidArgument("square_mm", "must be positive", self.square_mm)
        if self.marker_mm is not None and not 0 < self.marker_mm < self.square_mm:
            rule = f"must be positive and less than a square, {self.square_mm:g}"
            raise InvalidArgument("marker_mm", rule, self.marker_mm)
        if self.dictionary not in DICTIONARIES:
            raise InvalidArgument("dictionary", f"must be one of {', '.join(DICTIONARIES)}", self.dictionary)

    def points(self) -> Points:
        """Return all inner corners [N,3], mm, in the order of their numbers."""
        columns, rows = self.pattern
        corners = np.zeros((rows * columns, 3))
        corners[:, 0] = np.tile(np.arange(columns), rows)
        corners[:, 1] = np.repeat(np.arange(rows), columns)
        return corners * self.square_mm

    def picture(self, pixels_per_mm: float) -> Picture:
        """Return the board as it is printed, with a margin of one square, uint8 [H,W]."""
        side = round(self.square_mm * pixels_per_mm)
        columns, rows = (n + 1 for n in self.pattern)
        if self.marker_mm is not None:
            size = (columns + 2) * side, (rows + 2) * side
            return np.asarray(self._charuco(self.marker_mm).generateImage(size, marginSize=side), np.uint8)
        squares = np.indices((rows, columns)).sum(axis=0) % 2 * 255
        return np.asarray(np.pad(np.kron(squares, np.ones((side, side))), side, constant_values=255), np.uint8)

    def _charuco(self, marker_mm: float) -> Any:
        import cv2

        words = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{self.dictionary}"))
        columns, rows = (n + 1 for n in self.pattern)
        needed, there = columns * rows // 2, len(words.bytesList)
        if needed > there:
            raise InvalidArgument(
                "dictionary", f"must have {needed} markers for this board", f"{self.dictionary}: {there}"
            )
        return cv2.aruco.CharucoBoard((columns, rows), self.square_mm, marker_mm, words)

    def _refined(self, gray: Picture, corners: npt.NDArray[np.float32]) -> Points:
        """Return where the edges cross. The detector's corners of a tilted board are off, all to the same side.

        Left as they are, they make the focal length of a rendered rig 0.5 % too long.
        """
        import cv2

        columns, rows = self.pattern
        grid = corners.reshape(rows, columns, 2)
        apart = min(float(np.linalg.norm(np.diff(grid, axis=axis), axis=2).min()) for axis in (0, 1))
        reach = max(2, int(WINDOW * apart))
        stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, *REFINED)
        refined = cv2.cornerSubPix(gray, corners.reshape(-1, 1, 2), (reach, reach), (-1, -1), stop)
        return np.asarray(refined, np.float64).reshape(-1, 2)

    def find(self, picture: Picture) -> dict[int, Points]:
        """Return the pixel of every corner that a picture shows, by its number; nothing where there is no board.

        A chessboard is found whole or not at all, which takes seconds at 1920x1080.
        """
        import cv2

        gray = np.asarray(picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY), np.uint8)
        if self.marker_mm is None:
            found, corners = cv2.findChessboardCornersSB(gray, self.pattern, flags=cv2.CALIB_CB_ACCURACY)
            return dict(enumerate(self._refined(gray, np.asarray(corners, np.float32)))) if found else {}
        corners, numbers, *_ = cv2.aruco.CharucoDetector(self._charuco(self.marker_mm)).detectBoard(gray)
        if numbers is None:
            return {}
        places = np.asarray(corners, np.float64).reshape(-1, 2)
        return {int(number): place for number, place in zip(np.ravel(numbers), places, strict=True)}


@dataclass(frozen=True, eq=False)
class BoardView:
    """One pair that shows the board: corners [N,3] in mm and where both views show them [N,2]."""

    name: str
    board: Points
    left: Points
    right: Points

    @property
    def count(self) -> int:
        """How many corners both views show."""
        return len(self.board)


def find_view(board: Board, name: str, left: Picture, right: Picture) -> BoardView | str:
    """Return the corners that both views show, or why there are none."""
    found = [board.find(picture) for picture in (left, right)]
    shared = sorted(found[0].keys() & found[1].keys())
    if board.marker_mm is None and len(shared) == 0:
        side = "either view" if not found[0] and not found[1] else "the left view" if not found[0] else "the right view"
        return f"no whole board in {side}"
    if board.marker_mm is not None and len(shared) < MIN_SHARED:
        return f"both views show {len(shared)} of the same corners; {MIN_SHARED} are needed"
    corners = [np.array([side[number] for number in shared]) for side in found]
    points = board.points()[shared]
    if np.linalg.matrix_rank(points - points.mean(axis=0), tol=1e-6) < 2:
        return "the corners that both views show lie on one line"
    if board.marker_mm is None:
        corners[1] = same_order(corners[0], corners[1])
    return BoardView(name, points, corners[0], corners[1])


def same_order(left: Points, right: Points) -> Points:
    """Return the right corners in the order of the left ones.

    A board with an even number of corner rows and columns looks the same upside down, so the detector may start at the
    opposite corner in one view. The views of a stereo rig are never turned against each other, which decides it.
    """
    aligned = np.dot(left[-1] - left[0], right[-1] - right[0]) > 0
    return right if aligned else right[::-1].copy()
