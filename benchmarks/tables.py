"""The tables of README.md, of the model cards and of other pages, from the records they are backed by.

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

from endosdk import _core

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = (
    "README.md",
    "models/fast.md",
    "models/wang2020.md",
    "docs/c-library.md",
    "docs/datasets/endosim-gi.md",
    "docs/model-file.md",
)
PLACE = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

METHODS = {
    "fast": "**fast** (8-bit)",
    "fast-fp32": "fast-fp32",
    "fast-320": "fast-320 (8-bit)",
    "accurate": "accurate (8-bit)",
    "accurate-fp32": "accurate-fp32",
    "wang2020": "wang2020",
    "wang2020-192": "wang2020-192",
    "sgbm-filled": "StereoSGBM, filled",
    "sgbm": "StereoSGBM",
}
SPEEDS = {  # on a processor with VNNI
    "fast": "fast, 960 x 720, 2",
    "fast_1280x720": "fast, 1280 x 720, 2",
    "fast_1920x1080": "fast, 1920 x 1080, 2",
    "fast_1thread": "fast, 960 x 720, 1",
    "fast-fp32": "fast-fp32, 960 x 720, 2",
    "wang2020": "wang2020, 960 x 720, 2",
}
AVX2_SPEEDS = {  # on one without
    "avx2_fast": "fast, 960 x 720, 2",
    "avx2_fast-320": "fast-320, 960 x 720, 2",
    "avx2_fast-320_1280x720": "fast-320, 1280 x 720, 2",
    "avx2_fast-320_1920x1080": "fast-320, 1920 x 1080, 2",
    "avx2_fast-320_1thread": "fast-320, 960 x 720, 1",
    "avx2_fast-fp32": "fast-fp32, 960 x 720, 2",
    "avx2_accurate": "accurate, 960 x 720, 2",
    "avx2_wang2020": "wang2020, 960 x 720, 2",
}

# Pairs of the agreement record, from good ones to those that no answer should come of.
PAIRS = {
    "right_pairs": "right pairs of `endosim-gi`",
    "bad_light/a sixteenth of the light": "one of them with a sixteenth of the light",
    "real_pairs/scared_rectified": "real porcine frame, rectified",
    "wrong_pairs/both black": "both views black",
    "wrong_pairs/right covered": "right camera covered",
    "wrong_pairs/right frozen grey": "right view a uniform grey",
    "wrong_pairs/twice the left": "the left view twice",
    "real_twice_left/hamlyn_phantom": "the same of a raw phantom rig, whose lens maps make two pictures of it",
    "wrong_pairs/views swapped": "views swapped",
    "real_swapped/hamlyn_phantom": "the same of the phantom",
    "wrong_pairs/right 12 rows off": "right view 12 rows off",
}


def accuracy_table(record: str = "accuracy/accuracy") -> str:
    """Errors of our models and StereoSGBM on the test pairs."""
    scores = _record(record)["methods"]
    heads = ["method", "EPE, px", "over 1 px", "over 3 px", "answered"]
    heads += ["EPE, non-occluded", "over 1 px, non-occluded", "depth error"]
    rows = []
    for name, label in METHODS.items():
        if name not in scores:
            continue
        whole, seen = scores[name]["all"], scores[name]["non_occluded"]
        shares = [f"{100 * whole[key]:.1f} %" for key in ("kpe_1", "kpe_3", "coverage")]
        rest = [f"{seen['epe_px']:.3f}", f"{100 * seen['kpe_1']:.1f} %", f"{100 * whole['depth_relative']:.1f} %"]
        rows.append([label, f"{whole['epe_px']:.3f}", *shares, *rest])
    return _table(heads, rows)


def speed_table(runs: dict[str, str]) -> str:
    """Frame rates of our models, each with StereoSGBM in the same run; record and label of every run."""
    rows = []
    for name, label in runs.items():
        run = _record(f"speed/{name}")
        delay, rival = run["latency_ms"], run["against"]["sgbm"]["fps"]
        rates = [f"{run['fps']:.1f}", f"{run['stream_fps']:.1f}"]
        rows.append([label, *rates, f"{delay['p50']:.1f} ms", f"{delay['p99']:.1f} ms", f"{rival:.1f}"])
    heads = ["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99", "StereoSGBM, FPS"]
    return _table(heads, rows)


def photometric_consistency_table() -> str:
    """Share of pixels that `fast` answers, without and with the rule that both views must agree."""
    found = _record("accuracy/photometric_consistency")["models"]["fast"]
    rows = []
    for place, label in PAIRS.items():
        group, _, name = place.partition("/")
        shares = found[group][name] if name else found[group]
        rows.append([label, *(_percent(shares[f"valid_{rule}"]) for rule in ("without", "with"))])
    return _table(["pair", "without this rule", "with it"], rows)


def range_end_table() -> str:
    """What each margin before the last plane finds and loses, by model."""
    models = {name: _record("accuracy/range_end")["models"][name]["margins"] for name in ("fast", "wang2020")}
    what = ("marked_of_surfaces_beyond", "beyond_the_max_candidate_disparity_of_marked", "marked_of_right_answers")
    heads = ["margin, px"]
    for name in models:
        heads += [f"`{name}`: marked of surfaces beyond", "of marked, beyond the last plane", "right answers lost"]
    rows = []
    for margins in zip(*models.values(), strict=True):
        cells = [f"{margins[0]['margin_px']:g}", *(_percent(margin[key]) for margin in margins for key in what)]
        rows.append([f"**{cell}**" for cell in cells] if margins[0]["margin_px"] == _core.range_margin else cells)
    return _table(heads, rows)


def versions_table(versions: dict[str, Any]) -> str:
    """Error of each version of wang2020, and what was new in its training."""
    rows = []
    for number, version in versions.items():
        errors = [f"{version[data]['epe_px']:.3f}" for data in ("endosim-gi", "endosim-gi-cycles")]
        rows.append([number, version["phases"], version["what_is_new"], *errors])
    return _table(["version", "phases", "new in the last one", "EPE, px", "path-traced, px"], rows)


TABLES: dict[str, Callable[[], str]] = {
    "accuracy": accuracy_table,
    "accuracy-cycles": partial(accuracy_table, "accuracy/accuracy_cycles"),
    "accuracy-near": partial(accuracy_table, "accuracy/accuracy_near"),
    "speed": partial(speed_table, SPEEDS),
    "speed-avx2": partial(speed_table, AVX2_SPEEDS),
    "photometric-consistency": photometric_consistency_table,
    "range-end": range_end_table,
    "versions": lambda: versions_table(_record("studies/wang2020_versions")["versions"]),
}


def filled(text: str) -> str:
    """Return the document with every table written anew."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], text)


def _record(name: str) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return record


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


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
