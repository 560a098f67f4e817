"""The tables of README.md and of the model cards, from the records they are backed by.

    python -m benchmarks.tables            # write them anew
    python -m benchmarks.tables --check    # tell whether any differs from its record

A table stands between ``<!-- table: NAME -->`` and ``<!-- end of table -->``.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = ("README.md", "models/fast.md", "models/wang2020.md", "docs/datasets/endosim-gi.md")
PLACE = re.compile(r"(<!-- table: ([a-z-]+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

METHODS = {
    "fast": "**fast** (8-bit)",
    "fast-fp32": "fast-fp32",
    "wang2020": "wang2020",
    "sgbm-filled": "StereoSGBM, filled",
    "sgbm": "StereoSGBM",
}
SPEEDS = {
    "fast": "fast, 960 x 720, 2",
    "fast_1280x720": "fast, 1280 x 720, 2",
    "fast_1920x1080": "fast, 1920 x 1080, 2",
    "fast_1thread": "fast, 960 x 720, 1",
    "fast-fp32": "fast-fp32, 960 x 720, 2",
    "wang2020": "wang2020, 960 x 720, 2",
}


def accuracy_table(record: str = "accuracy") -> str:
    """Errors of our models and StereoSGBM on the test pairs."""
    scores = _record(record)["methods"]
    heads = ["method", "EPE, px", "over 1 px", "over 3 px", "answered"]
    heads += ["EPE, non-occluded", "over 1 px, non-occluded", "depth error"]
    rows = []
    for name, label in METHODS.items():
        whole, seen = scores[name]["all"], scores[name]["non_occluded"]
        shares = [f"{100 * whole[key]:.1f} %" for key in ("kpe_1", "kpe_3", "coverage")]
        rest = [f"{seen['epe_px']:.3f}", f"{100 * seen['kpe_1']:.1f} %", f"{100 * whole['depth_relative']:.1f} %"]
        rows.append([label, f"{whole['epe_px']:.3f}", *shares, *rest])
    return _table(heads, rows)


def speed_table() -> str:
    """Frame rates of our models, each with StereoSGBM in the same run."""
    rows = []
    for name, label in SPEEDS.items():
        run = _record(f"bench_{name}")
        delay, rival = run["latency_ms"], run["against"]["sgbm"]["fps"]
        rates = [f"{run['fps']:.1f}", f"{run['stream_fps']:.1f}"]
        rows.append([label, *rates, f"{delay['p50']:.1f} ms", f"{delay['p99']:.1f} ms", f"{rival:.1f}"])
    heads = ["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99", "StereoSGBM, FPS"]
    return _table(heads, rows)


TABLES: dict[str, Callable[[], str]] = {
    "accuracy": accuracy_table,
    "accuracy-cycles": partial(accuracy_table, "accuracy_cycles"),
    "speed": speed_table,
}


def filled(text: str) -> str:
    """Return the document with every table written anew."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], text)


def _record(name: str) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return record


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def main() -> int:
    """Write the tables, or with --check name the documents that would change."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 where a document would change")
    args = parser.parse_args()
    stale = 0
    for name in DOCUMENTS:
        path = ROOT / name
        before = path.read_text()
        after = filled(before)
        if after == before:
            continue
        stale += 1
        print(f"{name}: {'differs from the records' if args.check else 'written'}")
        if not args.check:
            path.write_text(after)
    return 1 if args.check and stale else 0


if __name__ == "__main__":
    sys.exit(main())
