"""Redo the paper's experiments: one resumable command.

    python -m benchmarks.paper all --data DIR --minutes 600
    python -m benchmarks.paper plan --data DIR
    python -m benchmarks.paper search --data DIR --pairs 20
    python -m benchmarks.paper train --data DIR --minutes 60
    python -m benchmarks.paper evaluate --data DIR
    python -m benchmarks.paper time --data DIR
    python -m benchmarks.paper figures --data DIR
    python -m benchmarks.paper report

``all`` does the others one after the other: called again, it takes the runs further and writes the tables anew.
Runs lie under --runs, by budget, and go on where they stopped. Scores are kept beside them; records go to --results,
figures to --docs. ``report`` writes the tables of report.md there.
The methods on another set: evaluate --test-data DIR --table table1_NAME. Runs of another rendering of the set:
evaluate --data DIR --table table1_NAME; their ablations go to ablations_NAME. PatchMatch, which takes hours, is
scored and timed only when it is named: --only patchmatch.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from benchmarks.paper.experiments import BUDGETS, LABELS, SEEDS, Experiment, ablations_of, unique_runs

OVERRIDES = ("steps", "epochs", "batch", "train_pairs", "max_disparity", "device", "workers", "precision")
SEARCH_PAIRS = 20


def main(words: list[str] | None = None) -> int:
    """Run one sub-command."""
    args = _parser().parse_args(words)
    try:
        COMMANDS[args.command](args)
    except KeyboardInterrupt:
        print("stopped; the same command goes on from here", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper", description=__doc__.splitlines()[0])
    parser.add_argument("command", choices=sorted(COMMANDS))
    parser.add_argument("--data", type=Path, help="data set with training pairs and the test split")
    parser.add_argument("--test-data", type=Path, help="data set whose test split is scored (default: --data)")
    parser.add_argument("--layout", default="endosdk", help="layout of both (default: %(default)s)")
    parser.add_argument("--runs", type=Path, default=Path("runs/paper"), help="training runs (default: %(default)s)")
    parser.add_argument("--budget", choices=sorted(BUDGETS), help="how much every run sees (default: by the device)")
    parser.add_argument("--table", default="table1", help="name of the table's file (default: %(default)s)")
    parser.add_argument("--results", type=Path, default=Path("benchmarks/results"), help="tables as JSON")
    parser.add_argument("--docs", type=Path, default=Path("docs/paper"), help="the page report.md, and figures")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these runs or methods alone")
    parser.add_argument("--pairs", type=int, help="score or search on the first so many pairs")
    parser.add_argument("--minutes", type=float, help="stop training after so long, with a checkpoint")
    parser.add_argument("--crop", type=int, nargs=2, metavar=("H", "W"), help="crops of every run, px")
    for name in OVERRIDES:
        kind = str if name in ("device", "precision") else int
        parser.add_argument("--" + name.replace("_", "-"), type=kind, help="of every run alike, for shorter trials")
    return parser


def _overrides(args: argparse.Namespace) -> dict[str, Any]:
    given = {name: getattr(args, name) for name in OVERRIDES if getattr(args, name) is not None}
    return {**given, **({"crop": tuple(args.crop)} if args.crop else {})}


def _chosen(args: argparse.Namespace) -> list[Experiment]:
    return [run for run in unique_runs() if not args.only or run.name in args.only]


def _device(args: argparse.Namespace) -> str:
    import torch

    return args.device or ("cuda" if torch.cuda.is_available() else "cpu")


def _budget(args: argparse.Namespace) -> str:
    return args.budget or ("cpu" if _device(args) == "cpu" else "gpu")


def _print_plan(args: argparse.Namespace) -> None:
    from benchmarks.paper.runs import plan
    from benchmarks.paper.speed import speeds

    runs, budget, overrides = _chosen(args), _budget(args), _overrides(args)
    found = speeds(runs, args.runs / "speed.json", _device(args), budget, overrides)
    lines = plan(runs, args.runs, budget, overrides, found)
    print(f"budget {budget}; 1e9 MACs a second of training, from one timed step of each network on one pair:")
    print(", ".join(f"{network} {speed:.1f}" for network, speed in found.items()))
    print(f"{'run':18} {'GMAC/step':>10} {'steps left':>10} {'hours':>8}")
    for line in lines:
        print(f"{line['run']:18} {line['gmacs_per_step']:10.1f} {line['steps_left']:10} {line['hours']:8.2f}")
    steps, hours = (sum(line[key] for line in lines) for key in ("steps_left", "hours"))
    print(f"{'all':18} {'':10} {steps:10} {hours:8.2f}")


def _train(args: argparse.Namespace) -> None:
    """Take every run further; when the minutes are over, end as if all had been done."""
    from benchmarks.paper.runs import limited_to

    _print_plan(args)
    begun = time.monotonic()
    try:
        with limited_to(args.minutes):
            for experiment in _chosen(args):
                _take_further(experiment, args)
    except KeyboardInterrupt:
        if not args.minutes or time.monotonic() - begun < 60 * args.minutes:
            raise
        print(f"{args.minutes:g} minutes are over; the same command goes on from here", file=sys.stderr)


def _take_further(experiment: Experiment, args: argparse.Namespace) -> None:
    from benchmarks.paper.runs import advance, config_of, test_errors, training_set
    from endosdk.datasets.layouts import open_dataset

    budget, overrides = _budget(args), _overrides(args)
    test = open_dataset(args.test_data or args.data, "test", layout=args.layout)
    settings = experiment.settings(budget, overrides)
    there = len(open_dataset(args.data, "train", layout=args.layout)) + (len(test) if experiment.with_test else 0)
    if settings["train_pairs"] > there:
        print(f"{experiment.name}: needs {settings['train_pairs']} pairs, there are {there}", file=sys.stderr)
        return
    data = training_set(experiment, args.data, args.layout, settings["train_pairs"], args.runs)
    config = config_of(experiment, data, args.layout, budget, overrides)
    # Runs that go by epochs are measured on the test pairs after each: those are the curves.
    watch = test_errors(test, args.pairs or BUDGETS[budget].ablation_pairs) if "epochs" in settings else None
    advance(experiment, config, args.runs / budget / experiment.name, watch)


def _all(args: argparse.Namespace) -> None:
    if not (args.results / "paper/sgbm_search.json").exists():
        _search(args)
    for step in (_train, _evaluate, _time, _figures, _report):
        step(args)


def _search(args: argparse.Namespace) -> None:
    from benchmarks.methods.classical import search_sgbm
    from benchmarks.record import NO_MODEL, write_record
    from endosdk.datasets.layouts import open_dataset

    reader = open_dataset(args.data, "train", layout=args.layout)
    count = min(args.pairs or SEARCH_PAIRS, len(reader))
    samples = [reader[i * len(reader) // count] for i in range(count)]
    record = {
        "data": {"name": reader.name, "sha256": reader.sha256, "split": "train"},
        "pairs": [sample.id for sample in samples],
        "forms": {name: search_sgbm(samples, eight_paths=name == "sgbm-hh") for name in ("sgbm", "sgbm-hh")},
    }
    command = f"python -m benchmarks.paper search --data DIR --pairs {count}"
    write_record(args.results / "paper/sgbm_search.json", record, command=command, hashes=NO_MODEL)


def _evaluate(args: argparse.Namespace) -> None:
    from benchmarks.paper import tables
    from benchmarks.paper.runs import state_of
    from endosdk.datasets.layouts import open_dataset

    reader = open_dataset(args.test_data or args.data, "test", layout=args.layout)
    budget, wanted = _budget(args), set(args.only or LABELS)
    scores = tables.Scores(args.runs / "scores.json", reader, args.pairs)
    # As many training pairs tell what a run makes of what it has learned from.
    train = open_dataset(args.data, "train", layout=args.layout) if args.data else None
    first = scores.on_first(BUDGETS[budget].ablation_pairs)
    learned, fewer = (
        tables.Scores(args.runs / "scores.json", train, some.pairs) if train else None for some in (scores, first)
    )
    size = reader[0].left.shape[1::-1]
    table, ablations = (
        args.results / f"paper/{args.table}.json",
        args.results / f"paper/{ablations_of(args.table)}.json",
    )
    states = [state_of(run, args.runs, budget, _overrides(args)) for run in _chosen(args)]
    done = {state.name: state for state in states if state is not None}
    rowed = LABELS.keys() | SEEDS.keys()
    # The ablations are scored on the test pairs of the set that they learned from.
    ablated = set() if args.test_data else done.keys() - rowed
    if wanted & rowed:
        tables.check_same_pairs(table, scores)
    if ablated:
        tables.check_same_pairs(ablations, first)
    rows = {name: tables.trained_row(scores, done[name], size, learned) for name in done.keys() & rowed}
    if wanted & {"sgbm", "sgbm-hh", "bm"}:
        rows.update(tables.classical_rows(scores, _best_sgbm(args.results)))
    if wanted & {"shipped-wang2020", "shipped-fast"}:
        rows.update(tables.shipped_rows(scores, size, wanted, learned))
    if args.only and "patchmatch" in args.only:  # hours: only when it is named
        rows.update(tables.patchmatch_rows(scores, args.runs))
    if rows:
        tables.write_table(table, scores, rows)
    if ablated:
        found = {name: tables.trained_row(first, done[name], size, fewer) for name in ablated}
        tables.write_ablations(ablations, first, found)


def _best_sgbm(results: Path) -> dict[str, dict[str, Any]]:
    """Return the best settings of each form that was searched."""
    file = results / "paper/sgbm_search.json"
    forms = json.loads(file.read_text())["forms"] if file.exists() else {}
    return {name: dict(found["best"]) for name, found in forms.items()}


def _time(args: argparse.Namespace) -> None:
    from benchmarks.paper import tables
    from endosdk.datasets.layouts import open_dataset

    reader = open_dataset(args.test_data or args.data, "test", layout=args.layout)
    tables.retime_table(args.results / f"paper/{args.table}.json", reader, args.runs, args.only)


def _figures(args: argparse.Namespace) -> None:
    from benchmarks.paper.figures import draw_all

    for file in draw_all(args):
        print(f"written {file}")


def _report(args: argparse.Namespace) -> None:
    from benchmarks.paper.page_tables import page_tables
    from benchmarks.tables.pages import filled
    from endosdk.errors import InvalidArgument

    page = args.docs / "report.md"
    if not page.is_file():
        raise InvalidArgument("docs", "must be a folder with the page report.md", str(args.docs))
    page.write_text(filled(page.read_text(), page_tables(args.results, args.docs)))
    print(f"tables written in {page}")


COMMANDS = {
    "all": _all,
    "plan": _print_plan,
    "search": _search,
    "train": _train,
    "evaluate": _evaluate,
    "time": _time,
    "figures": _figures,
    "report": _report,
}

if __name__ == "__main__":
    sys.exit(main())
