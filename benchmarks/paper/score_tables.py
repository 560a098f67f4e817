"""Tables of what was measured: the sets, the errors and times of every method, and what each run was given."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.methods.classical import BM_RANGE_PX, SEARCHED
from benchmarks.paper.experiments import (
    EXPERIMENTS,
    FRAME,
    GROUPS,
    LABELS,
    PROTOCOLS,
    SEEDS,
    Experiment,
    rows_by_name,
    size,
)
from benchmarks.paper.paper_records import NOT_RECORDED, PaperRecords, given, label_of
from benchmarks.paper.verdicts import NOT_MEASURED
from benchmarks.tables.markdown import percent, table
from benchmarks.tables.ranges import facts_of
from endosdk.training.config import TrainConfig

GIVEN = ["samples seen", "training pairs", "TMAC", "hours", "precision", "seed", "budget"]
ROWED = {**LABELS, **SEEDS}  # the methods of Table 1, in its order
# What the paper states of its own measurements: method, test pairs, EPE and time.
STATED = (
    ("wang2020, as its paper states", "100 pairs of the paper", "0.4145", "21.8 (45 FPS, GTX 1080)"),
    ("AnyNet, as that paper states", "", "", "37.0 (27 FPS)"),
)
PARTS = {
    "edges": "depth edges",
    "occluded": "occluded",
    "glare": "glare",
    "low_texture": "low texture",
    "instrument_edges": "instrument edges",
}


def protocols_table() -> str:
    """What the paper's protocol and ours give to a run."""
    configs = [TrainConfig.from_dict(settings) for settings in PROTOCOLS.values()]
    samples = [settings.get("epochs", 0) * settings["train_pairs"] for settings in PROTOCOLS.values()]
    rows = [
        ["samples", *(str(seen or one.steps * one.batch) for seen, one in zip(samples, configs, strict=True))],
        ["size of a sample, px", *(size(settings["crop"]) for settings in PROTOCOLS.values())],
        ["training pairs", *(str(one.train_pairs) for one in configs)],
        ["batch", *(str(one.batch) for one in configs)],
        ["augmentation", *("strong" if one.augment else "none" for one in configs)],
        ["planes", "from 0 to D, D included", "from 0 to 8 px below D"],
        ["loss", *(one.loss for one in configs)],
        ["weight of the coarse map's loss", *(f"{one.coarse_weight:g}" for one in configs)],
        ["optimiser", *(one.optimiser for one in configs)],
        ["learning rate", *(f"{one.rate:g} to {one.final_rate:g}" for one in configs)],
        ["it falls", *("by one factor an epoch" if one.decay == "epochs" else one.decay for one in configs)],
        ["warm-up, steps", *(str(one.warmup) for one in configs)],
        ["limit of the gradient", *(f"{one.clip:g}" if one.clip else "none" for one in configs)],
    ]
    return table(["setting", "the paper's protocol", "our protocol"], rows)


def not_run_table(records: PaperRecords) -> str:
    """The experiments that no record has, and those that ended early, by the group that shows them."""
    found = {**records.methods, **records.known}
    of_group = {key: [run for run in EXPERIMENTS if run.group == key] for key in GROUPS}
    titles = {key: f"{group.title} ({group.figures})" for key, group in GROUPS.items()} | {"table1": "Table 1"}
    rows = []
    for key, runs in of_group.items():
        labels = LABELS if key == "table1" else {run.name: run.label for run in runs if "seed" not in run.changes}
        missing = [said for name, label in labels.items() if (said := _missing(name, label, runs, found))]
        early = [
            f"{label}: {row['samples_seen']} of {row['samples_planned']} samples"
            for name, label in {**{run.name: run.label for run in runs}, **(ROWED if key == "table1" else {})}.items()
            if (row := found.get(name)) is not None and not row.get("complete", True)
        ]
        if missing or early:
            rows.append([titles[key], "; ".join(missing), "; ".join(early)])
    return table(["experiment", "not run", "stopped early"], rows or [["all", "none is missing", ""]])


def _missing(name: str, label: str, runs: list[Experiment], found: dict[str, Any]) -> str:
    """Name a method or a run that has not been run at all, or those of its further seeds that have not."""
    if name not in found:
        return label
    further = [run for run in runs if run.name.startswith(f"{name}-seed") and run.name not in found]
    seeds = " and ".join(str(run.changes["seed"]) for run in further)
    return f"{label}, seed{'s' if len(further) > 1 else ''} {seeds}" if further else ""


def sets_table(records: PaperRecords) -> str:
    """The pairs behind each table, and where its methods were timed."""
    rows = []
    for name, found in records.tables.items():
        where = _usual_processor(found) or found.get("machine", {}).get("cpu", NOT_RECORDED)
        load = found.get("load_while_timed")
        busy = NOT_RECORDED if load is None else f"{load:.1f}"
        rows.append([name, *_set(found, found["methods"].values()), where, str(found["threads"]), busy])
    for record in records.ablations:
        ran = rows_by_name(record["groups"]).values()
        rows.append([f"{record['dataset']}, for the ablations", *_set(record, ran), "", "", ""])
    heads = ["test pairs of", "SHA-256", "pairs", "pixels with truth", "of them non-occluded"]
    return _table([*heads, "timed on", "threads", "load"], rows)


def _set(record: dict[str, Any], rows: Any) -> list[str]:
    """Return what a set is: every row of a table has the same pixels, and older ones do not know the non-occluded."""
    pixels = {row["pixels"] for row in rows}
    seen = {row["pixels_noc"] for row in rows if row.get("pixels_noc")}
    return [
        record["sha256"][:8],
        str(record["pairs"]),
        *(", ".join(f"{one:,}" for one in sorted(some)) for some in (pixels, seen)),
    ]


def errors_table(records: PaperRecords) -> str:
    """Error and time of every method on every set of pairs."""
    rows = []
    for pairs, found in records.tables.items():
        usual = _usual_processor(found)
        for label, row, timed in _methods(found):
            other = "" if timed is None or _processor(timed) == usual else f" ({_processor(timed)})"
            rows.append([label, pairs, *_errors(row), f"{row['ms']:.1f}{other}"])
    stated = [[method, pairs, epe, *([""] * 6), time] for method, pairs, epe, time in STATED] if rows else []
    heads = ["method", "test pairs of", "EPE, px", "over 1 px", "over 2 px", "over 3 px", "over 5 px"]
    return _table([*heads, "EPE, non-occluded, px", "coverage", "ms"], [*stated, *rows])


def _methods(found: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any], dict[str, Any] | None]]:
    """Yield the label, the row and the machine of every method that has been run, in the order of the page."""
    for name in ROWED:
        if name in found["methods"]:
            row = found["methods"][name]
            label = label_of(name, row)
            yield label, row, row.get("timed_on")
            if "unfilled" in row:
                yield f"{label}, holes left open", row["unfilled"], row.get("timed_on")


def _errors(row: dict[str, Any]) -> list[str]:
    visible = "" if row["epe_noc"] is None else f"{row['epe_noc']:.3f}"
    return [
        f"{row['epe']:.4f}",
        *(percent(row["kpe"][k]) for k in ("1", "2", "3", "5")),
        visible,
        percent(row["coverage"]),
    ]


def _usual_processor(found: dict[str, Any]) -> str | None:
    """Return the processor on which most rows were timed; None where no row says."""
    known = [_processor(row["timed_on"]) for row in found["methods"].values() if "timed_on" in row]
    return max(known, key=known.count) if known else None


def _processor(timed: dict[str, Any]) -> str:
    known = timed["instructions"]
    return timed["cpu"] if known is None else f"{timed['cpu']}, {', '.join(known) or 'no instructions for networks'}"


def runs_table(records: PaperRecords) -> str:
    """What each method of the tables is and was given, once."""
    rows: dict[str, list[str]] = {}
    for found in records.tables.values():
        for name in ROWED:
            row = found["methods"].get(name)
            if row is not None:
                params = f"{row['params']:,}" if row.get("params") else ""
                products = f"{row['gmacs']:.1f}" if row.get("gmacs") else ""
                rows.setdefault(label_of(name, row), [params, products, _range(name, row), *given(row)])
    heads = ["method", "parameters", "GMAC a frame", "D, px", *GIVEN]
    return _table(heads, [[label, *cells] for label, cells in rows.items()])


def _range(name: str, row: dict[str, Any]) -> str:
    """Return the maximum disparity of a method's settings or model, px of a frame of `FRAME`."""
    settings = row.get("settings") or {}
    if "max_disparity" in settings:
        return str(settings["max_disparity"])
    if name == "bm":
        return str(BM_RANGE_PX)
    planned = [run for run in EXPERIMENTS if run.name == name]  # an older row has no settings
    if planned:
        return str(planned[0].settings("cpu", {})["max_disparity"])
    facts = facts_of(name.removeprefix("shipped-")) if name.startswith("shipped-") else {}
    if not facts or facts["endosdk.version"] != row.get("version"):
        return NOT_RECORDED
    seen = int(facts.get("endosdk.inference_width", FRAME[1]))
    return f"{int(facts['endosdk.max_disparity']) * FRAME[1] / seen:.0f}"


def search_table(records: PaperRecords) -> str:
    """Where the settings of StereoSGBM come from."""
    search = records.read("paper/sgbm_search")
    methods = records.table.get("methods", {})
    rows = []
    for name in ("sgbm", "sgbm-hh"):
        form = search.get("forms", {}).get(name, {})
        if name not in methods:
            continue
        if form.get("best") == methods[name]["settings"]:
            data = search["data"]
            pairs = f"{len(search['pairs'])} of the {data['split']} split of {data['name']}"
            best = ", ".join(
                f"{key.replace('_', ' ')} {value}" for key, value in form["best"].items() if key in SEARCHED
            )
            rows.append([LABELS[name], str(len(form["tried"])), pairs, best])
        else:
            rows.append([LABELS[name], NOT_RECORDED, "", ""])
    return _table(["method", "settings tried", "pairs", "best"], rows)


def learned_table(records: PaperRecords) -> str:
    """The error on pairs that the runs have learned from, beside that on test pairs."""
    rows = [
        [ROWED[name], str(row["train_pairs_scored"]), f"{row['train_epe']:.3f}", f"{row['epe']:.3f}"]
        for name in ROWED
        if (row := records.methods.get(name, {})).get("train_epe") is not None
    ]
    return _table(["method", "training pairs scored", "EPE on them, px", "EPE on test pairs, px"], rows)


def stages_table(records: PaperRecords) -> str:
    """The error of AnyNet after each of its stages."""
    rows = [
        [ROWED[name], *(f"{error:.3f}" for error in row["stages"])]
        for name in ROWED
        if (row := records.methods.get(name, {})).get("stages")
    ]
    return _table(["EPE, px", "stage 1", "stage 2", "stage 3", "stage 4"], rows)


def parts_table(records: PaperRecords) -> str:
    """The error on the parts of the frame that the paper names as open."""
    rows = []
    for pairs, found in records.tables.items():
        for name, row in found["methods"].items():
            if name in ROWED and row.get("parts"):
                shown = [row["parts"].get(key) for key in PARTS]
                cells = [f"{one['epe']:.3f} ({percent(one['pixels'] / row['pixels'])})" if one else "" for one in shown]
                rows.append([label_of(name, row), pairs, f"{row['epe']:.3f}", *cells])
    return _table(["method", "test pairs of", "all", *PARTS.values()], rows)


def ablations_table(records: PaperRecords) -> str:
    """Every run of the ablations that has been done."""
    rows = []
    for run in EXPERIMENTS:
        if run.group != "table1" and (row := records.ablated.get(run.name)):
            within = f"{row['epe_in_range']:.4f}" if row.get("epe_in_range") is not None else ""
            loss = f"{row['last_loss']:.4g}" if row.get("last_loss") is not None else ""
            cells = [f"{row['epe']:.4f}", within, percent(row["kpe"]["1"]), loss, *given(row)]
            rows.append([run.label, GROUPS[run.group].figures, *cells])
    return _table(["run", "figure", "EPE, px", "EPE in range, px", "over 1 px", "loss in the last epoch", *GIVEN], rows)


def earlier_table(records: PaperRecords) -> str:
    """The ablations of the first report."""
    groups = records.read("history/paper/ablations").get("groups", {})
    rows = [
        [GROUPS[key].figures, label, f"{row['epe']:.4f}"]
        for key, found in groups.items()
        for label, row in found.items()
        if row
    ]
    return _table(["figure", "run", "EPE, px"], rows)


def _table(heads: list[str], rows: list[list[str]]) -> str:
    """Return a table; one without rows says that nothing was measured."""
    return table(heads, rows or [[NOT_MEASURED, *([""] * (len(heads) - 1))]])
