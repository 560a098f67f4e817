"""What a clean teacher is worth to a student that sees spoilt pictures.

    python -m benchmarks.studies.clean_teacher --lap DIR --shapes DIR --gi DIR --held-out DIR DIR DIR \\
        --spoilt DIR --middlebury DIR --runs DIR --json FILE

The teacher is the shipped network. It sees a crop as it was rendered; the student sees it with all looks of the recipe.
Beside the losses of the recipe, the student is asked for the teacher's distribution over the planes of the volume.
Runs with and without the teacher go on from the same weights, for as many steps, from two seeds: what differs by less
than two seeds do is not told apart. ``--spoilt`` is the path-traced set with faults added (``endosdk simulate
--spoil``). A run that is there is not repeated.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.studies.short_runs import Variant, judging_sets, learning_sets, run_variants, said_of, study_parser
from endosdk.datasets.layouts import open_dataset
from endosdk.training import checkpoint
from endosdk.training.augment import placed_pair, spoilt_pair
from endosdk.training.config import TrainConfig
from endosdk.training.data import Crops, as_tensors, has_truth, planar
from endosdk.training.networks.base import Prediction
from endosdk.training.train import Run

SEEDS = (31, 32)


class SpoiltAndClean(Crops):
    """Crops whose items end with both views as they were before any look: (left, right, disparity, left, right)."""

    def __getitem__(self, item: int) -> tuple[Tensor, ...]:
        pair, mirrored, rng = self._drawn(item)
        clean = placed_pair(pair, mirrored, self.crop, rng, self.looks)
        return *as_tensors(spoilt_pair(clean, rng, self.looks)), planar(clean.left), planar(clean.right)


class Student(Run):
    """A training run that a network of the weights it begins with teaches."""

    crops_kind = SpoiltAndClean

    def __init__(self, config: TrainConfig, out: Path, *, resume: bool) -> None:
        super().__init__(config, out, resume=resume)
        self.teacher = checkpoint.load(checkpoint.starting_point(str(config.init_from))).build().eval()
        self.teacher.to(self.device)
        self.taught: Tensor | None = None

    def _train_step(self, model: nn.Module, batch: list[Tensor], refined: bool) -> dict[str, Tensor]:
        *seen, left, right = batch
        with torch.no_grad(), self._autocast():
            self.taught = self.teacher(*(view.to(self.device, torch.float32) for view in (left, right))).cost
        return super()._train_step(model, seen, refined)

    def _add_volume_loss(self, report: dict[str, Tensor], prediction: Prediction, truth: Tensor) -> None:
        super()._add_volume_loss(report, prediction, truth)
        assert prediction.cost is not None and self.taught is not None
        distance = volume_distance(prediction.cost, self.taught, has_truth(truth, self.config.max_disparity))
        report["loss"] = report["loss"] + self.config.volume_weight * distance


def volume_distance(cost: Tensor, taught: Tensor, mask: Tensor) -> Tensor:
    """Return the mean Kullback-Leibler divergence of the student's from the teacher's distributions over the planes.

    Both costs are [N, D, r^2, h, w] as `Prediction.cost`; cells without any pixel of ``mask`` [N, 1, H, W] are left
    out, because looks may have hidden them from the student.
    """
    apart = F.kl_div(
        torch.log_softmax(-cost.float(), dim=1),
        torch.log_softmax(-taught.float(), dim=1),
        reduction="none",
        log_target=True,
    ).sum(dim=1)
    seen = F.max_pool2d(mask.float(), mask.shape[-1] // cost.shape[-1]).expand_as(apart)
    return (apart * seen).sum() / seen.sum().clamp_min(1.0)


def fit(kind: type[Run], config: TrainConfig, out: Path, *, resume: bool) -> None:
    """Take the steps of a run alone: without held-out pairs, no confidence is fitted after them."""
    kind(config, out, resume=resume).fit()


def main() -> None:
    parser = study_parser(__doc__)
    parser.add_argument("--spoilt", type=Path, required=True, help="the path-traced pairs with faults")
    parser.add_argument("--steps", type=int, default=250)
    args = parser.parse_args()
    spoilt = open_dataset(args.spoilt, "test")
    sets = {**judging_sets(args.held_out, args.pairs, args.middlebury), "path-traced, spoilt": (spoilt, len(spoilt))}
    given: dict[str, Any] = {
        "init_from": args.start,
        "held_out": 0,
        "steps": args.steps,
        "rate": 4e-4,
        "data": learning_sets(args),
        "workers": 1,
        "validate_every": args.steps,
    }
    runs = {
        f"{name}, seed {seed}": Variant(f"{name.replace(' ', '-')}-{seed}", {"seed": seed}, partial(fit, kind))
        for seed in SEEDS
        for name, kind in (("alone", Run), ("with a clean teacher", Student))
    }
    run_variants(args, sets, given, runs, f"python -m benchmarks.studies.clean_teacher {said_of(args)}")


if __name__ == "__main__":
    main()
