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

import onnx

from endosdk import _core
from endosdk.runtime.models import shipped_models

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks" / "results"
DOCUMENTS = (
    "README.md",
    "models/accurate.md",
    "models/fast-320.md",
    "models/fast-25.md",
    "models/fast.md",
    "models/wang2020.md",
    "docs/numbers.md",
    "docs/c-library.md",
    "docs/datasets/endosim-gi.md",
    "docs/model-file.md",
    "docs/hardening.md",
)
PLACE = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

METHODS = {
    "fast": "**fast** (8-bit)",
    "fast-fp32": "fast-fp32",
    "fast-25": "fast-25 (8-bit)",
    "fast-25-fp32": "fast-25-fp32",
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
SHORT_SPEEDS = {
    "fast": "fast, 960 x 720, VNNI",
    "fast_1920x1080": "fast, 1920 x 1080, VNNI",
    "avx2_fast-320": "fast-320, 960 x 720, AVX2 alone",
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

TEST_SETS = {  # record and label, for the tables of one model
    "accuracy/accuracy": "`endosim-gi`, rendered, 100 pairs",
    "accuracy/accuracy_cycles": "`endosim-gi-cycles`, path-traced, 60 pairs",
}
# Focal length over frame width and baseline in mm of three published rigs.
RIGS = {
    "a da Vinci (f/w 0.96, 4.1 mm)": (0.96, 4.1),
    "a 3-D laparoscope (f/w 1.05, 4.8 mm)": (1.05, 4.8),
    "the paper's rig (f/w 0.42, 10 mm)": (0.42, 10.0),
}

# Pairs of the photometric consistency record, from good ones to those that no answer should come of.
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
    heads = ["method", "EPE, px", "over 1 px", "over 3 px", "coverage"]
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


def short_accuracy_table() -> str:
    """What a reader wants to know first: error of our 8-bit models and StereoSGBM on the test pairs."""
    scores = _record("accuracy/accuracy")["methods"]
    rows = []
    for name in ("fast", "fast-320", "accurate", "wang2020", "sgbm-filled"):
        whole = scores[name]["all"]
        rows.append(
            [METHODS[name], f"{whole['epe_px']:.2f} px", _percent(whole["kpe_3"]), _percent(whole["depth_relative"])]
        )
    return _table(["method", "mean error", "over 3 px", "depth error"], rows)


def short_speed_table() -> str:
    """What a reader wants to know first: frame rates of our models, each with StereoSGBM in the same run."""
    rows = []
    for name, label in SHORT_SPEEDS.items():
        run = _record(f"speed/{name}")
        rates = (run["fps"], run["stream_fps"], run["against"]["sgbm"]["fps"])
        rows.append([label, *(f"{rate:.0f}" for rate in rates)])
    return _table(["model, frames", "`predict`, FPS", "`stream`, FPS", "StereoSGBM, FPS"], rows)


def speed_table(runs: dict[str, str]) -> str:
    """Frame rates of our models, each with StereoSGBM in the same run; record and label of every run."""
    rows = []
    for name, label in runs.items():
        run = _record(f"speed/{name}")
        delay, sgbm = run["latency_ms"], run["against"]["sgbm"]["fps"]
        rates = [f"{run['fps']:.1f}", f"{run['stream_fps']:.1f}"]
        rows.append([label, *rates, f"{delay['p50']:.1f} ms", f"{delay['p99']:.1f} ms", f"{sgbm:.1f}"])
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


def errors_table(model: str) -> str:
    """Errors of one model on every test set that has a record."""
    rows = []
    for record, label in TEST_SETS.items():
        if not (RESULTS / f"{record}.json").is_file() or model not in _record(record)["methods"]:
            continue
        scores = _record(record)["methods"][model]
        whole, seen = scores["all"], scores["non_occluded"]
        shares = [_percent(whole[key]) for key in ("kpe_1", "kpe_3")]
        rows.append(
            [label, f"{whole['epe_px']:.3f}", *shares, f"{seen['epe_px']:.3f}", _percent(whole["depth_relative"])]
        )
    return _table(
        ["test set", "EPE, px", "over 1 px", "over 3 px", "EPE where both views see, px", "depth error"], rows
    )


def range_25_table() -> str:
    """`fast-25` beside `fast` and StereoSGBM on pairs within the range of `fast` and beyond it."""
    rows = []
    for record, label in (("range_25_cycles", "path-traced, within"), ("range_25_lap", "laparoscopic, beyond")):
        scores = _record(f"accuracy/{record}")["methods"]
        for name in ("fast", "fast-25", "sgbm-filled"):
            whole = scores[name]["all"]
            rows.append(
                [label, METHODS[name], f"{whole['epe_px']:.2f}", *(_percent(whole[k]) for k in ("kpe_1", "kpe_3"))]
            )
    return _table(["pairs", "method", "EPE, px", "over 1 px", "over 3 px"], rows)


def range_table(model: str) -> str:
    """The nearest depth that one model sees on real rigs, from its own metadata."""
    facts = {entry.key: entry.value for entry in onnx.load(shipped_models()[model]).metadata_props}
    # Half a pixel before the last candidate a pixel counts as out of range.
    end = int(facts["endosdk.max_candidate_disparity"]) - _core.range_margin
    share = end / int(facts["endosdk.inference_width"])
    rows = [[f"range of disparities, % of the width | 0 to {100 * share:.1f}"]]
    for label, (focal, baseline) in RIGS.items():
        rows.append([f"nearest depth on {label} | {focal * baseline / share:.0f} mm"])
    return _table(["what", "value"], rows)


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


def spoilt_files_table() -> str:
    """Every reader of strangers' files: spoilt ones tried, how many were read, refused by which code, anything else."""
    rows = []
    for name, reader in _record("studies/spoilt_files")["readers"].items():
        outcomes = dict(reader["outcomes"])
        read = outcomes.pop("read", 0)
        untyped = sum(outcomes.pop(kind) for kind in list(outcomes) if kind.startswith("untyped"))
        refused = ", ".join(f"{count} {code}" for code, count in outcomes.items())
        rows.append([name, str(reader["tried"]), str(read), refused, str(untyped), f"{reader['slowest_s']:.2f}"])
    heads = ["file", "tried", "still valid, read", "refused with a typed error", "anything else", "slowest, s"]
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
    "short-accuracy": short_accuracy_table,
    "short-speed": short_speed_table,
    "range-25": range_25_table,
    "accuracy-cycles": partial(accuracy_table, "accuracy/accuracy_cycles"),
    "accuracy-near": partial(accuracy_table, "accuracy/accuracy_near"),
    "speed": partial(speed_table, SPEEDS),
    "speed-avx2": partial(speed_table, AVX2_SPEEDS),
    "photometric-consistency": photometric_consistency_table,
    "range-end": range_end_table,
    "spoilt-files": spoilt_files_table,
    "versions": lambda: versions_table(_record("studies/wang2020_versions")["versions"]),
}


TABLES |= {
    f"errors:{name}": partial(errors_table, name) for name in ("fast", "fast-25", "fast-320", "accurate", "wang2020")
}
TABLES |= {f"range:{name}": partial(range_table, name) for name in ("fast", "fast-25", "fast-320", "accurate")}


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
