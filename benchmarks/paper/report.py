"""The report: Table 1, and each comparison of the paper with ours and a sentence on whether its claim held."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from benchmarks.paper.experiments import (
    COMPARED,
    EXPERIMENTS,
    GROUPS,
    LABELS,
    PAPER_EPE_PX,
    PAPER_TIMES,
    SEEDS,
    TARGET_EPE_PX,
    Group,
    crops,
    rows_by_name,
)
from benchmarks.paper.notes import (
    CHANGED,
    cause_note,
    frames_note,
    given,
    learned_note,
    search_note,
    sgbm_note,
    shipped_note,
    stages_note,
    target_note,
)
from benchmarks.paper.one_kind import check_one_kind
from benchmarks.paper.verdicts import (
    FIGURE_ORDERS,
    NOT_MEASURED,
    NOT_RUN,
    Bound,
    Rows,
    claim_verdict,
    error_verdict,
    order_verdict,
    repeat_bound,
    time_verdict,
)
from benchmarks.tables import versions_table

PARTS = {
    "edges": "depth edges",
    "occluded": "occluded",
    "glare": "glare",
    "low_texture": "low texture",
    "instrument_edges": "instrument edges",
}


def write_report(results: Path, docs: Path) -> Path:
    """Write ``report.md`` from the tables and figures there are; the documentation site shows it as a page."""
    table, ablations = _read(results / "paper/table1.json"), _read(results / "paper/ablations.json")
    others = [_read(file) for file in sorted(results.glob("paper/table1_*.json"))]
    search = _read(results / "paper/sgbm_search.json")
    known = {**table.get("methods", {}), **rows_by_name(ablations.get("groups", {}))}
    for name, rows in (("table1.json", table.get("methods", {})), ("ablations.json", known)):
        check_one_kind(name, rows)
    bound = repeat_bound(known)
    lines = [*_head(table), *_table("Table 1", table)]
    for note in (search_note(table, search), sgbm_note(table, search), learned_note(known), stages_note(known)):
        lines += _paragraph(note)
    for other in others:
        lines += _table(f"Table 1 on {_data_of(other, table)}", other)
    lines += [
        *_methods([table, *others], bound),
        *_pictures_judged(table.get("methods", {}), bound, docs),
        *_parts([table, *others]),
        *_past_the_paper(_read(results / "studies/wang2020_versions.json"), bound),
        *_ablations(ablations, known, bound, docs),
        *_histogram(docs),
        *_earlier(_read(results / "history/paper/ablations.json")),
    ]
    text = "\n".join(lines).rstrip() + "\n"
    docs.mkdir(parents=True, exist_ok=True)
    file = docs / "report.md"
    file.write_text(text)
    return file


def _data_of(other: dict[str, Any], table: dict[str, Any]) -> str:
    """Name the pairs of another table, as they differ from those of Table 1."""
    if other["dataset"] != table.get("dataset"):
        return str(other["dataset"])
    if other["sha256"] != table["sha256"]:
        return f"{other['dataset']}, rendered anew on another machine, where it has other bits"
    return f"the first {other['pairs']} pairs of {other['dataset']}"


def _paragraph(text: str) -> list[str]:
    return [text, ""] if text else []


def _picture(title: str, file: Path) -> list[str]:
    return _paragraph(f"![{title}]({file.name})") if file.exists() else []


def _read(file: Path) -> dict[str, Any]:
    return dict(json.loads(file.read_text())) if file.exists() else {}


def _head(table: dict[str, Any]) -> list[str]:
    data = f"{table['dataset']}, {table['pairs']} test pairs, SHA-256 {table['sha256'][:8]}" if table else NOT_RUN
    return [
        "# The paper's experiments, redone",
        "",
        "X.-Z. Wang, Y. Nie, S.-P. Lu, J. Zhang: Deep Convolutional Network for Stereo Depth Mapping in Binocular "
        "Endoscopy, IEEE Access 8, 2020, doi 10.1109/ACCESS.2020.2987767.",
        "",
        f"Data: {data}.",
        "",
        frames_note(),
        "",
        "Each row says what it was given. What has not been run is named and has no number.",
        "",
        "## What has changed since the last report",
        "",
        *(line for change in CHANGED for line in (change, "")),
    ]


def _table(title: str, table: dict[str, Any]) -> list[str]:
    lines = [
        f"## {title}",
        "",
        "| method | EPE, px | over 1 / 2 / 3 / 5 px | EPE, non-occluded | coverage | ms | parameters | GMAC | pairs | "
        "pixels | given | timed |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
        *(_papers_line(name) for name in PAPER_TIMES),
    ]
    methods = table.get("methods", {})
    default = _default_timing(methods)
    for name, label in {**LABELS, **SEEDS}.items():
        if name not in methods:
            # Further seeds are no rows that the paper has.
            lines += [f"| {label} | {NOT_RUN} | | | | | | | | | | |"] if name in LABELS else []
            continue
        timed = _timing_note(methods[name], default)
        lines.append(_line(label, methods[name], given(name, methods[name]), timed))
        if "unfilled" in methods[name]:
            lines.append(_line(f"{label}, holes left open", methods[name]["unfilled"], "", ""))
    load = table.get("load_while_timed")
    busy = "" if load is not None and load <= table["threads"] else "; taken with other work on the machine"
    if busy and load is not None:
        busy += f" (load {load:.1f}), so too long by factors that differ from row to row"
    where = _processor(default) if default else table.get("machine", {}).get("cpu", "no machine")
    lines += ["", f"Times on {where}, {table.get('threads', 0)} threads{busy}.", ""]
    return [*lines, *_seen(methods)]


def _papers_line(name: str) -> str:
    """Write what the paper states of a network: on its own data and card."""
    epe = str(PAPER_EPE_PX) if name == "wang2020" else ""
    pairs = "100" if name == "wang2020" else ""
    time = f"{PAPER_TIMES[name]}, GTX 1080"
    return f"| the paper's {name}, on its own data | {epe} | | | | {time} | | | {pairs} | | the paper's | |"


def _default_timing(methods: dict[str, dict[str, Any]]) -> dict[str, Any] | None:
    """Return the processor on which most rows were timed; None where no row says."""
    known = [row["timed_on"] for row in methods.values() if "timed_on" in row]
    return max(known, key=known.count) if known else None


def _timing_note(row: dict[str, Any], default: dict[str, Any] | None) -> str:
    timed = row.get("timed_on")
    return "" if timed is None or timed == default else f"**timed on another machine**, {_processor(timed)}"


def _processor(timed: dict[str, Any]) -> str:
    known = timed["instructions"]
    return timed["cpu"] if known is None else f"{timed['cpu']} ({', '.join(known) or 'no instructions for networks'})"


def _seen(rows: dict[str, dict[str, Any] | None]) -> list[str]:
    """Name the sets that the runs among the rows were trained on."""
    said = [_version(row["train_data"]) for row in rows.values() if row and "train_data" in row]
    return [f"Trained on {'; others on '.join(dict.fromkeys(said))}.", ""] if said else []


def _version(data: dict[str, Any]) -> str:
    return f"{data['name']} (SHA-256 {data['sha256'][:8]}), {data['pairs']} pairs"


def _line(label: str, row: dict[str, Any], *notes: str) -> str:
    shares = " / ".join(f"{100 * row['kpe'][k]:.1f}" for k in ("1", "2", "3", "5"))
    visible = "" if row["epe_noc"] is None else f"{row['epe_noc']:.3f}"
    params = f"{row['params']:,}" if row.get("params") else ""
    gmacs = f"{row['gmacs']:.1f}" if row.get("gmacs") else ""
    cells = (label, f"{row['epe']:.4f}", f"{shares} %", visible, f"{100 * row['coverage']:.1f} %", f"{row['ms']:.1f}")
    return "| " + " | ".join((*cells, params, gmacs, str(row["pairs"]), _pixels(row), *notes)) + " |"


def _pixels(row: dict[str, Any]) -> str:
    """Pixels with truth, over which all shares and errors of a row are taken as far as it answers."""
    visible = row.get("pixels_noc")
    return f"{row['pixels']:,}" + (f", {visible:,} non-occluded" if visible else "")


def _methods(tables: list[dict[str, Any]], bound: Bound) -> list[str]:
    """Judge wang2020 against each other method, in the first table on the set of Table 1 that has both."""
    group = GROUPS["table1"]
    names = ", ".join(LABELS[name] for name in COMPARED)
    lines = [*_heading(group), f"The paper: wang2020 has a smaller error and takes less time than {names}.", ""]
    runs = ("paper-192", "paper-72", "wang2020", "wang2020-adam")
    lines += [
        f"| method | test pairs | the smaller error: {' | '.join(LABELS[run] for run in runs)} | the shorter time |",
        "|---|---|" + "---|" * (len(runs) + 1),
    ]
    here = [table for table in tables if table.get("sha256") == tables[0].get("sha256")]
    for name in COMPARED:
        table = next((table for table in here if name in table.get("methods", {})), None)
        if table is None:
            lines.append(f"| {LABELS[name]} | {NOT_RUN} | | | | | |")
            continue
        rows = table["methods"]
        errors = [error_verdict(run, name, rows, bound) for run in runs]
        timed = next((run for run in runs if run in rows), "paper-192")
        lines.append(
            f"| {LABELS[name]} | {table['pairs']} | {' | '.join((*errors, time_verdict(timed, name, rows)))} |"
        )
    whole = tables[0].get("methods", {})
    said = f"No error is judged yet: {bound.said()}."
    if bound.known:
        share = f"{100 * bound.share:.1f} %, as those of two runs of one setting in {bound.settings} settings"
        said = f"Errors closer than {share}, are not told apart."
    lines += ["", *_paragraph(cause_note(whole)), *_paragraph(shipped_note(whole)), f"{said} {group.remark}", ""]
    return lines


def _pictures_judged(rows: Rows, bound: Bound, docs: Path) -> list[str]:
    lines = [
        "## Disparity pictures (Fig. 6)",
        "",
        "Blur is taken as the error near depth edges, noise as how much the error bends from pixel to pixel elsewhere.",
        "",
    ]
    for order in FIGURE_ORDERS:
        lines += [f"The paper: {order.text}. Ours: {order_verdict(order, rows, bound)}", ""]
    return [*lines, *_picture("Methods side by side", docs / "methods.png")]


def _parts(tables: list[dict[str, Any]]) -> list[str]:
    """Show the error of every row on the parts of the frame that the paper names as open."""
    lines = [
        "## Where the errors are",
        "",
        "The paper names gloss, texture and occlusion as open. The parts are those of `endosdk evaluate`: "
        "docs/public-sets.md says how each is found. Test EPE in px, and its share of the pixels with truth.",
        "",
    ]
    for table in tables:
        rows = {name: row for name, row in table.get("methods", {}).items() if row.get("parts")}
        if not rows:
            continue
        lines += [
            f"On {table['dataset']}:",
            "",
            f"| method | all | {' | '.join(PARTS.values())} |",
            "|---|" + "---|" * 6,
        ]
        for name, row in rows.items():
            cells = [
                f"{part['epe']:.3f} ({100 * part['pixels'] / row['pixels']:.1f} %)" if part else ""
                for part in (row["parts"].get(key) for key in PARTS)
            ]
            lines.append(f"| {({**LABELS, **SEEDS})[name]} | {row['epe']:.3f} | {' | '.join(cells)} |")
        lines.append("")
    return lines if lines[-2].startswith("|") else [*lines, f"{NOT_MEASURED}.", ""]


def _past_the_paper(record: dict[str, Any], bound: Bound) -> list[str]:
    """Say what our own recipe brought the network to, step by step."""
    versions = record.get("versions")
    if not versions:
        return []
    last = list(versions)[-1]
    reached = versions[last]["endosim-gi"]["epe_px"]
    lines = [
        "## Past the paper",
        "",
        f"The target for our best recipe of the same network: {TARGET_EPE_PX:.2f} px over all pixels of the test "
        "pairs. "
        f"{target_note(last, reached, bound)} Its layers "
        "are those of the paper. From version 8 on it answers for 4 x 4 pixels, which the SDK upsamples. From "
        "version 11 on a step without weights stands between matching and refinement. The phases are in "
        "docs/history/models.md.",
        "",
    ]
    return [*lines, versions_table(versions)]


def _ablations(ablations: dict[str, Any], known: Rows, bound: Bound, docs: Path) -> list[str]:
    groups = ablations.get("groups", {})
    lines = ["## Ablations", ""]
    if bound.known:
        share = f"up to {100 * bound.share:.1f} % over {bound.settings} settings"
        lines += [f"Two runs of one setting differ by {share}: what lies closer is not told apart.", ""]
    else:
        lines += [f"Nothing is decided yet: {bound.said()}.", ""]
    for key, group in GROUPS.items():
        if key == "table1":
            continue
        rows = groups.get(key, {})
        lines += _heading(group)
        for claim in group.claims:
            judged = claim_verdict(key, claim, known, ablations.get("pairs", 0))
            lines += [f"The paper: {claim.text}. Ours: {judged}", ""]
        lines += _paragraph(group.remark)
        lines += [
            "| run | EPE, px | EPE in range, px | over 1 px | loss in the last epoch | test pairs | pixels | given |",
            "|---|---|---|---|---|---|---|---|",
        ]
        lines += [
            _ablation_line(run.name, run.label, rows.get(run.label))
            for run in EXPERIMENTS
            if run.group == key and (rows.get(run.label) or "seed" not in run.changes)
        ]
        lines += ["", *_seen(rows), *_picture(f"{group.title}: loss", docs / f"{key}_loss.png")]
        lines += _picture(f"{group.title}: test error", docs / f"{key}_epe.png")
        lines += _picture(f"{group.title}: test error within the range", docs / f"{key}_epe_in_range.png")
    return lines


def _heading(group: Group) -> list[str]:
    return [f"## {group.title} ({group.figures})", ""]


def _histogram(docs: Path) -> list[str]:
    lines = ["## Disparities of the data (Fig. 4)", "", "The paper: largest 69.5 px.", ""]
    return [*lines, *_picture("Histogram", docs / "histogram.png")]


def _ablation_line(name: str, label: str, row: dict[str, Any] | None) -> str:
    if row is None:
        return f"| {label} | {NOT_RUN} | | | | | | |"
    within = f"{row['epe_in_range']:.4f}" if row.get("epe_in_range") is not None else ""
    loss = f"{row['last_loss']:.4g}" if row.get("last_loss") is not None else ""
    cells = (
        label,
        f"{row['epe']:.4f}",
        within,
        f"{100 * row['kpe']['1']:.1f} %",
        loss,
        str(row["pairs"]),
        _pixels(row),
    )
    return f"| {' | '.join((*cells, given(name, row)))} |"


def _earlier(record: dict[str, Any]) -> list[str]:
    """Show the ablations of the last report as what they are: another protocol, without verdicts."""
    groups = record.get("groups")
    if not groups:
        return []
    first = next(row for rows in groups.values() for row in rows.values() if row)
    lines = [
        "## The ablations of the last report",
        "",
        f"They saw {crops(first['samples_seen'], first['crop'])} whatever the number of pairs, with strong "
        "augmentation. The refinement saw a ninth of each. Planes ended 8 px before the range: at 56, 48 and 40 px "
        "that alone costs 0.13, 0.64 and 2.1 px. The fourth volume had 900 training pairs, not the test pairs. "
        f"So their verdicts are withdrawn. Commit {record['machine']['commit']}, first {record['pairs']} test pairs.",
        "",
        "| figure | run | EPE, px |",
        "|---|---|---|",
    ]
    for key, rows in groups.items():
        lines += [f"| {GROUPS[key].figures} | {label} | {row['epe']:.4f} |" for label, row in rows.items() if row]
    return [*lines, ""]
