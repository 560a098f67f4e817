"""The records behind the tables, and the labels and marks of their rows."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

SOURCES = Path(__file__).parents[2]
RESULTS = SOURCES / "benchmarks" / "results"
MANIFEST = SOURCES / "models" / "models.toml"

STALE = r"\*"  # behind the label of a row or column whose model file no longer ships
STALE_NOTE = f"{STALE} Measured with a file that no longer ships; the record has its version and hash."
EARLIER = "†"  # behind one whose model file was replaced by a file of the same weights
EARLIER_RECORDS = "speed/earlier_files", "speed/earlier_files_2026-11-28"  # newest first
EARLIER_NOTE = f"{EARLIER} Of an earlier, slower file with the same weights: `speed/earlier_files*.json`."
NOTES = {STALE: STALE_NOTE, EARLIER: EARLIER_NOTE}

CARDS = ("fast", "fast-320", "accurate", "wang2020")
METHODS = {
    "fast": "**fast** (8-bit)",
    "fast-fp32": "fast-fp32",
    "fast-320": "fast-320 (8-bit)",
    "accurate": "accurate (8-bit)",
    "accurate-fp32": "accurate-fp32",
    "wang2020": "wang2020",
    "sgbm-filled": "StereoSGBM, filled",
    "sgbm": "StereoSGBM",
}


def read(name: str) -> dict[str, Any]:
    """Return the record of this name, which has its folder and no ending."""
    record: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return record


def method(record: dict[str, Any], name: str) -> str:
    """Return the label of a method's row; a record of methods has the hashes of those that are models."""
    return marked(METHODS[name], record["models"].get(name))


def rows(record: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """Return label and scores of each method that a record holds, in the order of `METHODS`."""
    scores = record["methods"]
    return [(method(record, name), scores[name]) for name in METHODS if name in scores]


def marked(label: str, sha256: str | None) -> str:
    """Mark the label of numbers of a model file that no longer ships; methods without a file have no hash.

    Every table that shows a model's numbers marks its rows or its columns here.
    """
    if sha256 is None or sha256 in shipped():
        return label
    return f"{label} {EARLIER if sha256 in earlier_files() else STALE}"


def shipped() -> set[str]:
    """Return the hashes of the files that ship."""
    return {entry["sha256"] for entry in tomllib.loads(MANIFEST.read_text()).values()}


def earlier_files() -> set[str]:
    """Return the hashes of the files whose answers a record compares with a later file of the same weights.

    The last of them ships. Records are read from the newest to the oldest.
    """
    found: set[str] = set()
    for name in EARLIER_RECORDS:
        compared = read(name)["models"].values()
        found |= {one["earlier_sha256"] for one in compared if one["model_sha256"] in shipped() | found}
    return found
