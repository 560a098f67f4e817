"""Whether the paper's claims held, one verdict a claim: rules on numbers, so that nobody's hope decides.

A verdict is held, did not hold or undecided. Two errors that lie as close as those of one setting trained twice are not
told apart; how close that is must be known from enough settings, or nothing is decided.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from statistics import mean
from typing import Any, NamedTuple

from benchmarks.paper.experiments import (
    EXPERIMENTS,
    LABELS,
    PAPER_PROTOCOL,
    TARGET_EPE_PX,
    Claim,
    Experiment,
    unique_runs,
)

Rows = dict[str, dict[str, Any]]  # by the name of the run; what has not been run is missing

HELD, FAILED, UNDECIDED = "held", "did not hold", "undecided"
NOT_RUN, NOT_MEASURED = "not run", "not measured"
TOO_CLOSE = "closer than two runs of one setting"
OTHER_MACHINE, UNKNOWN_MACHINE = "timed on two machines", "machine not recorded"
ENOUGH_SETTINGS = 5
LITTLE = 0.10  # what "differ little" and "almost the same" mean here; the paper gives no number
# By the relation that is claimed, for a measure that is smaller (True), larger (False) or too close to tell (None).
RELATIONS: dict[str, dict[bool | None, str]] = {
    "below": {True: HELD, False: FAILED, None: UNDECIDED},
    "above": {True: FAILED, False: HELD, None: UNDECIDED},
    "like": {True: HELD, False: FAILED, None: UNDECIDED},
}


class Bound(NamedTuple):
    """How far two runs of one setting differ at most, as a share of the smaller, and over how many settings."""

    share: float
    settings: int

    @property
    def known(self) -> bool:
        """Whether it is known well enough to decide by."""
        return self.settings >= ENOUGH_SETTINGS

    @property
    def lacking(self) -> str:
        """How many settings were repeated, and how many must be."""
        return f"{self.settings} of {ENOUGH_SETTINGS} settings repeated"


class Verdict(NamedTuple):
    """One claim as the runs decide it: the word, the numbers that decide, and why nothing is decided."""

    word: str
    numbers: str = ""
    why: str = ""


def repeats(rows: Rows, measure: str = "epe", least_pairs: int = 0) -> dict[str, float]:
    """Return, by the first run of each setting that was repeated, by what share its complete runs differ.

    Settings with fewer training pairs than ``least_pairs`` are left out.
    """
    found = {run.name: _values(rows, run, measure) for run in _one_a_setting() if run.pairs >= least_pairs}
    return {name: max(values) / min(values) - 1 for name, values in found.items() if len(values) > 1}


def repeat_bound(rows: Rows, measure: str = "epe", least_pairs: int = 0) -> Bound:
    """Return by what share two complete runs that differ in their seed alone differ, at most.

    Runs with few pairs differ more. So it is that of settings with at least ``least_pairs``. While these are too few,
    those with the next fewer pairs count as well.
    """
    volumes = sorted({run.pairs for run in EXPERIMENTS if run.pairs < least_pairs}, reverse=True)
    found = repeats(rows, measure, least_pairs)
    for fewer in volumes:
        if len(found) >= ENOUGH_SETTINGS:
            break
        found = repeats(rows, measure, fewer)
    return Bound(max(found.values(), default=0.0), len(found))


def claim_verdict(group: str, claim: Claim, rows: Rows) -> Verdict:
    """Judge one claim of an ablation."""
    runs = {run.label: run for run in EXPERIMENTS if run.group == group}
    labels = (claim.run, *claim.others)
    missing = [label for label in labels if runs[label].name not in rows]
    if missing:
        return Verdict(NOT_RUN, why=f"lacks {'; '.join(missing)}")
    first = {label: rows[runs[label].name] for label in labels}
    early = [f"{label} {_stopped(row)}" for label, row in first.items() if not row["complete"]]
    if early:
        return Verdict(UNDECIDED, why="; ".join(early))
    values = {label: _values(rows, runs[label], claim.measure) for label in labels}
    if not all(values.values()):
        return Verdict(
            NOT_MEASURED, why=f"no number of {'; '.join(label for label, found in values.items() if not found)}"
        )
    # Those of the largest volume, too, have learned from as many pairs as the others and the test pairs.
    least = min(PAPER_PROTOCOL["train_pairs"], *(runs[label].pairs for label in labels))
    bound = repeat_bound(rows, claim.measure, least)
    numbers = "; ".join(f"{label}: {_said(found)}" for label, found in values.items())
    if not bound.known:
        return Verdict(UNDECIDED, numbers, bound.lacking)
    compare = alike if claim.relation == "like" else smaller
    orders = [compare(values[claim.run], values[other], bound.share) for other in claim.others]
    word = min((RELATIONS[claim.relation][order] for order in orders), key=(FAILED, UNDECIDED, HELD).index)
    return Verdict(word, numbers, TOO_CLOSE if word == UNDECIDED else "")


def error_verdict(run: str, other: str, rows: Rows, bound: Bound) -> Verdict:
    """Judge whether a run of wang2020 has a smaller error than another method of the same table."""
    if run not in rows or other not in rows:
        return Verdict(NOT_RUN)
    ours, theirs = ([row["epe"] for row in _with_seeds(name, rows)] for name in (run, other))
    numbers = f"{_said(ours)} against {_said(theirs)}"
    order = smaller(ours, theirs, bound.share) if bound.known else None
    # One that is behind and was stopped early could still have come first.
    behind = {True: (other,), False: (run,), None: (run, other)}[order]
    early = [f"{LABELS[name]} {_stopped(rows[name])}" for name in behind if not rows[name].get("complete", True)]
    if early:
        return Verdict(UNDECIDED, numbers, "; ".join(early))
    if not bound.known:
        return Verdict(UNDECIDED, numbers, bound.lacking)
    return Verdict(RELATIONS["below"][order], numbers, TOO_CLOSE if order is None else "")


def time_verdict(run: str, other: str, rows: Rows) -> Verdict:
    """Judge whether wang2020 takes less time than another method of the same table."""
    if run not in rows or other not in rows:
        return Verdict(NOT_RUN)
    ours, theirs = rows[run]["ms"], rows[other]["ms"]
    numbers = f"{ours:.1f} against {theirs:.1f}"
    processors = [_processor(rows[name]) for name in (run, other)]
    if any(None in one for one in processors):
        return Verdict(UNDECIDED, numbers, UNKNOWN_MACHINE)
    if processors[0] != processors[1]:
        return Verdict(UNDECIDED, numbers, OTHER_MACHINE)
    return Verdict(HELD if ours < theirs else FAILED, numbers)


def _processor(row: dict[str, Any]) -> tuple[Any, Any]:
    timed = row.get("timed_on") or {}
    return timed.get("cpu"), timed.get("instructions")


class Order(NamedTuple):
    """One thing that the pictures of Fig. 6 show, as a measure that grows along a row of methods."""

    text: str
    measure: str
    methods: tuple[str, ...]


# Blur is taken as the error near depth edges; noise as how much the error changes from pixel to pixel on one surface.
FIGURE_ORDERS = (
    Order("ours is sharper than AnyNet", "edges", ("paper-192", "anynet-published")),
    Order("ours is sharper than PSMNet", "edges", ("paper-192", "psmnet")),
    Order("PatchMatch has more noise than ours, StereoSGBM more still", "noise", ("paper-192", "patchmatch", "sgbm")),
)


def order_verdict(order: Order, rows: Rows, bound: Bound) -> Verdict:
    """Judge whether a measure grows along the methods as it does in the paper's pictures."""
    missing = [LABELS[name] for name in order.methods if name not in rows]
    if missing:
        return Verdict(NOT_RUN, why=f"lacks {'; '.join(missing)}")
    values = [_measured(rows[name], order.measure) for name in order.methods]
    unknown = [LABELS[name] for name, value in zip(order.methods, values, strict=True) if value is None]
    if unknown:
        return Verdict(NOT_MEASURED, why=f"no number of {'; '.join(unknown)}")
    numbers = "; ".join(f"{LABELS[name]}: {value:.3f}" for name, value in zip(order.methods, values, strict=True))
    if not bound.known:
        return Verdict(UNDECIDED, numbers, bound.lacking)
    steps = [smaller([a], [b], bound.share) for a, b in pairwise(value for value in values if value is not None)]
    word = min((RELATIONS["below"][step] for step in steps), key=(FAILED, UNDECIDED, HELD).index)
    return Verdict(word, numbers, TOO_CLOSE if word == UNDECIDED else "")


def target_verdict(reached: float) -> Verdict:
    """Judge whether our own recipe reached its target, and by which margin."""
    margin = reached / TARGET_EPE_PX - 1
    return Verdict(
        HELD if margin <= 0 else FAILED, f"{reached:.4f}, target {TARGET_EPE_PX:.2f} ({100 * margin:+.1f} %)"
    )


def _measured(row: dict[str, Any], measure: str) -> float | None:
    """Return a measure of a row, or the error on the part of the pixels that has this name."""
    part: dict[str, float] = row.get("parts", {}).get(measure, {})
    return part["epe"] if part else row.get(measure)


def smaller(values: Sequence[float], others: Sequence[float], share: float) -> bool | None:
    """Whether all values of one setting are smaller than all of another; None where they are too close to tell."""
    if max(values) * (1 + share) < min(others):
        return True
    if max(others) * (1 + share) < min(values):
        return False
    return None


def alike(values: Sequence[float], others: Sequence[float], share: float) -> bool | None:
    """Whether the means of two settings differ by `LITTLE` at most; None where two runs differ by as much."""
    ratio = max(mean(values), mean(others)) / min(mean(values), mean(others))
    if ratio * (1 + share) <= 1 + LITTLE:
        return True
    return False if ratio > (1 + LITTLE) * (1 + share) else None


def _one_a_setting() -> list[Experiment]:
    return list({run.setting: run for run in reversed(unique_runs())}.values())


def _values(rows: Rows, run: Experiment, measure: str) -> list[float]:
    """Return a measure of a setting, once for each seed with which it was trained to the end."""
    seeds = [rows[other.name] for other in unique_runs() if other.setting == run.setting and other.name in rows]
    return [value for row in seeds if row["complete"] and (value := _measured(row, measure))]


def _with_seeds(name: str, rows: Rows) -> list[dict[str, Any]]:
    """Return the row of a method, and those of its further seeds that were trained to the end."""
    more = [row for other, row in rows.items() if other.startswith(f"{name}-seed") and row["complete"]]
    return [rows[name], *more]


def _said(values: list[float]) -> str:
    return ", ".join(f"{value:.3f}" if value >= 0.1 else f"{value:.3g}" for value in values)


def _stopped(row: dict[str, Any]) -> str:
    return f"stopped at {row['samples_seen']} of {row['samples_planned']} samples"
