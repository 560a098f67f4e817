"""The one progress bar: on a terminal it draws itself on stderr, in a pipe it is quiet."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import Any

from tqdm import tqdm


def progress(
    items: Iterable[Any] | None = None,
    *,
    total: int | None = None,
    done: int = 0,
    unit: str = "pair",
    title: str | None = None,
    shown: bool = True,
    stays: bool = True,
) -> tqdm[Any]:
    """Return a bar to loop over, or to ``update`` by hand.

    ``done`` of ``total`` were done before; a bar that ``stays`` is left on the terminal when it ends.
    """
    return tqdm(
        items,
        total=total,
        initial=done,
        unit=unit,
        desc=title,
        leave=stays,
        disable=None if shown else True,  # None: quiet where stderr is no terminal
        file=sys.stderr,
        smoothing=0.1,
        dynamic_ncols=True,
    )
