"""What a program has drawn into both frames of a pair, step by step: the twin of `EqualBlocks` and `Overlays`."""

import numpy as np

DIFFERS, EQUAL, TELLING = range(3)


def side_of(width: int) -> int:
    """Pixels along a side of a block."""
    return max(4, (width + 30) // 60)


def _rows(view: np.ndarray, side: int, x: int, y: int) -> np.ndarray:
    """Return four rows of a block, [4, side, channels]."""
    rows = [y * side + (2 * i + 1) * side // 8 for i in range(4)]
    return view.reshape(*view.shape[:2], -1)[rows, x * side : (x + 1) * side].astype(np.int64)


def equal_blocks(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Marks of blocks, uint8 [blocks down, blocks along]."""
    height, width = left.shape[:2]
    side = side_of(width)
    step = max(1, side // 8)
    marks = np.zeros((height // side, width // side), np.uint8)
    for y, x in np.ndindex(*marks.shape):
        a, b = (_rows(view, side, x, y) for view in (left, right))
        here, there = (view[:, step:] - view[:, :-step] for view in (a, b))
        steep = np.abs(here) >= 60
        repeated = steep & (4 * np.abs(here - there) <= np.abs(here))
        difference = ((a - b) ** 2).sum() / a.size
        texture = min((steps**2).mean() for steps in (here, there))
        rarer = min((steep & (here > 0)).sum(), (steep & (here < 0)).sum())
        if steep.mean() >= 0.06 and rarer >= 0.2 * steep.sum() and repeated.sum() >= 0.8 * steep.sum():
            marks[y, x] = TELLING
        elif difference <= 2 or (texture >= 200 and difference <= 0.015 * texture):
            marks[y, x] = EQUAL
    return marks if (marks == TELLING).any() else np.zeros_like(marks)


def around(y: int, x: int, shape: tuple[int, int]) -> tuple[slice, slice]:
    """Return a block and those around it."""
    return slice(max(0, y - 1), min(y + 2, shape[0])), slice(max(0, x - 1), min(x + 2, shape[1]))


def covered_blocks(marks: np.ndarray, surroundings: np.ndarray) -> np.ndarray:
    """Blocks that an overlay covers, bool. `surroundings`: blocks that the optics do not fill, bool."""
    shape = marks.shape
    telling = np.zeros(shape, bool)
    for at in np.argwhere(marks == TELLING):
        telling[tuple(at)] = not surroundings[around(*at, shape)].any()
    found = np.zeros(shape, bool)
    for at in np.argwhere(telling):
        found[tuple(at)] = telling[around(*at, shape)].sum() >= 2
    while True:
        grown = found.copy()
        for at in np.argwhere(found):
            near = around(*at, shape)
            grown[near] |= (marks[near] != DIFFERS) & ~surroundings[near]
        if (grown == found).all():
            break
        found = grown
    covered = found.copy()
    for at in np.argwhere(found):
        covered[around(*at, shape)] = True
    return covered if covered.mean() <= 0.6 else np.zeros(shape, bool)
