"""What is trained, as data: the two protocols, the rows of Table 1, and the ablations.

An experiment is the handful of settings in which it differs from its protocol. The numbers behind the names of groups
are those of the paper's figures.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

FRAME = (720, 960)
# The paper's own: whole frames, 16 passes over 800 pairs, RMSprop whose rate falls by one factor an epoch, the loss at
# both stages, no augmentation. It names no batch, no factor and no limit of the gradient: a batch of one fits the 8 GB
# of its card whatever the range, the factor brings the rate to a thirtieth, and nothing is limited or warmed up.
PAPER_PROTOCOL: dict[str, Any] = {
    "network": "wang2020-whole-range",
    "max_disparity": 192,
    "train_pairs": 800,
    "epochs": 16,
    "batch": 1,
    "crop": FRAME,
    "augment": False,
    "loss": "scale-invariant",
    "balance": 0.5,
    "coarse_weight": 1.0,
    "optimiser": "rmsprop",
    "rate": 1e-3,
    "final_rate": 3e-5,
    "decay": "epochs",
    "warmup": 0,
    "clip": 0.0,
    "held_out": 0,
    "seed": 0,
}
# Ours, of earlier reports: as many samples, but crops with strong augmentation in batches of four, a warm-up and a
# limit of the gradient, planes that end 8 px before the range, and half the weight for the coarse map.
OUR_PROTOCOL: dict[str, Any] = {
    "network": "wang2020",
    "max_disparity": 72,
    "batch": 4,
    "crop": (256, 512),
    "steps": 3200,
    "loss": "scale-invariant",
    "balance": 0.5,
    "optimiser": "rmsprop",
    "rate": 1e-3,
    "final_rate": 3e-5,
    "train_pairs": 800,
    "held_out": 0,
    "seed": 0,
}
PROTOCOLS = {"paper": PAPER_PROTOCOL, "ours": OUR_PROTOCOL}


@dataclass(frozen=True)
class Budget:
    """How much a run may see on one kind of device: what differs from the protocols."""

    ours: dict[str, Any] = field(default_factory=dict)  # of the runs of Table 1 by our protocol
    ablation: dict[str, Any] = field(default_factory=dict)
    ablation_pairs: int | None = None  # of the test split, the first; None for all


# On processors the refinement, a local part and by far the dearest, learns on a window of each crop. The ablations see
# a strip of 96 rows of each frame, as wide as the frame: so every range has its whole width.
BUDGETS = {
    "gpu": Budget(),
    "cpu": Budget(
        ours={"refine_crop": (128, 256)},
        ablation={"crop": (96, 960), "refine_crop": (96, 240)},
        ablation_pairs=10,
    ),
}


@dataclass(frozen=True)
class Experiment:
    """One training run: its folder, its group (a key of `GROUPS`), the curve's label, what differs."""

    name: str
    group: str
    label: str
    changes: dict[str, Any] = field(default_factory=dict)
    protocol: str = "paper"  # a key of `PROTOCOLS`
    with_test: bool = False  # the last of its training pairs are the test pairs, to see what they would add
    late_stage: float = 0.0  # share of the steps after which the network's last stage learns too

    def settings(self, budget: str, overrides: dict[str, Any]) -> dict[str, Any]:
        """Return the settings to train with; overrides shorten every run alike: a comparison stays fair."""
        share = BUDGETS[budget].ours if self.protocol == "ours" else {}
        if self.group != "table1":
            share = BUDGETS[budget].ablation
        found = {**PROTOCOLS[self.protocol], **share, **self.changes, **overrides}
        if "epochs" in found and "steps" not in overrides:
            found["steps"] = found["epochs"] * found["train_pairs"] // found["batch"]
        if self.late_stage:
            found["refine_from_step"] = round(self.late_stage * found["steps"])
        return found

    @property
    def pairs(self) -> int:
        """How many pairs it learns from."""
        return int(self.changes.get("train_pairs", PROTOCOLS[self.protocol]["train_pairs"]))

    @property
    def setting(self) -> tuple[Any, ...]:
        """What runs that differ in their seed alone have in common."""
        plain = {name: value for name, value in self.changes.items() if name != "seed"}
        return self.protocol, self.group == "table1", self.with_test, tuple(sorted(plain.items()))


def seeded(count: int, name: str, group: str, label: str, changes: dict[str, Any], **more: Any) -> list[Experiment]:
    """Return the run with so many seeds; the first has the plain name."""
    marks = [("", ""), *((f"-seed{seed}", f", seed {seed}") for seed in range(1, count))]
    return [
        Experiment(name + mark, group, label + said, {**changes, **({"seed": seed} if seed else {})}, **more)
        for seed, (mark, said) in enumerate(marks)
    ]


# Loss, optimiser (Adam: AdamW without decay) and first rate of the other networks are of their papers.
PUBLISHED_RECIPE: dict[str, Any] = {"loss": "smooth-l1", "optimiser": "adamw", "weight_decay": 0.0}
# PSMNet divides by 16, so its range is the next one that covers the data's 69.5 px. It has no refinement apart.
PSMNET: dict[str, Any] = {"network": "psmnet", "max_disparity": 80, "refine_crop": None, **PUBLISHED_RECIPE}
# As its authors publish it: batches of six, a rate that is held for two thirds and then falls to a tenth, a propagation
# that learns from two fifths on. Whole frames as the paper, and twice its epochs: ten times the products of our first
# run, whose error came from its short training.
ANYNET: dict[str, Any] = {
    "network": "anynet",
    "max_disparity": 192,
    "batch": 6,
    "epochs": 32,
    "rate": 5e-4,
    "final_rate": 5e-5,
    "decay": "drop",
    **PUBLISHED_RECIPE,
}
LATE_STAGE = 120 / 300

VOLUMES = {"100 pairs": 100, "400 pairs": 400, "800 pairs": 800, "800 pairs and the test pairs": 900}
RANGES = (72, 56, 48, 40)
REFINED_AT = 56  # px: the range at which the paper compares with and without refinement
# Never trained, the refinement, which starts as the identity, leaves the coarse map as it is.
UNREFINED: dict[str, Any] = {"refine_from_step": 10**9}


def _volume(label: str, group: str, changes: dict[str, Any], mark: str, said: str) -> list[Experiment]:
    pairs = VOLUMES[label]
    more = {"with_test": True} if pairs > PAPER_PROTOCOL["train_pairs"] else {}
    named = {} if pairs == PAPER_PROTOCOL["train_pairs"] else {"train_pairs": pairs}
    return seeded(2, f"pairs-{pairs}{mark}", group, label + said, {**changes, **named}, **more)


def _experiments() -> Iterable[Experiment]:
    yield from seeded(3, "paper-192", "table1", "D = 192", {})
    yield from seeded(3, "paper-72", "table1", "D = 72", {"max_disparity": 72})
    yield from seeded(2, "anynet-published", "table1", "AnyNet", ANYNET, late_stage=LATE_STAGE)
    yield Experiment("psmnet", "table1", "PSMNet", PSMNET, "ours")
    yield Experiment("wang2020", "table1", "wang2020", {}, "ours")
    # What the loss and the optimiser of its paper cost: all else as above.
    yield Experiment("wang2020-adam", "table1", "wang2020, smooth L1 and Adam", PUBLISHED_RECIPE, "ours")
    base: dict[str, Any] = {"name": "base", "changes": {}}
    yield from seeded(2, "loss-l2", "loss", "L2", {"loss": "l2"})
    yield Experiment("loss-log", "loss", "lambda 0", {"balance": 0.0})
    yield from seeded(3, group="loss", label="lambda 0.5", **base)
    yield Experiment("loss-invariant", "loss", "lambda 1", {"balance": 1.0})
    for label in VOLUMES:
        if VOLUMES[label] == PAPER_PROTOCOL["train_pairs"]:
            yield from seeded(3, group="pairs", label=label, **base)
        else:
            yield from _volume(label, "pairs", {}, "", "")
    yield from seeded(3, group="range", label="192 px", **base)
    for largest in RANGES:
        yield from seeded(3, f"range-{largest}", "range", f"{largest} px", {"max_disparity": largest})
    at = {"max_disparity": REFINED_AT}
    for label in VOLUMES:
        if VOLUMES[label] == PAPER_PROTOCOL["train_pairs"]:
            yield from seeded(3, f"range-{REFINED_AT}", "refinement", f"{label}, refined", at)
        else:
            yield from _volume(label, "refinement", at, f"-at{REFINED_AT}", ", refined")
        yield from _volume(label, "refinement", {**at, **UNREFINED}, f"-at{REFINED_AT}-coarse", ", coarse alone")


EXPERIMENTS = tuple(_experiments())


@dataclass(frozen=True)
class Claim:
    """One thing that the paper found, in words and as how a measure of a run compares with that of others."""

    text: str
    run: str  # label, as those of the others
    relation: str  # a key of `verdicts.RELATIONS`
    others: tuple[str, ...]
    measure: str = "epe"  # a key of `MEASURES`
    of_paper: bool = True  # False: a question of ours


# What a claim may be about: the key of a row, and how it is said.
MEASURES = {
    "epe": "test EPE over all truth, px",
    "epe_common": "test EPE over truth that all ranges hold, px",
    "last_loss": "training loss, mean of the last epoch",
}


@dataclass(frozen=True)
class Group:
    """One comparison: the figures of the paper that it redoes, and what the paper found."""

    title: str
    figures: str
    claims: tuple[Claim, ...] = ()


_SHORT = tuple(f"{largest} px" for largest in RANGES)


def _range_claims(measure: str) -> tuple[Claim, ...]:
    return (
        Claim("192 px has a clearly larger error than 72 px and less", "192 px", "above", _SHORT, measure),
        Claim("72 to 40 px differ little", "72 px", "like", _SHORT[1:], measure),
        Claim("56 px is best by a little", "56 px", "below", ("192 px", "72 px", "48 px", "40 px"), measure),
    )


GROUPS = {
    "table1": Group("Methods side by side", "Table 1, Fig. 6"),
    "loss": Group(
        "Loss",
        "Fig. 5",
        (
            Claim(
                "the scale-invariant loss ends at a smaller error than L2",
                "lambda 0.5",
                "below",
                ("L2",),
                of_paper=False,
            ),
        ),
    ),
    "pairs": Group(
        "Number of training pairs",
        "Fig. 7, 8",
        (
            Claim("100 pairs are clearly worse than 800", "100 pairs", "above", ("800 pairs",)),
            Claim(
                "adding the test pairs lowers the test error", "800 pairs and the test pairs", "below", ("800 pairs",)
            ),
        ),
    ),
    "range": Group(
        "Maximum disparity",
        "Fig. 9, 10",
        (
            *_range_claims("epe"),
            *_range_claims("epe_common"),
            Claim("192 px has a slightly larger loss", "192 px", "above", ("72 px",), "last_loss"),
        ),
    ),
    "refinement": Group(
        "Edge refinement",
        "Fig. 11, 12",
        tuple(
            Claim(
                f"{label}: the test error is almost the same with and without",
                f"{label}, refined",
                "like",
                (f"{label}, coarse alone",),
            )
            for label in VOLUMES
        ),
    ),
}

# The methods that need no training, in the order of the table; `None` stands for the settings that the search found.
CLASSICAL: dict[str, dict[str, Any] | None] = {"sgbm": None, "sgbm-hh": None, "bm": {}}
LABELS = {
    "paper-192": "wang2020 by its paper's protocol, D = 192",
    "paper-72": "wang2020 by its paper's protocol, D = 72",
    "wang2020": "wang2020, its loss and optimiser, our protocol",
    "wang2020-adam": "wang2020, loss and optimiser of the other networks, our protocol",
    "shipped-wang2020": "wang2020 as shipped",
    "shipped-fast": "fast as shipped",
    "anynet-published": "AnyNet as published",
    "psmnet": "PSMNet",
    "patchmatch": "PatchMatch stereo",
    "sgbm": "StereoSGBM",
    "sgbm-hh": "StereoSGBM, 8 paths",
    "bm": "StereoBM",
}
# Further seeds stand in the table once they have been run.
SEEDS = {
    run.name: f"{LABELS[run.name.partition('-seed')[0]]}, seed {run.changes['seed']}"
    for run in EXPERIMENTS
    if run.group == "table1" and "seed" in run.changes
}
# What the paper found worse than wang2020 in error and in time; StereoSGBM in both of its forms.
COMPARED = ("anynet-published", "psmnet", "patchmatch", "sgbm", "sgbm-hh")
TARGET_EPE_PX = 0.20  # of our best recipe for wang2020


def unique_runs() -> list[Experiment]:
    """Every run once, in the order in which they are to be trained: first seeds first; groups share runs."""
    seen: dict[str, Experiment] = {}
    for experiment in EXPERIMENTS:
        seen.setdefault(experiment.name, experiment)
    return sorted(seen.values(), key=lambda run: int(run.changes.get("seed", 0)))


def rows_by_name(groups: dict[str, dict[str, dict[str, Any] | None]]) -> dict[str, dict[str, Any]]:
    """Return the rows of the ablations' groups by the names of their runs."""
    return {run.name: row for run in EXPERIMENTS if (row := groups.get(run.group, {}).get(run.label))}


def ablations_of(table: str) -> str:
    """Return the name of the record of ablations beside a table: ``table1_NAME`` has ``ablations_NAME``."""
    return "ablations" + table.removeprefix("table1")


def size(sides: Sequence[int]) -> str:
    """Write height and width as the report does."""
    return f"{sides[1]} x {sides[0]}"


def crops(count: int, crop: Sequence[int]) -> str:
    """Write how many samples a run sees, and of which size."""
    if tuple(crop) == FRAME:
        return f"{count} whole frames"
    return f"{count} crops of {size(crop)}"
