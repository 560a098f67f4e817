"""What each part of the training recipe is worth: the same short run with one part left out.

    python -m benchmarks.studies.recipe_gains --lap DIR --shapes DIR --gi DIR --held-out DIR DIR DIR \\
        --middlebury DIR --runs DIR --json FILE

Every run goes on from the shipped weights, for as many steps, from the same seed. It is judged on pairs of other seeds,
on path-traced pairs and on Middlebury's real truth. One run is the whole recipe from another seed: what differs by less
than these two do is not told apart. A run that is there is not repeated.
"""

from __future__ import annotations

from typing import Any

from benchmarks.studies.short_runs import Variant, judging_sets, learning_sets, run_variants, said_of, study_parser
from endosdk.training import checkpoint

LIGHT = ("tone", "colours", "blur", "noise", "glare", "haze", "compression")


def variants(looks: tuple[str, ...], without_objects: tuple[str, ...], seed: int) -> dict[str, dict[str, Any]]:
    """Return what each run changes of the recipe, which has these looks."""
    return {
        "whole recipe": {},
        "whole recipe, another seed": {"seed": seed + 1},
        "without looks of light and lens": {"looks": tuple(look for look in looks if look not in LIGHT)},
        "without rows that differ": {"looks": tuple(look for look in looks if look != "rows")},
        "without cross-entropy of the volume": {"volume_weight": 0.0},
        "without scenes of mere objects": {"data": without_objects},
        "with a full soft-argmin": {"mode_reach": None},
    }


def main() -> None:
    parser = study_parser(__doc__)
    parser.add_argument("--steps", type=int, default=800)
    parser.add_argument("--seed", type=int, default=31)
    parser.add_argument("--only", nargs="*", default=[], metavar="RUN", help="runs of these names (default: all)")
    args = parser.parse_args()
    sets = judging_sets(args.held_out, args.pairs, args.middlebury)
    given: dict[str, Any] = {"init_from": args.start, "held_out": 0, "steps": args.steps, "threads": 1}
    given |= {"data": learning_sets(args), "rate": 4e-4, "seed": args.seed, "validate_every": args.steps}
    looks = checkpoint.inherited(args.start, given)["looks"]
    changed = variants(looks, (args.gi, args.lap), args.seed)
    if unknown := set(args.only) - set(changed):
        parser.error(f"--only: no runs of these names: {', '.join(sorted(unknown))}")
    runs = {
        name: Variant(name.replace(",", "").replace(" ", "-"), changes)
        for name, changes in changed.items()
        if name in (args.only or changed)
    }
    run_variants(args, sets, given, runs, f"python -m benchmarks.studies.recipe_gains {said_of(args)}")


if __name__ == "__main__":
    main()
