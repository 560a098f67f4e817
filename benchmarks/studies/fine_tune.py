"""Does a short fine-tuning on a few pairs of a model's own kind leave it as good as it was?

    endosdk simulate --out DIR --organ gi --pairs 32 --seed 7271 \\
        --width 480 --height 360 --focal 200 --max-disparity 34.75
    OMP_NUM_THREADS=1 python -m benchmarks.studies.fine_tune --data DIR --runs DIR --json FILE

The weights are fine-tuned as `endosdk train --init-from NAME` does it: by the recipe that made them. Half of the pairs
are held out; the error on these counts, before and after, for every seed. ``--defaults`` does the same with the
settings of a run from nothing, which the command took before it took over recipes.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import torch

from benchmarks.record import write_record
from benchmarks.weights import weights_sha256
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.sets import open_sets, split_pairs
from endosdk.training.train import train
from endosdk.training.validation import mean_errors

MEASURES = ("epe_coarse", "epe_refined", "over_1px")


def settings(args: argparse.Namespace, seed: int, *, defaults: bool) -> TrainConfig:
    """Return the settings of one run."""
    given: dict[str, Any] = {"data": (str(args.data),), "init_from": args.start, "held_out": args.held_out}
    given |= {"steps": args.steps, "seed": seed, "validate_every": args.steps, "threads": torch.get_num_threads()}
    if defaults:
        past = checkpoint.load(checkpoint.starting_point(args.start)).config
        return TrainConfig(**given, network=past.network, max_disparity=past.max_disparity)
    return TrainConfig.from_dict({**checkpoint.inherited(args.start, given), **given})


def tuned(config: TrainConfig, out: Path) -> dict[str, float]:
    """Return the errors on the held-out pairs at the end of a run, which goes on where it was stopped."""
    train(config, out, resume=(out / checkpoint.LAST).exists())  # one of other settings or data is refused
    (last,) = (entry for entry in checkpoint.load(out).state["history"] if entry["step"] == config.steps)
    return {name: last[name] for name in MEASURES}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set")
    parser.add_argument("--runs", type=Path, required=True, help="folder for the runs")
    parser.add_argument("--start", default="fast", help="shipped weights, run folder or checkpoint")
    parser.add_argument("--held-out", type=int, default=16)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--defaults", type=int, nargs="*", default=[], metavar="SEED", help="seeds of the other way")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    first = settings(args, args.seeds[0], defaults=False)
    reader = open_sets(first.data, "train", first.layout)
    learned, held_out = split_pairs(reader, first)
    before = mean_errors(checkpoint.load(checkpoint.starting_point(args.start)).build(), reader, held_out, refined=True)
    print(f"before      {before['epe_refined']:.4f} px")
    after: dict[str, dict[str, Any]] = {"recipe": {}, "defaults": {}}
    for way, seeds in (("recipe", args.seeds), ("defaults", args.defaults)):
        for seed in seeds:
            config = settings(args, seed, defaults=way == "defaults")
            found = tuned(config, args.runs / f"{way}-{seed}")
            after[way][str(seed)] = {**found, "change": found["epe_refined"] / before["epe_refined"] - 1}
            print(f"{way:8} {seed:2}  {found['epe_refined']:.4f} px, {100 * after[way][str(seed)]['change']:+.1f} %")
    seeds = " ".join(map(str, args.seeds))
    record = {
        "dataset": {"name": reader.name, "sha256": reader.sha256, "pairs": len(learned), "held_out": len(held_out)},
        "recipe": {name: value for name, value in first.as_dict().items() if name not in ("data", "init_from", "seed")},
        "before": before,
        "after": after,
    }
    command = f"python -m benchmarks.studies.fine_tune --data {reader.name} --runs DIR "
    command += f"--start {Path(args.start).name} --held-out {args.held_out} --steps {args.steps} --seeds {seeds}"
    command += f" --defaults {' '.join(map(str, args.defaults))}" if args.defaults else ""
    write_record(args.json, record, command=command, hashes={"start_sha256": weights_sha256(args.start)})


if __name__ == "__main__":
    main()
