"""What is trained, as data: the protocol that all networks share, the rows of Table 1, and the ablations.

An experiment is the handful of settings in which it differs from the protocol. The numbers behind the names of groups
are those of the paper's figures.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

# Sixteen epochs over 800 pairs in batches of four, as in the paper; crops and augmentation are the same for everybody.
PROTOCOL: dict[str, Any] = {
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


@dataclass(frozen=True)
class Budget:
    """How much a run may see on one kind of device: what differs from the protocol, and who stops earlier.

    The runs of a group are alike: those of Table 1 take ``changes``, those of all other groups ``ablation``.
    """

    changes: dict[str, Any] = field(default_factory=dict)
    ablation: dict[str, Any] = field(default_factory=dict)
    ablation_pairs: int | None = None  # of the test split, the first; None for all
    most_steps: dict[str, int] = field(default_factory=dict)  # of networks that are too dear for the whole budget


# On processors the refinement, a local part and by far the dearest, learns on a window of each crop. The ablations,
# thirteen runs that are compared with one another alone, take fewer and smaller crops.
BUDGETS = {
    "gpu": Budget(),
    "cpu": Budget(
        changes={"refine_crop": (128, 256)},
        ablation={"steps": 1200, "crop": (192, 384), "refine_crop": (64, 128)},
        ablation_pairs=25,
        most_steps={"psmnet": 900},
    ),
}


@dataclass(frozen=True)
class Experiment:
    """One training run: its folder, its group (a key of `GROUPS`), the curve's label, what differs."""

    name: str
    group: str
    label: str
    changes: dict[str, Any] = field(default_factory=dict)

    def planned(self, budget: str, overrides: dict[str, Any]) -> dict[str, Any]:
        """Return all settings of the whole budget; overrides shorten every run alike: a comparison stays fair."""
        share = BUDGETS[budget].changes if self.group == "table1" else BUDGETS[budget].ablation
        return {**PROTOCOL, **share, **self.changes, **overrides}

    def settings(self, budget: str, overrides: dict[str, Any]) -> dict[str, Any]:
        """Return the settings to train with: a network that is too dear for the budget takes fewer steps."""
        planned = self.planned(budget, overrides)
        most = BUDGETS[budget].most_steps.get(planned["network"], planned["steps"])
        return {**planned, "steps": min(planned["steps"], most)}


# AnyNet and PSMNet divide by 16, so their range is the next one that covers the data's 69.5 px. They have no refinement
# apart, and always learn on whole crops. Loss, optimiser (Adam: AdamW without decay) and first rate are of their
# papers; the fall of the rate is the protocol's.
RIVAL_RECIPE: dict[str, Any] = {"loss": "smooth-l1", "optimiser": "adamw", "weight_decay": 0.0}
RIVAL: dict[str, Any] = {"max_disparity": 80, "refine_crop": None, **RIVAL_RECIPE}

EXPERIMENTS = (
    Experiment("wang2020", "table1", "wang2020"),
    # What the loss and the optimiser of its paper cost: all else as above.
    Experiment("wang2020-adam", "table1", "wang2020, smooth L1 and Adam", RIVAL_RECIPE),
    Experiment("anynet", "table1", "AnyNet", {"network": "anynet", "rate": 5e-4, **RIVAL}),
    Experiment("psmnet", "table1", "PSMNet", {"network": "psmnet", **RIVAL}),
    Experiment("loss-l2", "loss", "L2", {"loss": "l2"}),
    Experiment("loss-log", "loss", "lambda 0", {"balance": 0.0}),
    Experiment("base", "loss", "lambda 0.5"),
    Experiment("loss-invariant", "loss", "lambda 1", {"balance": 1.0}),
    Experiment("loss-l2-again", "loss", "L2, second seed", {"loss": "l2", "seed": 1}),
    Experiment("base-again", "loss", "lambda 0.5, second seed", {"seed": 1}),
    Experiment("pairs-100", "pairs", "100 pairs", {"train_pairs": 100}),
    Experiment("pairs-400", "pairs", "400 pairs", {"train_pairs": 400}),
    Experiment("base", "pairs", "800 pairs"),
    Experiment("pairs-900", "pairs", "900 pairs", {"train_pairs": 900}),
    Experiment("range-192", "range", "192 px", {"max_disparity": 192}),
    Experiment("base", "range", "72 px"),
    Experiment("range-56", "range", "56 px", {"max_disparity": 56}),
    Experiment("range-48", "range", "48 px", {"max_disparity": 48}),
    Experiment("range-40", "range", "40 px", {"max_disparity": 40}),
    Experiment("base", "refinement", "with refinement"),
    # The refinement starts as the identity: never trained, it leaves the coarse map as it is.
    Experiment("no-refinement", "refinement", "without refinement", {"refine_from_step": 10**9}),
)


@dataclass(frozen=True)
class Claim:
    """One thing that the paper found, in words and as how the error of a run compares with those of others."""

    text: str
    run: str  # label, as those of the others
    relation: str  # a key of `verdicts.VERDICTS`
    others: tuple[str, ...]
    fair_on_windows: bool = True  # False: a window of the refinement changes more than what is compared


@dataclass(frozen=True)
class Group:
    """One comparison: the figures of the paper that it redoes, what the paper found, what to know about ours."""

    title: str
    figures: str
    claims: tuple[Claim, ...] = ()
    remark: str = ""
    curves: str = ""  # what to know about the curves of training


GROUPS = {
    "table1": Group(
        "Methods side by side",
        "Table 1, Fig. 6",
        remark="Networks are timed in ONNX Runtime on a processor, the paper's on a GTX 1080. In AnyNet's file the "
        "spatial propagation is a Scan, which takes the columns of the map one after the other.",
    ),
    "loss": Group(
        "Loss",
        "Fig. 5",
        (Claim("the scale-invariant loss ends at a smaller error than L2", "lambda 0.5", "below", ("L2",)),),
    ),
    "pairs": Group(
        "Number of training pairs",
        "Fig. 7, 8",
        (
            Claim("100 pairs are clearly worse than 800", "100 pairs", "above", ("800 pairs",)),
            Claim("800 pairs are enough: 900 do no better", "800 pairs", "not above", ("900 pairs",)),
        ),
    ),
    "range": Group(
        "Maximum disparity",
        "Fig. 9, 10",
        (
            Claim("192 px is clearly worse than 72 and less", "192 px", "above", ("72 px", "56 px", "48 px", "40 px")),
            Claim("56 px is best by a little", "56 px", "below", ("192 px", "72 px", "48 px", "40 px")),
        ),
        "What lies beyond a run's range it cannot find; the histogram of our disparities is at the end.",
        "each run leaves out truth beyond its own range, so a short range looks better than it is",
    ),
    "refinement": Group(
        "Edge refinement",
        "Fig. 11, 12",
        (
            Claim(
                "the error is almost the same with and without",
                "with refinement",
                "like",
                ("without refinement",),
                fair_on_windows=False,
            ),
        ),
        curves="with refinement, the refined map on the window it learns on; without, the coarse map on whole crops",
    ),
}

# The methods that need no training, in the order of the table; `None` stands for the settings that the search found.
CLASSICAL: dict[str, dict[str, Any] | None] = {"sgbm": None, "sgbm-hh": None, "bm": {}}
LABELS = {
    "wang2020": "wang2020, by its paper's recipe",
    "wang2020-adam": "wang2020, loss and optimiser of the rivals",
    "shipped-wang2020": "wang2020 as shipped",
    "shipped-fast": "fast as shipped",
    "anynet": "AnyNet",
    "psmnet": "PSMNet",
    "patchmatch": "PatchMatch stereo",
    "sgbm": "StereoSGBM",
    "sgbm-hh": "StereoSGBM, 8 paths",
    "bm": "StereoBM",
}
# What the paper found worse than wang2020 in error and in time.
RIVALS = ("anynet", "psmnet", "patchmatch", "sgbm")
PAPER_EPE_PX = 0.4145
AIM_EPE_PX = 0.20  # of our best recipe for wang2020
PAPER_FRAME = (720, 960)


def unique_runs() -> list[Experiment]:
    """Every run once, in the order in which they are to be trained; groups share runs."""
    seen: dict[str, Experiment] = {}
    for experiment in EXPERIMENTS:
        seen.setdefault(experiment.name, experiment)
    return list(seen.values())


def size(sides: Sequence[int]) -> str:
    """Write height and width as the report does."""
    return f"{sides[1]} x {sides[0]}"


def crops(settings: dict[str, Any]) -> str:
    """Write how many crops a run sees, and of which size."""
    return f"{settings['steps'] * settings['batch']} crops of {size(settings['crop'])}"
