"""Settings of a training run; an experiment is the handful of fields that differ from these defaults."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

from endosdk import _core
from endosdk.errors import InvalidArgument
from endosdk.training.looks import LOOKS

# No torch here: the command line shows these settings where it is missing.
CHOICES = {
    "loss": ("l1", "l2", "scale-invariant", "smooth-l1"),
    "optimiser": ("rmsprop", "adamw", "muon"),
    "decay": ("exponential", "linear", "epochs", "drop"),
    "precision": ("auto", "fp32", "bf16"),
    "device": ("auto", "cpu", "cuda"),
}
# What a run takes over from the run that made the weights it starts from, where nothing else is asked for.
INHERITED = (
    "network max_disparity dense_disparity mode_reach inference_width crop looks loss balance volume_weight "
    "coarse_weight output_stride optimiser decay epochs weight_decay frozen_norm"
).split()
# What a resumed run may change: how long and how fast it learns, where its data lies, and how it is computed.
RESUMED = (
    "data steps rate final_rate workers cache_gib precision device threads log_every validate_every checkpoint_minutes"
).split()
LISTS = ("data", "looks", "crop", "refine_crop")
LARGEST = 10**9
DROP_AFTER = 2 / 3  # share of the steps: AnyNet's authors drop the rate after 200 of 300 epochs
# What each number must lie within, ends included.
RANGES = {
    "max_disparity": (1, LARGEST),
    "inference_width": (64, LARGEST),
    "train_pairs": (1, LARGEST),
    "held_out": (0, LARGEST),
    "batch": (1, LARGEST),
    "workers": (0, LARGEST),
    "cache_gib": (0, LARGEST),
    "seed": (0, LARGEST),
    "dense_disparity": (8, LARGEST),
    "mode_reach": (1, LARGEST),
    "volume_weight": (0, LARGEST),
    "balance": (0, 1),  # beyond 1 the loss rewards a common factor, and falls below 0
    "coarse_weight": (0, LARGEST),
    "steps": (0, LARGEST),  # with none the confidence is fitted, and nothing else changes
    "epochs": (1, LARGEST),
    "warmup": (0, LARGEST),
    "weight_decay": (0, LARGEST),
    "clip": (0, LARGEST),
    "refine_from_step": (0, LARGEST),
    "output_stride": (1, 8),
    "log_every": (1, LARGEST),
    "validate_every": (1, LARGEST),
    "checkpoint_minutes": (0, LARGEST),
    "threads": (1, _core.max_threads),
}


@dataclass(frozen=True)
class TrainConfig:
    """One training run. Sizes are (height, width) in pixels of the crop."""

    # what is trained, on what
    network: str = "wang2020"
    max_disparity: int = 72  # px; pixels with larger truth are left out of the loss
    dense_disparity: int | None = None  # px up to which fast has all its planes, beyond it half; None: all
    mode_reach: int | None = None  # planes around the likeliest one that fast reads its answer from; None: all
    data: tuple[str, ...] = ()  # roots of the data sets
    inference_width: int | None = None  # px at which frames are to be seen; None: what the network is made for
    layout: str = "endosdk"  # of the sets without a dataset.json
    train_pairs: int | None = None  # use only the first so many pairs; None: all but those held out
    held_out: int = 8  # last pairs of each set's train split, kept for validation and for fitting the confidence
    init_from: str | None = None  # run folder, checkpoint or shipped name whose weights are the start

    # samples
    batch: int = 4  # pairs per step and process
    crop: tuple[int, int] | None = None  # None: the network's usual one, which fits what it sees of a frame
    augment: bool = True
    looks: tuple[str, ...] = ()  # of real endoscopes, on top of the usual augmentation
    workers: int = 0  # extra processes that prepare crops; they share the decoded pairs where they are forked
    cache_gib: float = 8.0  # memory for decoded pairs
    seed: int = 0

    # loss
    loss: str = "scale-invariant"
    balance: float = 0.5  # of the scale-invariant loss: 0 squares in log space, 1 ignores a common factor
    volume_weight: float = 0.0  # of the cross-entropy of the volume that fast searches
    coarse_weight: float = 0.5  # of the coarse map's loss once the refined map is trained too
    quantised: bool = False  # layers compute with the 8-bit numbers of the deployed form, see `rounding`
    # The last map is taken as it is deployed: at this output stride, upsampled. None: the network's own.
    output_stride: int | None = None

    # schedule
    steps: int = 4000  # 0: only the confidence is fitted, to the held-out pairs
    optimiser: str = "rmsprop"  # the paper's; adamw and muon are the others
    rate: float = 1e-3
    final_rate: float = 3e-5  # the rate falls from rate to this over the run
    # exponential falls with every step, linear takes more of the steps at high rates; epochs holds the rate within each
    # of `epochs` equal parts of the run and lets it fall by one factor between them, as the paper does; drop: once.
    decay: str = "exponential"
    epochs: int = 16  # parts of the run in which the rate is held, for the decay of that name
    warmup: int = 50  # steps in which the rate rises from zero
    weight_decay: float = 1e-4  # adamw and muon
    clip: float = 1.0  # largest norm of the gradient; 0: no limit
    refine_from_step: int = 0  # until then only the coarse stage is computed, at a sixth of the cost
    refine_crop: tuple[int, int] | None = None  # the refinement sees a random window of this size; None: the whole crop
    refine_only: bool = False  # only the refinement learns: the coarse stage and every batch norm's statistics stay
    frozen_norm: bool = False  # statistics of batch norm stay as they are: those of few crops are not those of frames

    # system
    precision: str = "auto"  # bf16 where the processor has units for it (elsewhere it is slower), else fp32
    device: str = "auto"  # cuda when there is one, else cpu
    threads: int | None = None  # processor threads of each process; None: what torch takes
    log_every: int = 20  # steps per line of log.csv
    validate_every: int = 500  # steps
    checkpoint_minutes: float = 5.0

    def __post_init__(self) -> None:
        """Check what would otherwise fail late or train silently wrong."""
        for name, choices in CHOICES.items():
            if getattr(self, name) not in choices:
                raise InvalidArgument(name, f"must be one of {', '.join(choices)}", getattr(self, name))
        for name, (low, high) in RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise InvalidArgument(name, f"must be within {low}..{high}", value)
        if not self.rate <= LARGEST:
            raise InvalidArgument("rate", "must be a finite number", self.rate)
        if not 0 < self.final_rate <= self.rate:
            raise InvalidArgument("final_rate", "must be above 0 and at most rate", self.final_rate)
        if self.refine_only and self.refine_from_step:
            raise InvalidArgument("refine_from_step", "must be 0 with refine_only", self.refine_from_step)
        if isinstance(self.data, str):
            raise InvalidArgument("data", "must be a tuple of folders", self.data)
        for look in self.looks:
            if look not in LOOKS:
                raise InvalidArgument("looks", f"must be among {', '.join(LOOKS)}", look)
        self._check_crops()

    def _check_crops(self) -> None:
        if any(side < 8 or side % 8 for side in (*(self.crop or ()), *(self.refine_crop or ()))):
            raise InvalidArgument("crop", "and refine_crop must be multiples of 8", (self.crop, self.refine_crop))
        if self.crop is None or self.refine_crop is None:
            return
        if any(w > c for w, c in zip(self.refine_crop, self.crop, strict=True)):
            raise InvalidArgument("refine_crop", f"must fit into the crop {self.crop}", self.refine_crop)

    def rate_at(self, step: int) -> float:
        """Learning rate of one step: a linear rise, then the fall to ``final_rate``."""
        rate = self.rate_after(min(step / self.steps, 1.0))
        return float(rate * min(1.0, (step + 1) / max(self.warmup, 1)))

    def rate_after(self, share: float) -> float:
        """Learning rate after this share of the steps, 0..1, without the rise."""
        if self.decay == "linear":
            return self.rate + (self.final_rate - self.rate) * share
        if self.decay == "drop":
            return self.rate if share < DROP_AFTER else self.final_rate
        if self.decay == "epochs":  # the last of them has the final rate
            done = min(math.floor(share * self.epochs + 1e-9), self.epochs - 1)
            share = done / max(self.epochs - 1, 1)
        return float(self.rate * (self.final_rate / self.rate) ** share)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values that JSON can hold."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> TrainConfig:
        """Rebuild from `as_dict`, perhaps after a way through JSON."""
        known = {f.name for f in fields(cls)}
        unknown = sorted(set(values) - known)
        if isinstance(values.get("data"), str):  # older checkpoints name the only set that a run could learn from
            values = {**values, "data": [values["data"]] if values["data"] else []}
        if unknown:
            raise InvalidArgument("config", f"must hold only the fields {', '.join(sorted(known))}", unknown)
        listed = {name: tuple(values[name]) for name in LISTS if values.get(name) is not None}
        return cls(**{**values, **listed})
