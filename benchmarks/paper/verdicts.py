"""Whether the paper's claims held, one verdict a claim: rules on numbers, so that nobody's hope decides.

Two errors that lie as close as those of one setting trained with two seeds are not told apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from benchmarks.paper.experiments import EXPERIMENTS, LABELS, PROTOCOL, Claim, Experiment, crops, size, unique_runs

Groups = dict[str, dict[str, dict[str, Any] | None]]  # rows by label by group; None where a run is missing

HELD, FAILED, UNDECIDED = "**held**", "**did not hold**", "**undecided**"
# By the relation that is claimed, for an error that is smaller (True), larger (False) or too close to tell (None).
VERDICTS: dict[str, dict[bool | None, str]] = {
    "below": {True: HELD, False: FAILED, None: UNDECIDED},
    "above": {True: FAILED, False: HELD, None: UNDECIDED},
    "not above": {True: HELD, False: FAILED, None: HELD},
    "like": {True: FAILED, False: FAILED, None: HELD},
}
NOT_RUN = "not yet run"
NOT_REPEATED = f"{UNDECIDED}: no setting has been trained with a second seed"


def seed_spread(groups: Groups) -> float | None:
    """By what share of the smaller one two seeds of one setting differ, at most; None when nothing was repeated."""
    found = [_errors(groups, run) for run in _ablations()]
    return max((max(errors) / min(errors) - 1 for errors in found if len(errors) > 1), default=None)


def claim_verdict(group: str, claim: Claim, groups: Groups, pairs: int) -> str:
    """Judge one claim of an ablation that was scored on the first so many test pairs."""
    labels = (claim.run, *claim.others)
    known = {label: row for label in labels if (row := groups.get(group, {}).get(label))}
    if len(known) < len(labels):
        return f"{NOT_RUN}: {', '.join(label for label in labels if label not in known)}."
    early = [f"{label} {_stopped(row)}" for label, row in known.items() if not row["complete"]]
    if early:
        return f"{UNDECIDED}: {', '.join(early)}."
    spread = seed_spread(groups)
    if spread is None:
        return f"{NOT_REPEATED}."
    runs = {run.label: run for run in _ablations(group)}
    errors = {label: _errors(groups, runs[label]) for label in labels}
    orders = [smaller(errors[claim.run], errors[other], spread) for other in claim.others]
    verdict = min((VERDICTS[claim.relation][order] for order in orders), key=(FAILED, UNDECIDED, HELD).index)
    why = f" (closer than {100 * spread:.1f} %)" if None in orders and verdict != FAILED else ""
    windowed = known[claim.run]["refine_crop"] and not known[claim.run].get("refine_margin")
    if not claim.fair_on_windows and windowed:
        verdict, why = UNDECIDED, " (the runs differ in more than that, see below)"
    seen = f"{known[claim.run]['samples_seen']} crops of {size(known[claim.run]['crop'])}"
    numbers = ", ".join(f"{label}: {_listed(found)}" for label, found in errors.items())
    return f"{verdict}{why} after {seen} (the protocol: {crops(PROTOCOL)}), on the first {pairs} test pairs: {numbers}."


def error_verdict(run: str, rival: str, rows: dict[str, dict[str, Any]], spread: float | None) -> str:
    """Judge whether a run of wang2020 has a smaller error than a rival of the same table."""
    if run not in rows:
        return NOT_RUN
    ours, theirs = rows[run], rows[rival]
    errors = f"{ours['epe']:.3f} px against {theirs['epe']:.3f} px"
    order = None if spread is None else smaller([ours["epe"]], [theirs["epe"]], spread)
    # One that is behind and was stopped early could still have come first.
    behind = {True: (rival,), False: (run,), None: (run, rival)}[order]
    early = [f"{LABELS[name]} {_stopped(rows[name])}" for name in behind if not rows[name].get("complete", True)]
    if early:
        return f"{UNDECIDED}: {errors}, {', '.join(early)}"
    return NOT_REPEATED if spread is None else f"{VERDICTS['below'][order]}: {errors}"


def time_verdict(rival: str, rows: dict[str, dict[str, Any]]) -> str:
    """Judge whether wang2020 takes less time than a rival of the same table."""
    ours, theirs = rows["wang2020"]["ms"], rows[rival]["ms"]
    if rows["wang2020"].get("timed_on") != rows[rival].get("timed_on"):
        return f"{UNDECIDED}: they were timed on two machines"
    return f"{HELD if ours < theirs else FAILED}: {ours:.1f} ms against {theirs:.1f} ms"


def smaller(errors: Sequence[float], others: Sequence[float], spread: float) -> bool | None:
    """Whether all errors of one setting are smaller than all of another; None where they are too close to tell."""
    if max(errors) * (1 + spread) < min(others):
        return True
    if max(others) * (1 + spread) < min(errors):
        return False
    return None


def _ablations(group: str | None = None) -> list[Experiment]:
    """Every ablation once, or those of a group, in which a run that groups share has another label."""
    runs = unique_runs() if group is None else [run for run in EXPERIMENTS if run.group == group]
    return [run for run in runs if run.group != "table1"]


def _errors(groups: Groups, run: Experiment) -> list[float]:
    """Errors of a setting, px, one for each seed with which it was trained to the end."""
    seeds = [other for other in _ablations() if _setting(other) == _setting(run)]
    rows = [groups.get(other.group, {}).get(other.label) for other in seeds]
    return [float(row["epe"]) for row in rows if row and row["complete"]]


def _setting(run: Experiment) -> dict[str, Any]:
    return {name: value for name, value in run.changes.items() if name != "seed"}


def _listed(errors: list[float]) -> str:
    seeds = "1 seed" if len(errors) == 1 else f"{len(errors)} seeds"
    return f"{' and '.join(f'{error:.3f}' for error in errors)} px ({seeds})"


def _stopped(row: dict[str, Any]) -> str:
    return f"stopped early, after {row['samples_seen']} of {row['samples_planned']} crops"
