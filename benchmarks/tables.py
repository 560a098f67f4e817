"""The tables of README.md, of the model cards and of other pages, from the records they are backed by.

    python -m benchmarks.tables            # write them anew
    python -m benchmarks.tables --check    # tell whether any differs from its record

A table stands between ``<!-- table: NAME -->`` and ``<!-- end of table -->``.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import onnx

from endosdk import _core
from endosdk.runtime.models import shipped_models

SOURCES = Path(__file__).parents[1]
ROOT = SOURCES  # of the pages; a test writes them elsewhere
RESULTS = ROOT / "benchmarks" / "results"
MANIFEST = ROOT / "models" / "models.toml"
ATTACKS = {  # files of tests that feed each interface what is bad
    "Python": sorted((ROOT / "tests" / "hardening").glob("test_*.py")),
    "C": [
        *(ROOT / "cpp/tests/library" / f"test_{name}.cpp" for name in ("refusals", "models", "streams")),
        *(ROOT / "cpp/tests/library" / f"test_{name}.cpp" for name in ("allocation", "resources", "stack")),
        *(ROOT / "tests/c_library" / f"test_{name}.py" for name in ("errors", "same_refusals", "fork")),
    ],
}
DOCUMENTS = (
    "README.md",
    "models/accurate.md",
    "models/fast-320.md",
    "models/fast.md",
    "models/wang2020.md",
    "docs/numbers.md",
    "docs/datasets/endosim-gi.md",
    "docs/model-file.md",
    "docs/trust.md",
    "docs/hardening.md",
    "docs/live.md",
    "docs/measuring.md",
    "docs/device/systems.md",
)
PLACE = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end of table -->)", re.DOTALL)

STALE = r"\*"  # behind the label of a row or column whose model file no longer ships
STALE_NOTE = f"{STALE} Measured with a file that no longer ships; the record has its version and hash."

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
SPEEDS = {
    "fast": "fast, 960 x 720, 2",
    "fast_1280x720": "fast, 1280 x 720, 2",
    "fast_1920x1080": "fast, 1920 x 1080, 2",
    "fast_3840x2160": "fast, 3840 x 2160, 2",
    "fast_1thread": "fast, 960 x 720, 1",
    "fast-320": "fast-320, 960 x 720, 2",
    "fast-fp32": "fast-fp32, 960 x 720, 2",
    "accurate": "accurate, 960 x 720, 2",
    "wang2020": "wang2020, 960 x 720, 2",
}
SHORT_SPEEDS = {
    "fast": "fast, 960 x 720, VNNI",
    "fast_1920x1080": "fast, 1920 x 1080, VNNI",
    "fast-320": "fast-320, 960 x 720, VNNI",
    "accurate": "accurate, 960 x 720, VNNI",
}

TEST_SETS = {  # record and label, for the tables of one model
    "accuracy/accuracy": "`endosim-gi`, rendered, 100 pairs",
    "accuracy/accuracy_cycles": "`endosim-gi-cycles`, path-traced, 60 pairs",
    "accuracy/accuracy_lap": "`endosim-lap`, instruments and image faults, 100 pairs",
    "accuracy/accuracy_lap_cycles": "`endosim-lap-cycles`, path-traced, 40 pairs",
}
PAIRS = {"clean": "clean", "spoilt": "degraded"}  # as a record and as a page name them
# What a card shows of the speed, besides the run at 960 x 720 on two threads, and of the trust, besides the faults.
CARD_RUNS = ("1920x1080", "1thread")
CARD_CASES = ("clean", "noise of 12 grey levels", "JPEG of quality 20")
WIDEST_UNRESIZED = 960  # px; wider frames are resized for a model that states no inference width
# Focal length over frame width and baseline in mm of three published rigs.
RIGS = {
    "a da Vinci (f/w 0.96, 4.1 mm)": (0.96, 4.1),
    "a 3-D laparoscope (f/w 1.05, 4.8 mm)": (1.05, 4.8),
    "the paper's rig (f/w 0.42, 10 mm)": (0.42, 10.0),
}


def accuracy_table(record: str = "accuracy/accuracy") -> str:
    """Errors of our models and StereoSGBM on the test pairs."""
    found = _record(record)
    scores = found["methods"]
    heads = ["method", "EPE, px", "over 1 px", "over 3 px", "coverage"]
    heads += ["EPE, non-occluded", "over 1 px, non-occluded", "depth error"]
    rows = []
    for name in METHODS:
        if name not in scores:
            continue
        whole, seen = scores[name]["all"], scores[name]["non_occluded"]
        shares = [f"{100 * whole[key]:.1f} %" for key in ("kpe_1", "kpe_3", "coverage")]
        rest = [f"{seen['epe_px']:.3f}", f"{100 * seen['kpe_1']:.1f} %", f"{100 * whole['depth_relative']:.1f} %"]
        rows.append([_method(found, name), f"{whole['epe_px']:.3f}", *shares, *rest])
    return _table(heads, rows)


def edges_table(record: str) -> str:
    """Errors near depth edges and where only one camera sees, of our models and StereoSGBM."""
    found = _record(record)
    scores = found["methods"]
    rows = []
    for name in METHODS:
        if name not in scores:
            continue
        edges, hidden = scores[name]["edges"], scores[name]["occluded"]
        shares = (edges["kpe_3"], edges["flying"], scores[name]["non_occluded"]["kpe_3"], hidden["kpe_3"])
        rows.append([_method(found, name), f"{edges['epe_px']:.2f}", *map(_percent, shares)])
    heads = ["method", "EPE near edges, px", "over 3 px near edges", "flying pixels", "over 3 px, non-occluded"]
    return _table([*heads, "over 3 px, occluded"], rows)


def parts_table(record: str) -> str:
    """Share of wrong pixels among all, among those in a method's range, and among those that it calls valid."""
    found = _record(record)
    scores = found["methods"]
    rows = []
    for name in METHODS:
        if name not in scores:
            continue
        all_, seen, ranged, valid = (scores[name][part] for part in ("all", "non_occluded", "in_range", "valid"))
        shares = (all_["kpe_3"], seen["kpe_3"], ranged["share"], ranged["kpe_3"], valid["share"], valid["kpe_3"])
        rows.append([_method(found, name), *map(_percent, shares)])
    heads = ["method", "over 3 px", "non-occluded", "in range", "of these over 3 px", "valid", "of these over 3 px"]
    return _table(heads, rows)


def trust_table(model: str) -> str:
    """What a model says of clean, spoilt and faulty pairs."""
    record = _record("accuracy/trust")["models"][model]
    rows = []
    for case, found in record["cases"].items():
        shares = (found["right_called_valid"], found["wrong_called_valid"], found["within_sigma"], found.get("named"))
        frames = _frames(found["status"])
        # A fault has no pixels to judge: nothing of the frame is to be used.
        judged = shares if "named" not in found else (None, None, None, shares[3])
        rows.append([case, frames, *("" if share is None else _percent(share) for share in judged)])
    heads = [_marked("pairs", record["model_sha256"]), "frames", "right pixels valid", "wrong pixels valid"]
    return _table([*heads, "error within sigma", "cause named"], rows)


def min_confidence_table() -> str:
    """What another `min_confidence` gives: valid among right and wrong pixels, of clean pairs and of spoilt ones."""
    models = _record("accuracy/trust")["models"]
    kinds = {name: [f["called_valid_by_min_confidence"] for f in _usable_cases(one)] for name, one in models.items()}
    rows = []
    for threshold in next(iter(kinds.values()))[0]:
        row = [threshold]
        for clean, *spoilt in kinds.values():
            for kind in ("right", "wrong"):
                row += [_percent(clean[threshold][kind]), _percent(median(one[threshold][kind] for one in spoilt))]
        rows.append(row)
    heads = [
        f"{_marked(name, one['model_sha256'])}, {kind}, {pairs}"
        for name, one in models.items()
        for kind in ("right", "wrong")
        for pairs in ("clean", "degraded")
    ]
    return _table(["`min_confidence`", *heads], rows)


def _usable_cases(record: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what a record of trust says of pairs without a fault, the clean ones first."""
    return [found for found in record["cases"].values() if "named" not in found]


def fault_naming_table() -> str:
    """How often a fault's cause was named, in clean pairs and in pairs that were spoilt before."""
    record = _record("accuracy/fault_naming")
    kinds = {name: found["pairs"] for name, found in record["datasets"].items()}

    def of(counted: dict[str, int], kind: str) -> str:
        return str(sum(count for name, count in counted.items() if kinds[name] == kind))

    plain = record["without_fault"]
    whole = {name: found["frames"] for name, found in plain.items()}
    not_ok = {name: found["frames"] - found["status"].get("OK", 0) for name, found in plain.items()}
    rows = [["none: frames that are not OK", *(of(not_ok, kind) for kind in ("clean", "spoilt"))]]
    for fault, found in record["faults"].items():
        named = {name: one["named"] for name, one in found["sets"].items()}
        rows.append([fault, *(of(named, kind) for kind in ("clean", "spoilt"))])
    label = _marked("fault", record["model_sha256"])
    return _table([label, *(f"of {of(whole, kind)} {shown} pairs" for kind, shown in PAIRS.items())], rows)


def short_accuracy_table() -> str:
    """What a reader wants to know first: error of our 8-bit models and StereoSGBM on the test pairs."""
    found = _record("accuracy/accuracy")
    rows = []
    for name in ("fast", "fast-320", "accurate", "wang2020", "sgbm-filled"):
        whole = found["methods"][name]["all"]
        shares = (_percent(whole["kpe_3"]), _percent(whole["depth_relative"]))
        rows.append([_method(found, name), f"{whole['epe_px']:.2f} px", *shares])
    return _table(["method", "mean error", "over 3 px", "depth error"], rows)


def short_speed_table() -> str:
    """What a reader wants to know first: frame rates of our models, each with StereoSGBM in the same run."""
    rows = []
    for name, label in SHORT_SPEEDS.items():
        run = _record(f"speed/{name}")
        rates = (run["fps"], run["stream_fps"], run["against"]["sgbm"]["fps"])
        rows.append([_marked(label, run["model"]["sha256"]), *(f"{rate:.0f}" for rate in rates)])
    return _table(["model, frames", "`predict`, FPS", "`stream`, FPS", "StereoSGBM, FPS"], rows)


def speed_table(runs: dict[str, str]) -> str:
    """Frame rates of our models, each with StereoSGBM in the same run; record and label of every run."""
    rows = []
    for name, label in runs.items():
        run = _record(f"speed/{name}")
        delay, sgbm = run["latency_ms"], run["against"]["sgbm"]["fps"]
        rates = [f"{run['fps']:.1f}", f"{run['stream_fps']:.1f}"]
        marked = _marked(label, run["model"]["sha256"])
        rows.append([marked, *rates, f"{delay['p50']:.1f} ms", f"{delay['p99']:.1f} ms", f"{sgbm:.1f}"])
    heads = ["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99", "StereoSGBM, FPS"]
    return _table(heads, rows)


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
    return _table(["cause", "what it means", "what is measured", "DEGRADED", "INVALID", "what to do"], rows)


def arm_instructions_table() -> str:
    """Instructions that each kernel takes on 64-bit ARM, plain and with NEON."""
    rows = [
        [f"`{name}`", f"{counts['plain']:,}", f"{counts['neon']:,}", f"{counts['plain'] / counts['neon']:.1f}"]
        for name, counts in _record("speed/arm_instructions")["instructions"].items()
    ]
    return _table(["kernel", "plain", "NEON", "times fewer"], rows)


def release_files_table() -> str:
    """The files of a release for Linux on x86-64: size, and the newest glibc that a library inside needs."""
    rows = [
        [file["kind"], f"`{name}`", f"{file['bytes'] / 1e6:.1f} MB", ", ".join(sorted(set(file["glibc"].values())))]
        for name, file in _record("speed/release_files")["files"].items()
    ]
    return _table(["file", "name", "size", "needs glibc"], rows)


def reasons_table() -> str:
    """The reasons of a pixel, as the core has them."""
    return _table(
        ["bit", "reason", "what it means"],
        [[str(reason.value), f"`{reason.name}`", reason.__doc__ or ""] for reason in _core.Reason],
    )


def errors_table(model: str) -> str:
    """Errors of one model on every test set that has a record."""
    rows = []
    for record, label in TEST_SETS.items():
        if not (RESULTS / f"{record}.json").is_file() or model not in _record(record)["methods"]:
            continue
        found = _record(record)
        scores = found["methods"][model]
        whole, seen = scores["all"], scores["non_occluded"]
        shares = [_percent(whole[key]) for key in ("kpe_1", "kpe_3")]
        marked = _marked(label, found["models"][model])
        rest = [f"{seen['epe_px']:.3f}", _percent(whole["depth_relative"])]
        rows.append([marked, f"{whole['epe_px']:.3f}", *shares, *rest])
    return _table(["test set", "EPE, px", "over 1 px", "over 3 px", "EPE, non-occluded, px", "depth error"], rows)


def card_speed_table(model: str) -> str:
    """Frame rates and latency of one model."""
    rows = []
    for name in (model, *(f"{model}_{kind}" for kind in CARD_RUNS if f"{model}_{kind}" in SPEEDS)):
        label = SPEEDS[name]
        run = _record(f"speed/{name}")
        frames = _marked(label.removeprefix(f"{model}, "), run["model"]["sha256"])
        rates = [f"{run[key]:.0f}" if run[key] >= 10 else f"{run[key]:.1f}" for key in ("fps", "stream_fps")]
        rows.append([frames, *rates, *(f"{run['latency_ms'][key]:.0f} ms" for key in ("p50", "p99"))])
    return _table(["frames, threads", "`predict`, FPS", "`stream`, FPS", "median", "p99"], rows)


def card_trust_table(model: str) -> str:
    """How far a model can be trusted on clean and on degraded pairs, and how often faults are named."""
    record = _record("accuracy/trust")["models"][model]
    rows = []
    for case in CARD_CASES:
        found = record["cases"][case]
        shares = (found["right_called_valid"], found["wrong_called_valid"], found["within_sigma"])
        rows.append([_marked(case, record["model_sha256"]), _frames(found["status"]), *map(_percent, shares)])
    faults = [found for found in record["cases"].values() if "named" in found]
    status: Counter[str] = Counter()
    for found in faults:
        status.update(found["status"])
    named = _percent(sum(found["named"] for found in faults) / len(faults))
    label = f"{len(faults)} kinds of faults, named in {named}"
    rows.append([_marked(label, record["model_sha256"]), _frames(status), "", "", ""])
    return _table(["pairs", "frames", "right pixels valid", "wrong pixels valid", "error within sigma"], rows)


def _frames(status: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name}" for name, count in sorted(status.items()))


def range_table(model: str) -> str:
    """The nearest depth that one model sees on real rigs, from its own metadata.

    A model without an inference width takes frames up to 960 px as they are: its table is that of such frames.
    """
    facts = {entry.key: entry.value for entry in onnx.load(shipped_models()[model]).metadata_props}
    # Half a pixel before the last candidate a pixel counts as out of range.
    end = int(facts["endosdk.max_candidate_disparity"]) - _core.range_margin
    stated = facts.get("endosdk.inference_width")
    share = end / int(stated or WIDEST_UNRESIZED)
    of = "the width" if stated else f"the width, frames {WIDEST_UNRESIZED} px wide"
    rows = [[f"range of disparities, % of {of} | 0 to {100 * share:.1f}"]]
    for label, (focal, baseline) in RIGS.items():
        rows.append([f"nearest depth on {label} | {focal * baseline / share:.0f} mm"])
    return _table(["what", "value"], rows)


def temporal_table() -> str:
    """What the filter in time leaves of flicker, jumps and errors, as a share of what there is without it."""
    record = _record("accuracy/temporal")
    means = {kind: record[kind]["mean"] for kind in ("still", "flight", "tool")}
    still, flight, tool = means.values()
    rows = [
        ["the scene stands still", still["flicker_ratio"], still["jump_ratio"], still["error_ratio"]],
        ["flight", None, flight["jump_ratio"], flight["error_ratio"]],
        ["flight with a moving tool", None, tool["jump_ratio"], tool["error_ratio"]],
        ["beside the tool", None, tool["jump_ratio_beside_the_tool"], None],
        ["on the tool", None, tool["jump_ratio_on_the_tool"], None],
        ["within 12 px of the tool", None, None, tool["error_ratio_near_tool"]],
    ]
    cells = [[label, *("" if one is None else f"{one:.2f}" for one in ratios)] for label, *ratios in rows]
    return _table([_marked("video", record["model_sha256"]), "flicker", "jumps", "error"], cells)


def measuring_table() -> str:
    """How often the intervals of measures hold the truth, and how far the measures are off."""
    labels = {"depth": "depth of a point", "distance": "distance from edge to edge", "area": "area", "relief": "relief"}
    record = _record("accuracy/measuring")
    columns = {**{name: found["all"] for name, found in record["sets"].items()}, "together": record["all"]}
    rows = [
        [
            label,
            str(record["all"][kind]["measurements"]),
            *(_percent(found[kind]["within_95"]) for found in columns.values()),
            _percent(record["all"][kind]["median_relative_error"]),
        ]
        for kind, label in labels.items()
    ]
    heads = [_marked("measured", record["model_sha256"]), "times"]
    return _table([*heads, *(f"within, {name}" for name in columns), "median error"], rows)


def range_end_table() -> str:
    """What each margin before the last plane finds and loses, by model."""
    models = {name: _record("accuracy/range_end")["models"][name] for name in ("fast", "wang2020")}
    what = ("marked_of_surfaces_beyond", "beyond_the_max_candidate_disparity_of_marked", "marked_of_right_answers")
    heads = ["margin, px"]
    for name, model in models.items():
        label = _marked(f"`{name}`", model["model_sha256"])
        heads += [f"{label}: marked of surfaces beyond", "of marked, beyond the last plane", "right answers lost"]
    rows = []
    for margins in zip(*(model["margins"] for model in models.values()), strict=True):
        cells = [f"{margins[0]['margin_px']:g}", *(_percent(margin[key]) for margin in margins for key in what)]
        rows.append([f"**{cell}**" for cell in cells] if margins[0]["margin_px"] == _core.range_margin else cells)
    return _table(heads, rows)


def upsampling_table() -> str:
    """Errors of the same network output, upsampled in two ways."""
    rows = []
    for name, found in _record("studies/upsampling_cycles")["models"].items():
        cells = [f"{found[way]['epe_px']:.3f}" for way in ("bilinear", "joint_bilateral")]
        cells += [_percent(found[way]["kpe_3"]) for way in ("bilinear", "joint_bilateral")]
        rows.append([_marked(METHODS[name], found["model_sha256"]), *cells])
    heads = ["method", "EPE, bilinear, px", "EPE, joint bilateral, px", "over 3 px, bilinear"]
    return _table([*heads, "over 3 px, joint bilateral"], rows)


def spoilt_files_table() -> str:
    """Every reader of strangers' files: spoilt ones tried, how many were read, refused by which code, anything else."""
    rows = []
    for name, reader in _record("studies/spoilt_files")["readers"].items():
        outcomes = dict(reader["outcomes"])
        read = outcomes.pop("read", 0)
        untyped = sum(outcomes.pop(kind) for kind in list(outcomes) if kind.startswith("untyped"))
        refused = ", ".join(f"{count} {code}" for code, count in outcomes.items())
        rows.append([name, str(reader["tried"]), str(read), refused, str(untyped), f"{reader['slowest_s']:.2f}"])
    heads = ["file", "tried", "still valid, read", "rejected with a typed error", "anything else", "slowest, s"]
    return _table(heads, rows)


def fuzzed_table() -> str:
    """What libFuzzer has tried on the C library."""
    labels = {"model": "model file", "calibration": "rig", "frame": "pair of frames, with strides and formats"}
    found = _record("speed/c_library")["fuzz"]["result"]
    rows = [
        [labels[name], f"{one['inputs']:,}", f"{one['edges_reached']:,}", str(one["failures"])]
        for name, one in found.items()
    ]
    return _table(["input", "tried", "branches reached", "crashes, hangs, reports"], rows)


def attacks_table() -> str:
    """Every file of tests of bad input: what it tries, in its own words, and how many tests it has."""
    rows = []
    for interface, files in ATTACKS.items():
        counts = [len(tests_in(file.read_text())) for file in files]
        for file, count in zip(files, counts, strict=True):
            tries = file.read_text().partition("\n")[0].strip('/" ')
            rows.append([interface, f"`{file.relative_to(SOURCES)}`", tries, str(count)])
        rows.append([f"**{interface}, together**", "", "", f"**{sum(counts)}**"])
    return _table(["interface", "file", "what it tries", "tests"], rows)


def tests_in(text: str) -> set[str]:
    """Return the test functions of a Python file, or those that the main function of a C++ program calls."""
    program, _, main = text.partition("int main(")
    called = set(re.findall(r"\w+", main))
    return set(re.findall(r"^def (test_\w+)", text, re.MULTILINE)) | {
        name for name in re.findall(r"^void (\w+)\(", program, re.MULTILINE) if name in called
    }


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
    "accuracy-cycles": partial(accuracy_table, "accuracy/accuracy_cycles"),
    "edges-cycles": partial(edges_table, "accuracy/accuracy_cycles"),
    "middlebury": partial(parts_table, "accuracy/middlebury"),
    "lap": partial(parts_table, "accuracy/accuracy_lap"),
    "lap-cycles": partial(parts_table, "accuracy/accuracy_lap_cycles"),
    "speed": partial(speed_table, SPEEDS),
    "range-end": range_end_table,
    "arm-instructions": arm_instructions_table,
    "attacks": attacks_table,
    "causes": causes_table,
    "fault-naming": fault_naming_table,
    "min-confidence": min_confidence_table,
    "reasons": reasons_table,
    "release-files": release_files_table,
    "fuzzed": fuzzed_table,
    "measuring": measuring_table,
    "spoilt-files": spoilt_files_table,
    "temporal": temporal_table,
    "upsampling": upsampling_table,
    "versions": lambda: versions_table(_record("studies/wang2020_versions")["versions"]),
}


TABLES |= {f"errors:{name}": partial(errors_table, name) for name in CARDS}
TABLES |= {f"trust:{name}": partial(trust_table, name) for name in ("fast", "accurate")}
TABLES |= {f"short-trust:{name}": partial(card_trust_table, name) for name in ("fast", "accurate")}
TABLES |= {f"range:{name}": partial(range_table, name) for name in CARDS}
TABLES |= {f"speed:{name}": partial(card_speed_table, name) for name in CARDS}


def filled(text: str) -> str:
    """Return the document with every table written anew."""
    return PLACE.sub(lambda place: place[1] + TABLES[place[2]]() + place[3], text)


def _record(name: str) -> dict[str, Any]:
    record: dict[str, Any] = json.loads((RESULTS / f"{name}.json").read_text())
    return record


def _method(record: dict[str, Any], name: str) -> str:
    """Return the label of a method's row; a record of methods has the hashes of those that are models."""
    return _marked(METHODS[name], record["models"].get(name))


def _marked(label: str, sha256: str | None) -> str:
    """Mark the label of numbers of a model file that no longer ships; methods without a file have no hash.

    Every table that shows a model's numbers marks its rows or its columns here.
    """
    shipped = tomllib.loads(MANIFEST.read_text()).values()
    return label if sha256 is None or sha256 in {entry["sha256"] for entry in shipped} else f"{label} {STALE}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _table(heads: list[str], rows: list[list[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    table = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    labels = [*heads, *(cells[0] for cells in rows)]
    return table + (f"\n{STALE_NOTE}\n" if any(STALE in label for label in labels) else "")


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
