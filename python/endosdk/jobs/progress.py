"""A bar for work on many pairs that takes its time."""

from __future__ import annotations

import sys

CELLS = 30


def show_progress(done: int, count: int, seconds: float) -> None:
    """Draw on stderr how many of ``count`` pairs, at least one, are done after so many seconds."""
    left = seconds / done * (count - done)
    bar = "#" * (CELLS * done // count)
    end = "\n" if done == count else ""
    print(f"\r[{bar:{CELLS}}] pair {done} of {count}, {left:.0f} s left   ", end=end, file=sys.stderr, flush=True)
