"""What a reader must know beside the numbers: what each row was given, where settings come from, what has changed.

Sentences on numbers follow from the records; where they do not tell, the sentence is left out or says so.
"""

from __future__ import annotations

from typing import Any

from benchmarks.paper.experiments import COMPARED, FRAME, LABELS, TARGET_EPE_PX, crops, size
from benchmarks.paper.verdicts import FAILED, HELD, Bound
from endosdk.runtime.models import read_model, shipped_models

LISTED = 8  # ids of pairs that a sentence names
UNKNOWN = "not recorded"

# What this report does otherwise than the one before it, and why.
CHANGED = (
    "The paper's own protocol is an experiment of its own: whole frames, 16 passes over 800 pairs, planes up to and "
    "including D, the loss at both stages, no augmentation. What was called its recipe had its loss and its optimiser "
    "alone, on crops with strong augmentation, and has that name now.",
    "AnyNet is as published: gates that are always normalised, bilinear upsampling, a propagation that starts to learn "
    "late and computes in 32-bit floats. Its error in the last report came from a training of 10 TMAC.",
    "PSMNet is planned to the end of its samples, and StereoSGBM is searched over its costs P1 and P2 and its "
    "pre-filter too, each form on its own.",
    "The ablations are those of the paper: passes instead of a fixed number of crops, the test pairs as the fourth "
    "volume, whole widths for every range, the refinement compared across volumes. The earlier ones stand at the end.",
    "A verdict needs to know by how much two runs of one setting differ, from five settings. The last report took two "
    "for enough.",
)


def given(name: str, row: dict[str, Any]) -> str:
    """Say what a row was given: precision, samples, products, hours and seed."""
    if "samples_seen" in row:
        return _trained(row)
    if row.get("trained_on"):
        version = f"version {row['version']}{'' if still_ships(name, row) else ' (a file that no longer ships)'}"
        data = row["trained_on"]
        note = f"a recipe of our own, {version}, last on {data['name']}, {data['pairs']} pairs"
        return note + ("; joint bilateral upsampling by the left view" if row.get("output_stride", 1) > 1 else "")
    return "no training"


def _trained(row: dict[str, Any]) -> str:
    seen = crops(row["samples_seen"], row["crop"])
    if not row["complete"]:
        seen = f"**stopped early: {row['samples_seen']} of {crops(row['samples_planned'], row['crop'])}**"
    if row["refine_crop"]:
        seen += f", the refinement on {size(row['refine_crop'])} of each"
    hours = f"{row['hours']:.2f} hours" if row.get("hours") is not None else f"hours {UNKNOWN}"
    parts = [
        seen,
        f"{row['training_tmacs']:.0f} TMAC",
        hours,
        row.get("precision") or f"precision {UNKNOWN}",
        f"seed {row.get('seed', 0)}",  # older records name none: every run had the seed of the protocol
    ]
    if row.get("rate_restarts"):
        parts.append(f"the rate was raised again after step {', '.join(map(str, row['rate_restarts']))}")
    return ", ".join(parts)


def still_ships(name: str, row: dict[str, Any]) -> bool:
    """Whether the file of a row of a shipped model is the one that ships; a row without a hash is from before it."""
    model = name.removeprefix("shipped-")
    return model in shipped_models() and row.get("model_sha256") == read_model(model).sha256


def learned_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say how large the error is on pairs that the runs have learned from."""
    said = [
        f"{LABELS[name]} {row['train_epe']:.3f} px on {row['train_pairs_scored']} of them against {row['epe']:.3f} px"
        for name, row in rows.items()
        if row.get("train_epe") is not None and name in LABELS
    ]
    if not said:
        return ""
    return (
        "The paper calls 0.41 px its test error in the table and its training error in the introduction. So here is "
        f"the error on training pairs, whole frames, beside that on test pairs: {'; '.join(said)}."
    )


def stages_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say what AnyNet answers at each of its stages."""
    said = [
        f"{LABELS[name]}: {', '.join(f'{error:.3f}' for error in row['stages'])} px"
        for name, row in rows.items()
        if row.get("stages") and name in LABELS
    ]
    return f"Test error after each stage, from the first to the last. {'; '.join(said)}." if said else ""


def shipped_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say in which columns wang2020 as shipped is first among the other methods of its table, and what each took."""
    ours = rows.get("shipped-wang2020")
    compared = {name: rows[name] for name in COMPARED if name in rows}
    if ours is None or not compared:
        return ""
    columns = {"in the mean": [row["epe"] for row in (ours, *compared.values())]}
    for limit in ours["kpe"]:
        columns[f"over {limit} px"] = [row["kpe"][limit] for row in (ours, *compared.values())]
    behind = {
        label: [LABELS[name] for name, error in zip(compared, others, strict=True) if error <= own]
        for label, (own, *others) in columns.items()
    }
    among = "; ".join(f"{LABELS[name]} ({given(name, row)})" for name, row in compared.items())
    note = f"As shipped ({given('shipped-wang2020', ours)}), wang2020 is"
    first = [label for label, names in behind.items() if not names]
    if len(first) == len(columns):
        return f"{note} first in every error column among {among}."
    places = [f"first {', '.join(first)}"] if first else []
    places += [f"behind {' and '.join(names)} {label}" for label, names in behind.items() if names]
    return f"{note}, among {among}: {'; '.join(places)}."


def cause_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say what the loss and the optimiser of its paper cost wang2020, and what a network ahead of it took."""
    paper, changed = rows.get("wang2020"), rows.get("wang2020-adam")
    if not paper or not changed:
        return ""
    note = (
        f"By our protocol, with the other networks' loss and optimiser in place of its paper's and all else alike, "
        f"wang2020 ends at {changed['epe']:.3f} px, not {paper['epe']:.3f}."
    )
    for name in COMPARED:
        row = rows.get(name, {})
        if row.get("training_tmacs") and row["epe"] < changed["epe"]:
            dearer, slower = row["training_tmacs"] / changed["training_tmacs"], row["ms"] / changed["ms"]
            note += (
                f" {LABELS[name]} stays ahead: its training on {row['samples_seen']} crops took {dearer:.1f} times "
                f"the products of wang2020's on {changed['samples_seen']}, a frame {slower:.0f} times the time."
            )
    return note


def target_note(version: str, reached: float, bound: Bound) -> str:
    """Say whether our own recipe reached its target, and by how little."""
    margin = abs(reached / TARGET_EPE_PX - 1)
    verdict = HELD if reached <= TARGET_EPE_PX else FAILED
    side = "below" if reached <= TARGET_EPE_PX else "above"
    note = f"{verdict}: version {version} is at {reached:.4f} px, {100 * margin:.1f} % {side} the target."
    if bound.settings and margin < bound.share:
        times = f"{bound.settings} setting{'s' if bound.settings != 1 else ''}"
        note += (
            f" That is less than the {100 * bound.share:.1f} % by which two runs of one setting differ in {times}: "
            "another run of the same recipe may end on the other side."
        )
    return note


def search_note(table: dict[str, Any], search: dict[str, Any]) -> str:
    """Say on which pairs the settings of StereoSGBM were found, and how many were tried for each form."""
    data, ids = search.get("data"), search.get("pairs")
    forms = {
        name: found
        for name, found in search.get("forms", {}).items()
        if table.get("methods", {}).get(name, {}).get("settings") == found["best"]
    }
    if not forms or data is None or ids is None:
        return ""
    named = ", ".join(ids[:LISTED]) + (f" and {len(ids) - LISTED} more" if len(ids) > LISTED else "")
    known = f"SHA-256 {data['sha256'][:8]}"
    tried = ", ".join(f"{LABELS[name]} the best of {len(found['tried'])}" for name, found in forms.items())
    return (
        f"Settings from a search over block, P1, P2, pre-filter and the checks: {tried}, on {len(ids)} pairs of the "
        f"{data['split']} split of {data['name']} ({known}): {named}."
    )


def sgbm_note(table: dict[str, Any], search: dict[str, Any]) -> str:
    """Say that a row still has settings from before the present search, where it has."""
    forms = search.get("forms", {})
    old = [
        LABELS[name]
        for name in ("sgbm", "sgbm-hh")
        if (row := table.get("methods", {}).get(name)) and row["settings"] != forms.get(name, {}).get("best")
    ]
    if not old:
        return ""
    return (
        f"{' and '.join(old)}: settings from an earlier search, of 60 on 4 training pairs, without P1, P2 and the "
        "pre-filter, and for both forms at once. The present search has not been run."
    )


def frames_note() -> str:
    """Say what the two protocols are."""
    return (
        f"The paper's protocol sees whole frames of {size(FRAME)}, in 16 passes over 800 pairs and batches of one. "
        "RMSprop starts at 1e-3 and falls by one factor an epoch to 3e-5. The loss is scale-invariant at both stages. "
        "Planes go up to D, D included. There is no augmentation, no warm-up and no limit of the gradient. The paper "
        "names neither batch nor factor. "
        "Our protocol sees 12800 crops of 512 x 256 in batches of four, with strong augmentation. Planes end 8 px "
        "before the range of 72 px. There is a warm-up and a limit of the gradient. The coarse map has half the weight."
    )
