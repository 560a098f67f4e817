"""One sentence a comparison on whether the paper's claim held: rules on numbers, so that nobody's hope decides."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

Rows = dict[str, dict[str, Any] | None]

NOT_RUN = "not yet run."
SAME_SHARE = 0.05  # errors within five per cent are called equal


def verdict(group: str, rows: Rows) -> str:
    """Judge one group of `GROUPS`; rows by label, None or absent where a run is missing."""
    needed, judge = _RULES[group]
    known = {label: row for label, row in rows.items() if row}
    missing = [label for label in needed if label not in known]
    if missing:
        done = ", ".join(f"{label} {row['epe']:.3f} px" for label, row in known.items() if label in needed)
        return NOT_RUN if not done else f"so far {done}; {', '.join(missing)}: {NOT_RUN}"
    early = [label for label in needed if not known[label].get("complete", True)]
    caution = f" Not final: {', '.join(early)} stopped early." if early else ""
    return judge({label: float(row["epe"]) for label, row in known.items()}, known) + caution


def _table(epe: dict[str, float], rows: dict[str, dict[str, Any]]) -> str:
    best = min(epe, key=lambda name: epe[name])
    slower = [name for name in ("anynet", "psmnet") if rows[name]["ms"] < rows["wang2020"]["ms"]]
    first = "held" if best == "wang2020" else f"did not hold ({best} is first with {epe[best]:.3f} px)"
    speed = "held" if not slower else f"did not hold ({', '.join(slower)} took less time)"
    return f"the claim on error {first}; wang2020 has {epe['wang2020']:.3f} px. The claim on speed {speed}."


def _loss(epe: dict[str, float], _: dict[str, Any]) -> str:
    return _said(epe["lambda 0.5"] < epe["L2"], f"{epe['lambda 0.5']:.3f} px against {epe['L2']:.3f} px with L2")


def _pairs(epe: dict[str, float], _: dict[str, Any]) -> str:
    worse = epe["100 pairs"] > (1 + SAME_SHARE) * epe["800 pairs"]
    enough = epe["900 pairs"] > (1 - SAME_SHARE) * epe["800 pairs"]
    text = ", ".join(f"{label}: {epe[label]:.3f} px" for label in ("100 pairs", "400 pairs", "800 pairs", "900 pairs"))
    return _said(worse and enough, text)


def _range(epe: dict[str, float], _: dict[str, Any]) -> str:
    short = [epe[f"{limit} px"] for limit in (72, 56, 48, 40)]
    text = ", ".join(f"{limit}: {epe[f'{limit} px']:.3f} px" for limit in (192, 72, 56, 48, 40))
    return _said(epe["192 px"] > max(short) and epe["56 px"] == min(short), text)


def _refinement(epe: dict[str, float], _: dict[str, Any]) -> str:
    with_it, without = epe["with refinement"], epe["without refinement"]
    return _said(abs(with_it - without) <= SAME_SHARE * without, f"{with_it:.3f} px with, {without:.3f} px without")


def _said(held: bool, numbers: str) -> str:
    return f"the claim {'held' if held else 'did not hold'}: {numbers}."


_RULES: dict[str, tuple[tuple[str, ...], Callable[[dict[str, float], dict[str, Any]], str]]] = {
    "table1": (("wang2020", "anynet", "psmnet"), _table),
    "loss": (("L2", "lambda 0.5"), _loss),
    "pairs": (("100 pairs", "400 pairs", "800 pairs", "900 pairs"), _pairs),
    "range": (("192 px", "72 px", "56 px", "48 px", "40 px"), _range),
    "refinement": (("with refinement", "without refinement"), _refinement),
}
