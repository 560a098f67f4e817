"""Write docs/device/requirements.md from requirements.toml beside it: requirements with their tests, hazards, findings.

python scripts/requirements_page.py
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "docs" / "device"

POINTS = {
    1: "No network",
    2: "Model integrity",
    3: "Identity",
    4: "Input validation",
    5: "Status of every frame",
    6: "Deadline and cancelling",
    7: "Staleness",
    8: "Determinism and self test",
    9: "Resources",
    10: "Errors",
    11: "Threads",
    12: "Logs and recordings",
    13: "Documents",
    14: "Build",
    15: "Metric depth",
}


def requirements() -> list[dict[str, Any]]:
    """Return the list, in the order of the checklist."""
    content = tomllib.loads((FOLDER / "requirements.toml").read_text())
    return list(content["requirement"])


def findings() -> list[dict[str, Any]]:
    """Return what reviews found wrong, each with the tests that hold what was mended."""
    content = tomllib.loads((FOLDER / "requirements.toml").read_text())
    return list(content["finding"])


def hazards() -> list[dict[str, Any]]:
    """Return what can go wrong in a device, each with causes of frames, requirements that answer it, and the rest."""
    content = tomllib.loads((FOLDER / "requirements.toml").read_text())
    return list(content["hazard"])


def open_points() -> dict[int, list[str]]:
    """Return, by the points that are not complete, the requirements that say what is open."""
    found: dict[int, list[str]] = {}
    for entry in requirements():
        if "open" in entry:
            found.setdefault(entry["point"], []).append(entry["id"])
    return dict(sorted(found.items()))


def score() -> str:
    """Return how many points of the checklist are complete, and what is open in the others."""
    left = open_points()
    named = ", ".join(f"{point} ({', '.join(ids)})" for point, ids in left.items())
    complete = f"{len(POINTS) - len(left)} of {len(POINTS)} points are complete"
    whole = f"{complete}: Python and C have tests for each of their requirements."
    return f"{whole} Open: {named}." if left else whole


def page() -> str:
    """Return the page."""
    listed = requirements()
    lines = [
        "# Requirements and tests for device vendors",
        "",
        "Each requirement, with the tests that verify it in Python and in C.",
        "`tests/documents/test_requirements.py` fails if a named test is missing.",
        "It also fails if an interface has neither a test nor a note of what is open.",
        "This page is written by `python scripts/requirements_page.py`.",
        "",
        score(),
        "",
    ]
    for point, name in POINTS.items():
        lines += [f"## {point}. {name}", ""]
        for entry in (entry for entry in listed if entry["point"] == point):
            lines.append(f"**{entry['id']}**: {entry['text']}")
            lines.append("")
            lines += [
                f"- {face}: {_links(entry[key]) or 'no test'}" for key, face in (("python", "Python"), ("c", "C"))
            ]
            if "open" in entry:
                lines.append(f"- Open: {entry['open']}")
            lines.append("")
    lines += [
        "## Hazard hints",
        "",
        "Input for the risk file of your device, which this is not. Causes and reasons: see [trust](../trust.md).",
        "Faults that nothing reports: see [limits](../limits.md).",
        "",
        "| hazard | causes of a frame | requirements | what remains for the device |",
        "| --- | --- | --- | --- |",
    ]
    for hazard in hazards():
        cells = [hazard["text"], ", ".join(hazard["causes"]) or "-", ", ".join(hazard["controls"]), hazard["device"]]
        lines.append(f"| {' | '.join(cells)} |")
    lines += ["", "## What reviews found", "", "Each defect was fixed and has a regression test.", ""]
    lines += [f"- {entry['text']} {_links(entry['tests'])}" for entry in findings()]
    return "\n".join(lines).rstrip() + "\n"


def _links(tests: list[str]) -> str:
    pairs = (test.split("::") for test in tests)
    return ", ".join(f"[{function}](../../{file})" for file, function in pairs)


if __name__ == "__main__":
    (FOLDER / "requirements.md").write_text(page())
