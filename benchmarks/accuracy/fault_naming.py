"""How often a fault's cause is named, and how often a frame without a fault is not OK, over the test splits.

    python -m benchmarks.accuracy.fault_naming --data DIR ... --spoilt DIR [--further DIR ...] --json FILE

Every fault of `trust_cases` is put into every pair. Pairs of ``--data`` are clean; those of ``--spoilt`` come out of
their set spoilt, so that what is said of them without a fault stands apart. Those of ``--further`` are clean, too. No
limit was set by them. All of them tell how often a cause is raised for nothing, and some of them get the faults.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.accuracy.trust_cases import FAULTS, USABLE, Case, next_scene
from benchmarks.model_records import evenly
from benchmarks.model_run import model_run
from benchmarks.record import write_record
from endosdk import DepthEstimator, DepthResult, StereoCalibration
from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.io.progress import progress

CLEAN = next(case for case in USABLE if case.name == "clean")


class Tally:
    """What was said of the frames of one case in one set."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.frames = self.named = 0
        self.status: Counter[str] = Counter()
        self.causes: Counter[str] = Counter()

    def add(self, answer: DepthResult) -> None:
        """Count one frame."""
        self.frames += 1
        self.named += self.case.named_by(answer)
        self.status[answer.status.name] += 1
        self.causes.update(cause.name for cause in answer.causes)

    def result(self) -> dict[str, Any]:
        """Return the counts."""
        named = {"named": self.named} if self.case.causes else {}
        return {"frames": self.frames, **named, "status": dict(self.status), "causes": dict(self.causes)}


def answers(model: str, pairs: Iterable[tuple[Sample, Sample | None]], case: Case) -> Iterator[DepthResult]:
    """Answer every pair, which comes with one of another scene; an estimator sees one case and one rig alone."""
    rig = None
    with ExitStack() as opened:
        for sample, another in pairs:
            if rig_of(sample) != rig:
                opened.close()
                rig = rig_of(sample)
                estimator = opened.enter_context(DepthEstimator(model, calibration=rig, threads=2))
            pair = case.pair(sample, another)
            yield estimator.predict(pair.left, pair.right)


def rig_of(sample: Sample) -> StereoCalibration:
    size = sample.left.shape[1::-1]
    return StereoCalibration.rectified(sample.focal_px, sample.baseline_mm, size, doffs=sample.doffs)


def measure(model: str, reader: DatasetReader, cases: tuple[Case, ...], pairs: int) -> dict[str, dict[str, Any]]:
    """Count what is said of every case in at most so many pairs of a set, evenly from all of it."""
    numbers = evenly(pairs, len(reader))
    samples = [reader[number] for number in numbers]
    others = next_scene([reader.film(number) for number in numbers])
    joined = [(one, None if other is None else samples[other]) for one, other in zip(samples, others, strict=True)]
    return {case.name: _counted(model, joined, case) for case in progress(cases, total=len(cases))}


def without_fault(model: str, reader: DatasetReader) -> dict[str, Any]:
    """Count what is said of every pair of a set as it is."""
    samples = ((reader[number], None) for number in progress(range(len(reader))))
    return {"sha256": reader.sha256, "split": reader.split, **_counted(model, samples, CLEAN)}


def _counted(model: str, pairs: Iterable[tuple[Sample, Sample | None]], case: Case) -> dict[str, Any]:
    tally = Tally(case)
    for answer in answers(model, pairs, case):
        tally.add(answer)
    return tally.result()


def summary(found: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return a fault's counts over all sets."""
    counts: dict[str, Any] = {key: sum(one[key] for one in found.values()) for key in ("frames", "named")}
    for key in ("status", "causes"):
        counts[key] = dict(sum((Counter(one[key]) for one in found.values()), Counter()))
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="sets of clean pairs")
    parser.add_argument("--spoilt", type=Path, nargs="*", default=[], help="sets of pairs that are spoilt")
    parser.add_argument("--further", type=Path, nargs="*", default=[], help="clean sets that set no limit")
    parser.add_argument("--split", default="test")
    parser.add_argument("--pairs", type=int, default=100, help="at most so many of each set")
    parser.add_argument("--further-pairs", type=int, default=60, help="so many of each further set get the faults")
    parser.add_argument("--model", default="fast")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    sets = {"clean": args.data, "spoilt": args.spoilt, "further": args.further}
    readers = {kind: [open_dataset(folder, args.split) for folder in folders] for kind, folders in sets.items()}
    command = "python -m benchmarks.accuracy.fault_naming"
    for option, kind in (("data", "clean"), ("spoilt", "spoilt"), ("further", "further")):
        command += f" --{option} {' '.join(reader.name for reader in readers[kind])}" if readers[kind] else ""
    command += f" --split {args.split} --pairs {args.pairs} --further-pairs {args.further_pairs} --model {args.model}"
    usual = readers["clean"] + readers["spoilt"]
    found = {reader.name: measure(args.model, reader, (CLEAN, *FAULTS), args.pairs) for reader in usual}
    plain = {name: cases.pop(CLEAN.name) for name, cases in found.items()}
    found |= {one.name: measure(args.model, one, FAULTS, args.further_pairs) for one in readers["further"]}
    by_fault = {case.name: {name: cases[case.name] for name, cases in found.items()} for case in FAULTS}
    record = {
        "datasets": {
            reader.name: {"split": args.split, "sha256": reader.sha256, "pairs": kind}
            for kind, some in readers.items()
            for reader in some
        },
        "model": args.model,
        "without_fault": plain,
        "further": {reader.name: without_fault(args.model, reader) for reader in readers["further"]},
        "faults": {fault: {**summary(of_set), "sets": of_set} for fault, of_set in by_fault.items()},
    }
    write_record(args.json, record, command=command, hashes={"model_sha256": model_run(args.model).sha256})
    print(json.dumps({key: record[key] for key in ("without_fault", "faults")}, indent=1))


if __name__ == "__main__":
    main()
