"""How often a fault's cause is named, and how often a frame without a fault is not OK, over the test splits.

    python -m benchmarks.accuracy.fault_naming --data DIR ... --spoilt DIR [--further DIR ...] --json FILE

Every fault of `trust_cases` is put into every pair. Pairs of ``--data`` are clean; those of ``--spoilt`` come out of
their set spoilt, so that what is said of them without a fault stands apart. Those of ``--further`` are clean, too, and
get no fault: no limit was set by them, so they tell how often a cause is raised for nothing.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from benchmarks.accuracy.trust_cases import FAULTS, USABLE, Case
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


def answers(model: str, samples: Iterable[Sample], case: Case) -> Iterator[DepthResult]:
    """Answer every pair; an estimator sees pairs of one case and one rig alone."""
    rig = None
    with ExitStack() as opened:
        for sample in samples:
            if rig_of(sample) != rig:
                opened.close()
                rig = rig_of(sample)
                estimator = opened.enter_context(DepthEstimator(model, calibration=rig, threads=1))
            pair = case.pair(sample)
            yield estimator.predict(pair.left, pair.right)


def rig_of(sample: Sample) -> StereoCalibration:
    size = sample.left.shape[1::-1]
    return StereoCalibration.rectified(sample.focal_px, sample.baseline_mm, size, doffs=sample.doffs)


def measure(model: str, readers: list[DatasetReader], cases: tuple[Case, ...], pairs: int) -> dict[str, dict[str, Any]]:
    """Count what is said of every case in every set, of at most so many pairs each."""
    found: dict[str, dict[str, Any]] = {case.name: {} for case in cases}
    for reader in readers:
        samples = [reader[number] for number in range(min(pairs, len(reader)))]
        for case in progress(cases, total=len(cases)):
            tally = Tally(case)
            for answer in answers(model, samples, case):
                tally.add(answer)
            found[case.name][reader.name] = tally.result()
    return found


def without_fault(model: str, reader: DatasetReader) -> dict[str, Any]:
    """Count what is said of every pair of a set as it is."""
    tally = Tally(CLEAN)
    for answer in answers(model, (reader[number] for number in progress(range(len(reader)))), CLEAN):
        tally.add(answer)
    return {"sha256": reader.sha256, "split": reader.split, **tally.result()}


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
    parser.add_argument("--further", type=Path, nargs="*", default=[], help="sets of clean pairs that get no fault")
    parser.add_argument("--split", default="test")
    parser.add_argument("--pairs", type=int, default=100, help="at most so many of each set")
    parser.add_argument("--model", default="fast")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    clean, spoilt = ([open_dataset(folder, args.split) for folder in folders] for folders in (args.data, args.spoilt))
    readers = clean + spoilt
    found = measure(args.model, readers, (CLEAN, *FAULTS), args.pairs)
    kinds = {reader.name: "clean" if reader in clean else "spoilt" for reader in readers}
    command = f"python -m benchmarks.accuracy.fault_naming --data {' '.join(reader.name for reader in clean)} "
    command += f"--spoilt {' '.join(reader.name for reader in spoilt)} "
    further = [open_dataset(folder, args.split) for folder in args.further]
    command += f"--further {' '.join(reader.name for reader in further)} " if further else ""
    command += f"--split {args.split} "
    command += f"--pairs {args.pairs} --model {args.model}"
    record = {
        "datasets": {
            reader.name: {"split": args.split, "sha256": reader.sha256, "pairs": kinds[reader.name]}
            for reader in readers
        },
        "model": args.model,
        "without_fault": found[CLEAN.name],
        "further": {reader.name: without_fault(args.model, reader) for reader in further},
        "faults": {case.name: {**summary(found[case.name]), "sets": found[case.name]} for case in FAULTS},
    }
    write_record(args.json, record, command=command, hashes={"model_sha256": model_run(args.model).sha256})
    print(json.dumps({key: record[key] for key in ("without_fault", "faults")}, indent=1))


if __name__ == "__main__":
    main()
