"""Tables of what the paper found and whether it held here."""

from __future__ import annotations

from typing import Any

from benchmarks.paper.experiments import COMPARED, EXPERIMENTS, GROUPS, LABELS, MEASURES, PAPER_PROTOCOL, crops
from benchmarks.paper.paper_records import PaperRecords, label_of
from benchmarks.paper.verdicts import (
    FIGURE_ORDERS,
    NOT_MEASURED,
    NOT_RUN,
    Verdict,
    claim_verdict,
    error_verdict,
    order_verdict,
    repeats,
    target_verdict,
    time_verdict,
)
from benchmarks.tables.markdown import percent, table
from benchmarks.tables.ranges import facts_of

JUDGED = ("paper-192", "paper-72", "wang2020", "wang2020-adam")  # the runs of wang2020 that are compared
VERDICT = ["verdict", "numbers", "why not decided"]
REPEATED = {**MEASURES, "edges": "test EPE near depth edges, px", "noise": "noise, px"}


def _cells(verdict: Verdict) -> list[str]:
    return [f"**{verdict.word}**", verdict.numbers, verdict.why]


def repeats_table(records: PaperRecords) -> str:
    """By how much the runs of each setting that was repeated differ, and the bound that this gives for each measure."""
    shares = {measure: repeats(records.known, measure) for measure in REPEATED}
    repeated = {name for found in shares.values() for name in found}
    labels = {run.name: LABELS.get(run.name, run.label) for run in EXPERIMENTS if run.name in repeated}
    rows = [
        [label, *(percent(found[name]) if name in found else "" for found in shares.values())]
        for name, label in labels.items()
    ]
    volumes = sorted({run.pairs for run in EXPERIMENTS if run.name in repeated} | {PAPER_PROTOCOL["train_pairs"]})
    last = [
        [
            f"**largest, of settings with {pairs} pairs or more**",
            *(_largest(records, measure, pairs) for measure in REPEATED),
        ]
        for pairs in volumes
    ]
    return table(["setting", *REPEATED.values()], [*rows, *last])


def _largest(records: PaperRecords, measure: str, pairs: int) -> str:
    found = repeats(records.known, measure, pairs).values()
    return f"**{percent(max(found))}**, of {len(found)}" if found else ""


def methods_table(records: PaperRecords) -> str:
    """Each run of wang2020 against each other method that was scored on the same pictures."""
    rows = []
    for run in JUDGED:
        for other in COMPARED:
            if (place := records.beside_each_other(run, other)) is not None:
                pairs, methods = place
                for what, verdict in (
                    ("error, px", error_verdict(run, other, methods, records.bound())),
                    ("time, ms", time_verdict(run, other, methods)),
                ):
                    work = " against ".join(_work(methods[name]) for name in (run, other))
                    rows.append([LABELS[run], LABELS[other], what, *_cells(verdict), work, pairs])
    heads = ["run of wang2020", "other method", "smaller", *VERDICT, "training, TMAC", "test pairs of"]
    return table(heads, rows or [[NOT_RUN, *([""] * (len(heads) - 1))]])


def _work(row: dict[str, Any]) -> str:
    return f"{row['training_tmacs']:.0f}" if "training_tmacs" in row else "none"


def pictures_table(records: PaperRecords) -> str:
    """What the paper's pictures show."""
    verdicts = {
        order.text: order_verdict(order, records.compared, records.bound(order.measure)) for order in FIGURE_ORDERS
    }
    return table(["the paper's pictures", *VERDICT], [[text, *_cells(one)] for text, one in verdicts.items()])


def claims_table(records: PaperRecords) -> str:
    """What the paper's ablations found."""
    rows = []
    for key, group in GROUPS.items():
        runs = {run.label: run.name for run in EXPERIMENTS if run.group == key}
        for claim in group.claims:
            row = records.known.get(runs[claim.run])
            seen = crops(row["samples_seen"], row["crop"]) if row else ""
            verdict = claim_verdict(key, claim, records.known)
            text = claim.text if claim.of_paper else f"our question: {claim.text}"
            rows.append([group.figures, text, MEASURES[claim.measure], *_cells(verdict), seen])
    return table(["figure", "the paper's claim", "measure", *VERDICT, "samples of a run"], rows)


def target_table(records: PaperRecords) -> str:
    """Whether the best recipe of our own for the same network, which is the one that ships, reached its target."""
    record = records.read("accuracy/accuracy")
    rows = []
    if "wang2020" in record.get("methods", {}):
        file = {"version": facts_of("wang2020")["endosdk.version"], "model_sha256": record["models"]["wang2020"]}
        reached = record["methods"]["wang2020"]["all"]["epe_px"]
        rows.append([label_of("shipped-wang2020", file), *_cells(target_verdict(reached))])
    return table(["model", "verdict", "EPE, px", "remark"], rows or [[NOT_MEASURED, "", "", ""]])
