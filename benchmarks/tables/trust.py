"""What the status, the causes and the valid pixels of a frame are worth, and what each of them means."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from statistics import median
from typing import Any

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table
from endosdk import _core

# Kinds of pairs, as a record and as a page name them.
PAIRS = {"clean": "clean", "further": "further clean", "spoilt": "degraded"}
TRUST_PAGE = ("fast", "accurate")  # models of which the page of trust has all cases
# Sets of pairs by the names of their records, as the page calls them.
TRUST_SETS = {
    "trust": "path-traced",
    "trust_lap": "surgery with image faults, `endosim-lap`",
    "trust_middlebury": "real scenes, Middlebury",
}
CARD_CASES = ("clean", "noise of 12 grey levels", "JPEG of quality 20")


def trust_table(model: str) -> str:
    """What a model says of clean, spoilt and faulty pairs."""
    record = records.read("accuracy/trust")["models"][model]
    rows = []
    for case, found in record["cases"].items():
        keys = ("right_called_valid", "wrong_called_valid", "wrong_of_valid", "within_sigma", "named")
        right, wrong, of_valid, within, named = (found.get(key) for key in keys)
        # Where all depths are off, what is called right tells nothing. How many of the valid ones are wrong does.
        if named is not None:
            right, wrong, within = None, None, within if _usable(found) else None
        rows.append([case, _frames(found["status"]), *map(_percent, (right, wrong, of_valid, within, named))])
    heads = [records.marked("pairs", record["model_sha256"]), "frames", "right pixels valid", "wrong pixels valid"]
    return table([*heads, "valid pixels that are wrong", "error within sigma", "cause named"], rows)


def _usable(found: Mapping[str, Any]) -> bool:
    """Whether one of the frames may be used."""
    return set(found["status"]) != {"INVALID"}


def _percent(share: float | None) -> str:
    return "" if share is None else percent(share)


def min_confidence_table() -> str:
    """What another `min_confidence` gives: valid among right and wrong pixels, of clean pairs and of spoilt ones."""
    measured = records.read("accuracy/trust")["models"]
    models = {name: measured[name] for name in TRUST_PAGE}
    kinds = {name: [f["called_valid_by_min_confidence"] for f in _usable_cases(one)] for name, one in models.items()}
    rows = []
    for threshold in next(iter(kinds.values()))[0]:
        row = [threshold]
        for clean, *spoilt in kinds.values():
            for kind in ("right", "wrong"):
                row += [percent(clean[threshold][kind]), percent(median(one[threshold][kind] for one in spoilt))]
        rows.append(row)
    heads = [
        f"{records.marked(name, one['model_sha256'])}, {kind}, {pairs}"
        for name, one in models.items()
        for kind in ("right", "wrong")
        for pairs in ("clean", "degraded")
    ]
    return table(["`min_confidence`", *heads], rows)


def _usable_cases(record: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a record of trust says of pairs without a fault, the clean ones first."""
    return [found for found in record["cases"].values() if "named" not in found]


def trust_sets_table() -> str:
    """How far `fast` and `accurate` can be trusted on each set: clean, and as the median over poor images."""
    rows = []
    for name, said in TRUST_SETS.items():
        for model, record in records.read(f"accuracy/{name}")["models"].items():
            if model not in TRUST_PAGE:
                continue
            clean, *poor = _usable_cases(record)
            for pairs, some in (("as they are", [clean]), ("with poor images", poor)):
                of_wrong = (
                    _percent(median(one[key] for one in some))
                    for key in ("right_called_valid", "wrong_called_valid", "wrong_of_valid", "confidence_ece")
                )
                label = records.marked(f"{said}, {pairs}", record["model_sha256"])
                rows.append([label, model, *of_wrong, f"{median(one['ause'] for one in some):.2f}"])
    heads = ["pairs", "model", "right pixels valid", "wrong pixels valid", "valid pixels that are wrong"]
    return table([*heads, "confidence is off by", "AUSE"], rows)


def fault_naming_table() -> str:
    """How often a fault's cause was named, in pairs of each kind; frames without one are counted over whole sets."""
    record = records.read("accuracy/fault_naming")
    sets = {name: found["pairs"] for name, found in record["datasets"].items()}
    kinds = [kind for kind in PAIRS if kind in sets.values()]

    def of(counted: Mapping[str, int]) -> list[int]:
        return [sum(count for name, count in counted.items() if sets[name] == kind) for kind in kinds]

    plain = record["without_fault"] | record.get("further", {})
    whole = of({name: found["frames"] for name, found in plain.items()})
    not_ok = of({name: found["frames"] - found["status"].get("OK", 0) for name, found in plain.items()})
    faults = record["faults"]
    frames = of({name: one["frames"] for name, one in next(iter(faults.values()))["sets"].items()})
    shown = [
        f"{alarms}" if all_ == some else f"{alarms} of {all_}"
        for alarms, all_, some in zip(not_ok, whole, frames, strict=True)
    ]
    rows = [["none: frames that are not OK", *shown]]
    for fault, found in faults.items():
        rows.append([fault, *map(str, of({name: one["named"] for name, one in found["sets"].items()}))])
    label = records.marked("fault", record["model_sha256"])
    heads = [f"of {some} {PAIRS[kind]} pairs" for kind, some in zip(kinds, frames, strict=True)]
    return table([label, *heads], rows)


def card_trust_table(model: str) -> str:
    """How far a model can be trusted on clean and on degraded pairs, and how often faults are named."""
    record = records.read("accuracy/trust")["models"][model]
    rows = []
    for case in CARD_CASES:
        found = record["cases"][case]
        shares = (found["right_called_valid"], found["wrong_called_valid"], found["within_sigma"])
        rows.append([records.marked(case, record["model_sha256"]), _frames(found["status"]), *map(percent, shares)])
    faults = [found for found in record["cases"].values() if "named" in found]
    status: Counter[str] = Counter()
    for found in faults:
        status.update(found["status"])
    named = percent(sum(found["named"] for found in faults) / len(faults))
    label = f"{len(faults)} kinds of faults, named in {named}"
    rows.append([records.marked(label, record["model_sha256"]), _frames(status), "", "", ""])
    return table(["pairs", "frames", "right pixels valid", "wrong pixels valid", "error within sigma"], rows)


def _frames(status: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(status.items()))


def causes_table() -> str:
    """The causes of a frame, as the core has them: what is measured, what follows, what to do."""

    def limit(fact: Any, level: str) -> str:
        value = fact[level]
        side = "from" if fact["bad"] == "high" else "below"
        return "never" if math.isnan(value) else f"{side} {value:g}"

    rows = [
        [
            f"{cause.value} {cause.name}",
            fact["meaning"],
            fact["measure"],
            limit(fact, "degraded"),
            limit(fact, "invalid"),
            fact["remedy"],
        ]
        for cause, fact in _core.cause_facts.items()
    ]
    return table(["cause", "what it means", "what is measured", "DEGRADED", "INVALID", "what to do"], rows)


def reasons_table() -> str:
    """The reasons of a pixel, as the core has them."""
    return table(
        ["bit", "reason", "what it means"],
        [[str(reason.value), f"`{reason.name}`", reason.__doc__ or ""] for reason in _core.Reason],
    )
