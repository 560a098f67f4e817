"""Tables of what the paper found and whether it held here."""

from __future__ import annotations

from benchmarks.paper.experiments import COMPARED, EXPERIMENTS, GROUPS, LABELS, MEASURES, crops
from benchmarks.paper.paper_records import PaperRecords
from benchmarks.paper.verdicts import (
    ENOUGH_SETTINGS,
    FIGURE_ORDERS,
    NOT_MEASURED,
    NOT_RUN,
    Verdict,
    claim_verdict,
    error_verdict,
    order_verdict,
    repeat_bound,
    target_verdict,
    time_verdict,
)
from benchmarks.tables.markdown import percent, table

JUDGED = ("paper-192", "paper-72", "wang2020", "wang2020-adam")  # the runs of wang2020 that are compared
VERDICT = ["verdict", "numbers", "why not decided"]


def _cells(verdict: Verdict) -> list[str]:
    return [f"**{verdict.word}**", verdict.numbers, verdict.why]


def repeats_table(records: PaperRecords) -> str:
    """By how much two runs of one setting differ, and whether that is known well enough to decide by."""
    rows = []
    for measure, said in MEASURES.items():
        bound = repeat_bound(records.known, measure)
        share = percent(bound.share) if bound.settings else ""
        rows.append([said, str(bound.settings), str(ENOUGH_SETTINGS), share])
    return table(["measure", "settings repeated", "needed", "largest difference"], rows)


def methods_table(records: PaperRecords) -> str:
    """Each run of wang2020 against each other method that was scored on the same pictures."""
    rows = []
    for run in JUDGED:
        for other in COMPARED:
            if (place := records.beside_each_other(run, other)) is not None:
                pairs, methods = place
                for what, verdict in (
                    ("error, px", error_verdict(run, other, methods, records.bound)),
                    ("time, ms", time_verdict(run, other, methods)),
                ):
                    rows.append([LABELS[run], LABELS[other], what, *_cells(verdict), pairs])
    heads = ["run of wang2020", "other method", "smaller", *VERDICT, "test pairs of"]
    return table(heads, rows or [[NOT_RUN, *([""] * (len(heads) - 1))]])


def pictures_table(records: PaperRecords) -> str:
    """What the paper's pictures show."""
    rows = records.compared
    return table(
        ["the paper's pictures", *VERDICT],
        [[order.text, *_cells(order_verdict(order, rows, records.bound))] for order in FIGURE_ORDERS],
    )


def claims_table(records: PaperRecords) -> str:
    """What the paper's ablations found."""
    rows = []
    for key, group in GROUPS.items():
        runs = {run.label: run.name for run in EXPERIMENTS if run.group == key}
        for claim in group.claims:
            row = records.known.get(runs[claim.run])
            seen = crops(row["samples_seen"], row["crop"]) if row else ""
            verdict = claim_verdict(key, claim, records.known)
            rows.append([group.figures, claim.text, MEASURES[claim.measure], *_cells(verdict), seen])
    return table(["figure", "the paper's claim", "measure", *VERDICT, "samples of a run"], rows)


def target_table(records: PaperRecords) -> str:
    """Whether the best recipe of our own for the same network reached its target."""
    versions = records.read("studies/wang2020_versions").get("versions", {})
    rows = [
        [version, *_cells(target_verdict(found["endosim-gi"]["epe_px"], records.bound))]
        for version, found in list(versions.items())[-1:]
    ]
    return table(["version", "verdict", "EPE, px", "remark"], rows or [[NOT_MEASURED, "", "", ""]])
