"""Two installed versions of endosdk on the same pairs: the largest difference of their maps, model by model.

    python -m benchmarks.accuracy.same_maps --before PYTHON --after PYTHON --commits COMMIT COMMIT --data DIR \\
        --models fast fast-320 ... --json FILE

Each PYTHON is the interpreter of an environment with one version. A model is a name that both ship, or a file for both.
Exits with an error where the disparities of any pair differ by more than 1e-4 px.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.record import write_record
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.io.progress import progress

PAIRS = 20
TOLERANCE_PX = 1e-4

# What one version runs: names that have not changed since 0.1.0. It leaves disparity and confidence of every pair, and
# says which model file it took.
WORKER = """
import sys
from pathlib import Path
import numpy as np
import endosdk
model, folder, label = sys.argv[1:]
estimator = endosdk.DepthEstimator(model, threads=2)
for pair in sorted(Path(folder).glob("pair_*.npy")):
    result = estimator.predict(*np.load(pair))
    np.save(pair.with_name(f"{label}_{pair.name}"), np.stack([result.disparity, result.confidence]))
print(estimator.model.sha256)
"""


def compare(model: str, interpreters: dict[str, Path], folder: Path) -> dict[str, Any]:
    """Return the largest difference between the maps of both versions over all pairs, in px and in probability."""
    hashes = {}
    for label, python in interpreters.items():
        command = [python, "-c", WORKER, model, folder, label]
        said = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True, cwd=folder).stdout
        hashes[label] = said.strip()
    largest = {"disparity_px": 0.0, "confidence": 0.0}
    for pair in sorted(folder.glob("pair_*.npy")):
        before, after = (np.load(folder / f"{label}_{pair.name}") for label in interpreters)
        if before.shape != after.shape or (np.isnan(before) != np.isnan(after)).any():
            raise SystemExit(
                f"{model}: the two versions differ in size, or in where they have no number, on {pair.name}"
            )
        for name, apart in zip(largest, np.abs(before - after), strict=True):
            largest[name] = max(largest[name], float(np.nanmax(apart)))
    return {"model": Path(model).name, "sha256": hashes, **largest}


def write_pairs(samples: list[Sample], folder: Path) -> None:
    """Write the views of every pair to a file of their own."""
    for number, sample in enumerate(samples):
        np.save(folder / f"pair_{number:03}.npy", np.stack([sample.left, sample.right]))


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", type=Path, required=True, metavar="PYTHON")
    parser.add_argument("--after", type=Path, required=True, metavar="PYTHON")
    parser.add_argument("--commits", nargs=2, required=True, metavar="COMMIT", help="of both versions")
    parser.add_argument("--data", type=Path, required=True, metavar="DIR")
    parser.add_argument("--models", nargs="+", required=True, metavar="MODEL")
    parser.add_argument("--json", type=Path, required=True, metavar="FILE")
    args = parser.parse_args()
    reader = open_dataset(args.data, "test")
    files = [str(Path(model).resolve()) if Path(model).is_file() else model for model in args.models]
    interpreters = {"before": args.before.absolute(), "after": args.after.absolute()}
    with tempfile.TemporaryDirectory() as name:
        write_pairs([reader[number] for number in range(PAIRS)], Path(name))
        models = [compare(model, interpreters, Path(name)) for model in progress(files, unit="model")]
    hashes = {
        key: {found["model"]: found["sha256"][label] for found in models}
        for key, label in (("before_sha256", "before"), ("model_sha256", "after"))
    }
    record = {
        "commits": dict(zip(("before", "after"), args.commits, strict=True)),
        "data": {"name": reader.name, "sha256": reader.sha256, "pairs": PAIRS},
        "models": models,
    }
    command = "python -m benchmarks.accuracy.same_maps --before PYTHON --after PYTHON --commits "
    command += f"{' '.join(args.commits)} --data {args.data} --models {' '.join(args.models)} --json FILE"
    write_record(args.json, record, command=command, hashes=hashes)
    print(json.dumps(models, indent=1))
    if any(model["disparity_px"] > TOLERANCE_PX for model in models):
        raise SystemExit(f"the versions differ by more than {TOLERANCE_PX} px")


if __name__ == "__main__":
    main()
