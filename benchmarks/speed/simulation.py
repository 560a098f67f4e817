"""Pairs that a renderer makes in a minute, from the seed to the files, start-up counted.

    python -m benchmarks.speed.simulation --renderer gl --pairs 8 --workers 2 --json FILE

Cycles takes all cores by itself, so it needs one worker.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from benchmarks.record import NO_MODEL, write_part
from endosdk.datasets.layouts import open_dataset
from endosdk.simulation.generate import generate
from endosdk.simulation.recipe import Recipe


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--renderer", required=True, choices=("gl", "cycles"))
    parser.add_argument("--organ", default="gi", help="as for `endosdk simulate` (default gi)")
    parser.add_argument("--pairs", type=int, default=8)
    parser.add_argument("--seed", type=int, default=2020)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--cycles-python", type=Path)
    parser.add_argument("--json", type=Path, required=True, help="results of all renderers; this one's are replaced")
    args = parser.parse_args()
    recipe = Recipe(organ=args.organ, pairs=args.pairs, seed=args.seed, renderer=args.renderer)
    with tempfile.TemporaryDirectory() as folder:
        started = time.perf_counter()
        record = generate(Path(folder) / "set", recipe, args.workers, cycles_python=args.cycles_python)
        seconds = time.perf_counter() - started
        organs = [sample.info["organ"] for sample in open_dataset(Path(folder) / "set", "train")]
    result = {
        "version": record["renderers"],
        "size": [recipe.camera.width, recipe.camera.height],
        "organs": organs,
        "pairs": args.pairs,
        "workers": args.workers,
        "seconds": seconds,
        "pairs_per_minute": 60.0 * args.pairs / seconds,
    }
    command = f"python -m benchmarks.speed.simulation --renderer {args.renderer} --organ {args.organ} "
    command += f"--pairs {args.pairs} --seed {args.seed} --workers {args.workers}"
    write_part(args.json, args.renderer, result, command=command, hashes=NO_MODEL)
    print(f"{args.renderer}: {result['pairs_per_minute']:.2f} pairs a minute")


if __name__ == "__main__":
    main()
