"""A pair as a source yielded it, checked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple, Protocol, runtime_checkable

from endosdk.errors import InvalidArgument, typed_memory_errors
from endosdk.runtime.arguments import Picture, check_pair, check_stamp

SOURCE_PATIENCE_S = 0.2  # how long closing waits for a source that is asked for a pair and does not answer


@runtime_checkable
class StereoFrame(Protocol):
    """A pair as `open_source` yields it: RGB or gray, whatever order of channels the estimator has."""

    @property
    def left(self) -> Any:
        """The left view."""

    @property
    def right(self) -> Any:
        """The right view."""

    @property
    def monotonic_ns(self) -> int | None:
        """When it was taken, by the clock of ``time.monotonic_ns()``; None where nobody knows."""


class Drawn(NamedTuple):
    """A pair that was drawn from a source."""

    left: Picture
    right: Picture
    stamp_ns: int  # 0 where nobody said
    frame: Any  # as `open_source` yielded it; None for a pair
    dropped: int = 0  # pairs between the one before and this one that were not taken

    @typed_memory_errors()
    def kept(self) -> Drawn:
        """Return the pair in memory of its own: a source may overwrite one when it is asked for the next."""
        return self if self.frame is not None else self._replace(left=self.left.copy(), right=self.right.copy())


@typed_memory_errors()
def checked(item: Any, channel_order: str) -> Drawn:
    """Return what a source yielded as a stream takes it. Raises InvalidArgument where that cannot be."""
    if isinstance(item, StereoFrame):
        views = check_pair(item.left, item.right)
        if channel_order == "bgr" and all(view.ndim == 3 for view in views):
            views = check_pair(*(view[..., ::-1] for view in views))
        return Drawn(*views, check_stamp(item.monotonic_ns), item)
    if not isinstance(item, tuple | list) or len(item) not in (2, 3):
        rule = "must yield (left, right), (left, right, stamp_ns) or frames of open_source"
        count = f" of {len(item)}" if isinstance(item, tuple | list) else ""
        raise InvalidArgument("source", rule, type(item).__name__ + count)
    return Drawn(*check_pair(*item[:2]), check_stamp(item[2] if len(item) == 3 else None), None)


def drawn_from(function: Callable[[], Any]) -> Iterator[Any]:
    """Yield what a function returns until it returns None, or until an iterator that it draws from ends."""
    # Not iter(function, None), which would compare what the function returns, an array perhaps, with None.
    with suppress(StopIteration):
        while (pair := function()) is not None:
            yield pair
