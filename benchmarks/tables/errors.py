"""Errors of disparity and depth: of every method on a test set, of one model on every set, upsampling, versions."""

from __future__ import annotations

from benchmarks.tables import records
from benchmarks.tables.markdown import percent, table

TEST_SETS = {  # record and label, for the tables of one model
    "accuracy/accuracy": "`endosim-gi`, rendered, 100 pairs",
    "accuracy/accuracy_cycles": "`endosim-gi-cycles`, path-traced, 60 pairs",
    "accuracy/accuracy_lap": "`endosim-lap`, instruments and image faults, 100 pairs",
    "accuracy/accuracy_lap_cycles": "`endosim-lap-cycles`, path-traced, 40 pairs",
}


def accuracy_table(record: str = "accuracy/accuracy") -> str:
    """Errors of our models and StereoSGBM on the test pairs."""
    found = records.read(record)
    heads = ["method", "EPE, px", "over 1 px", "over 3 px", "coverage"]
    heads += ["EPE, non-occluded", "over 1 px, non-occluded", "depth error"]
    rows = []
    for label, scores in records.rows(found):
        whole, seen = scores["all"], scores["non_occluded"]
        shares = [f"{100 * whole[key]:.1f} %" for key in ("kpe_1", "kpe_3", "coverage")]
        rest = [f"{seen['epe_px']:.3f}", f"{100 * seen['kpe_1']:.1f} %", f"{100 * whole['depth_relative']:.1f} %"]
        rows.append([label, f"{whole['epe_px']:.3f}", *shares, *rest])
    return table(heads, rows)


def short_accuracy_table() -> str:
    """What a reader wants to know first: error of our 8-bit models and StereoSGBM on the test pairs."""
    found = records.read("accuracy/accuracy")
    rows = []
    for name in ("fast", "fast-320", "accurate", "wang2020", "sgbm-filled"):
        whole = found["methods"][name]["all"]
        shares = (percent(whole["kpe_3"]), percent(whole["depth_relative"]))
        rows.append([records.method(found, name), f"{whole['epe_px']:.2f} px", *shares])
    return table(["method", "mean error", "over 3 px", "depth error"], rows)


def edges_table(record: str) -> str:
    """Errors near depth edges and where only one camera sees, of our models and StereoSGBM."""
    found = records.read(record)
    rows = []
    for label, scores in records.rows(found):
        edges, tools = scores["edges"], scores["instrument_edges"]
        shares = (edges["kpe_3"], edges["flying"], tools["kpe_3"], scores["occluded"]["kpe_3"])
        near, flying, near_tools, hidden = map(percent, shares)
        rows.append([label, f"{edges['epe_px']:.2f}", near, flying, f"{tools['epe_px']:.2f}", near_tools, hidden])
    heads = ["method", "EPE near edges, px", "over 3 px near edges", "flying pixels"]
    return table([*heads, "EPE near instrument edges, px", "over 3 px near these", "over 3 px, occluded"], rows)


def looks_table() -> str:
    """Error of our models on the same pairs with one change of their looks, and by how much it grows."""
    found = records.read("accuracy/looks")
    first, *others = next(iter(found["looks"].values()))
    rows = []
    for name in (name for name in records.METHODS if name in found["looks"]):
        errors = {look: scores["epe_px"] for look, scores in found["looks"][name].items()}
        cells = [f"{errors[look]:.3f} ({100 * (errors[look] / errors[first] - 1):+.0f} %)" for look in others]
        rows.append([records.method(found, name), f"{errors[first]:.3f}", *cells])
    return table(["method", f"{first}: EPE, px", *others], rows)


def parts_table(record: str) -> str:
    """Share of wrong pixels among all, among those in a method's range, and among those that it calls valid."""
    found = records.read(record)
    rows = []
    for label, scores in records.rows(found):
        all_, seen, ranged, valid = (scores[part] for part in ("all", "non_occluded", "in_range", "valid"))
        shares = (all_["kpe_3"], seen["kpe_3"], ranged["share"], ranged["kpe_3"], valid["share"], valid["kpe_3"])
        rows.append([label, *map(percent, shares)])
    heads = ["method", "over 3 px", "non-occluded", "in range", "of these over 3 px", "valid", "of these over 3 px"]
    return table(heads, rows)


def real_front_table() -> str:
    """Errors on real pairs of models that see them at several widths, and the time of a frame of the same file."""
    found, timed = records.read("accuracy/pareto_front_real"), records.read("accuracy/pareto_front")
    rows = []
    for name, point in found["points"].items():
        sha256 = found["models"][name]
        known = timed["model_sha256"].get(name) == sha256
        time = f"{timed['points'][name]['ms']:.0f} ms" if known else "not timed"
        label = records.marked(records.METHODS[point["model"]], sha256)
        errors = [percent(point["in_range"]), f"{point['epe_px']:.2f}", percent(point["kpe_3"])]
        rows.append([label, f"{point['network_width']} px", time, *errors])
    return table(["method", "inference width", "time of a frame", "in range", "EPE of these, px", "over 3 px"], rows)


def errors_table(model: str) -> str:
    """Errors of one model on every test set that has a record."""
    rows = []
    for record, label in TEST_SETS.items():
        if not (records.RESULTS / f"{record}.json").is_file() or model not in records.read(record)["methods"]:
            continue
        found = records.read(record)
        scores = found["methods"][model]
        whole, seen = scores["all"], scores["non_occluded"]
        shares = [percent(whole[key]) for key in ("kpe_1", "kpe_3")]
        marked = records.marked(label, found["models"][model])
        rest = [f"{seen['epe_px']:.3f}", percent(whole["depth_relative"])]
        rows.append([marked, f"{whole['epe_px']:.3f}", *shares, *rest])
    return table(["test set", "EPE, px", "over 1 px", "over 3 px", "EPE, non-occluded, px", "depth error"], rows)


def upsampling_table() -> str:
    """Errors of the same network output, upsampled in two ways."""
    rows = []
    for name, found in records.read("studies/upsampling_cycles")["models"].items():
        cells = [f"{found[way]['epe_px']:.3f}" for way in ("bilinear", "joint_bilateral")]
        cells += [percent(found[way]["kpe_3"]) for way in ("bilinear", "joint_bilateral")]
        rows.append([records.marked(records.METHODS[name], found["model_sha256"]), *cells])
    heads = ["method", "EPE, bilinear, px", "EPE, joint bilateral, px", "over 3 px, bilinear"]
    return table([*heads, "over 3 px, joint bilateral"], rows)


def versions_table() -> str:
    """Error of each version of wang2020, and what was new in its training."""
    rows = []
    for number, version in records.read("studies/wang2020_versions")["versions"].items():
        errors = [f"{version[data]['epe_px']:.3f}" for data in ("endosim-gi", "endosim-gi-cycles")]
        rows.append([number, version["phases"], version["what_is_new"], *errors])
    return table(["version", "phases", "new in the last one", "EPE, px", "path-traced, px"], rows)
