"""What a run's notes tell of the runs that it goes back to: their steps, and the pairs that they learned from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from endosdk.errors import InvalidArgument

MOST_RUNS = 20  # that the notes of a run tell of: what nests much deeper is refused when it is read


def runs_before(origin: dict[str, Any] | None) -> Iterator[dict[str, Any]]:
    """Yield the notes of a run's beginning, the latest run first, as far back as they are kept."""
    while origin is not None:
        yield origin
        origin = origin.get("init")


def steps_of(origin: dict[str, Any] | None) -> int:
    """Return the steps of a run's notes, and of those of every run that it goes back to."""
    return sum(int(run["steps"]) for run in runs_before(origin))


def with_oldest_joined(origin: dict[str, Any], most: int = MOST_RUNS) -> dict[str, Any]:
    """Return notes of at most so many runs: the last of them counts the steps of all that lie before it."""
    before = origin.get("init")
    if before is None:
        return origin
    if most == 1:
        return {**origin, "steps": steps_of(origin), "init": None, "joined": "steps of older runs are among these"}
    return {**origin, "init": with_oldest_joined(before, most - 1)}


def splits_of(note: dict[str, Any]) -> list[str]:
    """Return the hashes of the training splits that a note on data names; one that counts twice stands there twice."""
    return note.get("splits") or [note["sha256"]]


def check_held_out(origin: dict[str, Any], note: dict[str, Any], held_out: int) -> None:
    """Refuse to hold out what a run before has learned from: errors there would be too small, and doubts too.

    ``note`` is on the data of the run that begins, ``held_out`` its pairs of each set. Raises InvalidArgument.
    """
    own = set(splits_of(note))
    for run in runs_before(origin):
        splits, kept = splits_of(run["data"]), run["data"].get("held_out")
        if kept is None or own.isdisjoint(splits):  # older notes do not say all
            continue
        most = kept // len(splits)
        # Of a film, all frames or none are held out: there may be fewer than were asked for.
        if min(held_out, note.get("held_out", held_out * len(own)) // len(own)) > most:
            rule = f"must be at most {most}: the run that this one begins from learned from the other pairs"
            raise InvalidArgument("held_out", rule, held_out)
