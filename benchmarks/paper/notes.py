"""What a reader must know beside the numbers: where records differ, where settings come from, what is confounded.

Every sentence follows from the records; where they do not tell, it is left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from benchmarks.paper.experiments import LABELS, PAPER_FRAME, PROTOCOL, RIVALS, size
from endosdk.training.config import TrainConfig
from endosdk.training.networks.wang2020 import DILATIONS

LISTED = 8  # ids of pairs that a sentence names


def refinement_note(rows: dict[str, dict[str, Any] | None]) -> str:
    """Say in what runs with and without refinement differ besides it; rows with refinement, by where they stand."""
    trained = {place: row for place, row in rows.items() if row}
    if not trained:
        return ""
    cut = {place: row["refine_crop"] or row["crop"] for place, row in trained.items() if not row.get("refine_margin")}
    note = "The two runs differ in more than the refinement: "
    if cut:
        shares = ", ".join(f"{_share(window)} in {place}" for place, window in cut.items())
        note += (
            f"it reaches {refinement_reach()} px, and in training the coarse map is cut where the part of the crop "
            f"ends that it works on, so that zeros beyond are seen by {shares}, and by {_share(PAPER_FRAME)} in a "
            "whole frame, where errors are measured; "
        )
    weight = f"the loss of the coarse map counts {TrainConfig().coarse_weight:g} with refinement and 1 without."
    return note + weight


def refinement_reach() -> int:
    """How far, px, the refinement of wang2020 looks: its layers of 3 x 3, the first and the last not dilated."""
    return 1 + sum(DILATIONS) + 1


def padded_share(height: int, width: int) -> float:
    """Share of the pixels of a window that see beyond its border through the refinement."""
    inner = max(0, height - 2 * refinement_reach()) * max(0, width - 2 * refinement_reach())
    return 1 - inner / (height * width)


def _share(window: tuple[int, int]) -> str:
    return f"{100 * padded_share(*window):.0f} % of the {size(window)} pixels"


def ablations_note(ablations: dict[str, Any], table: dict[str, Any]) -> str:
    """Say in which fields the record of the ablations differs from that of Table 1."""
    if not ablations or not table:
        return ""
    rows = [row for group in ablations["groups"].values() for row in group.values() if row]
    fields = {
        "processor": (ablations["machine"]["cpu"], table["machine"]["cpu"]),
        "commit": (ablations["machine"]["commit"], table["machine"]["commit"]),
        "test pairs": (_version(ablations), _version(table)),
        "training pairs": (_versions(rows), _versions(table["methods"].values())),
    }
    differ = [f"{name} {ours} against {theirs}" for name, (ours, theirs) in fields.items() if ours != theirs]
    if not differ:
        return ""
    return (
        f"The ablations and Table 1 are of different states, here with data by their SHA-256: {'; '.join(differ)}. "
        "So the ablations compare with one another alone."
    )


def _version(data: dict[str, Any]) -> str:
    return f"{data.get('dataset', data.get('name'))} {data['sha256'][:8]}"


def _versions(rows: Iterable[dict[str, Any]]) -> str:
    return ", ".join(sorted({_version(row["train_data"]) for row in rows if "train_data" in row}))


def shipped_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say in which columns wang2020 as shipped is first among the rivals of the same table."""
    ours = rows.get("shipped-wang2020")
    rivals = {name: rows[name] for name in RIVALS if name in rows}
    if ours is None or not rivals:
        return ""
    columns = {"in the mean": [row["epe"] for row in (ours, *rivals.values())]}
    for limit in ours["kpe"]:
        columns[f"over {limit} px"] = [row["kpe"][limit] for row in (ours, *rivals.values())]
    behind = {
        label: [LABELS[name] for name, error in zip(rivals, others, strict=True) if error <= own]
        for label, (own, *others) in columns.items()
    }
    among = f"among {', '.join(LABELS[name] for name in rivals)}"
    note = "As shipped, from a recipe of its own, wang2020 is"
    first = [label for label, names in behind.items() if not names]
    if len(first) == len(columns):
        return f"{note} first in every error column {among}."
    places = [f"first {', '.join(first)}"] if first else []
    places += [f"behind {' and '.join(names)} {label}" for label, names in behind.items() if names]
    return f"{note}, {among}, {'; '.join(places)}."


def cause_note(rows: dict[str, dict[str, Any]]) -> str:
    """Say what the loss and the optimiser of its paper cost wang2020, and what a rival that is ahead of it took."""
    paper, changed = rows.get("wang2020"), rows.get("wang2020-adam")
    if not paper or not changed:
        return ""
    note = (
        f"With the rivals' loss and optimiser in place of its paper's, and all else alike, wang2020 ends at "
        f"{changed['epe']:.3f} px, not {paper['epe']:.3f}."
    )
    for name in RIVALS:
        row = rows.get(name, {})
        if row.get("training_tmacs") and row["epe"] < changed["epe"]:
            dearer, slower = row["training_tmacs"] / changed["training_tmacs"], row["ms"] / changed["ms"]
            note += (
                f" {LABELS[name]} stays ahead: its training on {row['samples_seen']} crops took {dearer:.1f} times "
                f"the products of wang2020's on {changed['samples_seen']}, a frame {slower:.0f} times the time."
            )
    return note


def search_note(table: dict[str, Any], search: dict[str, Any], accuracy: dict[str, Any]) -> str:
    """Say on which pairs the settings of StereoSGBM were found, and what those have that nobody searched."""
    row = table.get("methods", {}).get("sgbm")
    if not row or not search or row["settings"] != search["best"]:
        return ""
    data, ids = search["data"], search["pairs"]
    named = ", ".join(ids[:LISTED]) + (f" and {len(ids) - LISTED} more" if len(ids) > LISTED else "")
    known = f"SHA-256 {data['sha256'][:8]}" if "sha256" in data else "no hash recorded"
    note = (
        f"StereoSGBM, also with 8 paths, has the best of {len(search['tried'])} settings on {len(ids)} pairs of the "
        f"{data['split']} split of {data['name']} ({known}): {named}."
    )
    unsearched = accuracy.get("methods", {}).get("sgbm-filled")
    same = accuracy.get("dataset", {}).get("sha256") == table["sha256"]
    if unsearched and same and unsearched["pairs"] == table["pairs"]:
        note += (
            f" The README's StereoSGBM, {unsearched['all']['epe_px']:.3f} px on the same pairs, has the default "
            "settings of endosdk, unsearched."
        )
    return note


def rate_note() -> str:
    """Say what of a rival's training is not that of its paper."""
    return (
        "loss, optimiser and first rate are those of its paper, while the fall of the rate to "
        f"{PROTOCOL['final_rate']:g} is the protocol's for all; one more run of wang2020 has the loss and the "
        "optimiser of the rivals instead"
    )
