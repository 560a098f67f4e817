"""``endosdk train``: train a network on a data set, or go on with a run."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import fields
from pathlib import Path
from typing import Any

from endosdk.commands.report import Report
from endosdk.runtime.models import shipped_weights
from endosdk.training.config import CHOICES, TrainConfig
from endosdk.training.looks import LOOKS

# Settings that the command line offers, with the text that --help shows; the rest keep the defaults of TrainConfig.
_SETTINGS: dict[str, tuple[type, str]] = {
    "max_disparity": (int, "range of the network in px, a multiple of 8"),
    "inference_width": (
        int,
        "inference width, px; smaller is faster (default: the network's own)",
    ),
    "layout": (str, "format of the data sets that have no dataset.json"),
    "train_pairs": (int, "use only the first N pairs (default: all but those held out)"),
    "held_out": (int, "last pairs of the train split, kept for validation and confidence"),
    "init_from": (
        str,
        f"run folder, checkpoint or shipped weights ({', '.join(shipped_weights())}) to start from. Their recipe"
        " gives the defaults; learning rates are those of its last third (default: none)",
    ),
    "batch": (int, "pairs per step and process"),
    "workers": (int, "extra processes that prepare crops"),
    "seed": (int, "seed of weights and crops"),
    "dense_disparity": (
        int,
        "disparity up to which fast and cascade use every plane; above, every second plane (default: all planes)",
    ),
    "mode_reach": (
        int,
        "planes on each side of the best one used for the result (fast, cascade) (default: all planes)",
    ),
    "volume_weight": (float, "weight of the cross-entropy loss on the cost volume"),
    "loss": (str, ", ".join(CHOICES["loss"])),
    "balance": (float, "lambda of the scale-invariant loss, 0..1"),
    "output_stride": (
        int,
        "input px per cell of the model output; training upsamples such maps (default: the network's own)",
    ),
    "steps": (int, "training steps; 0: only calibrate the confidence on the held-out pairs"),
    "optimiser": (str, ", ".join(CHOICES["optimiser"])),
    "rate": (float, "learning rate at the start"),
    "final_rate": (float, "learning rate at the end"),
    "decay": (
        str,
        "learning-rate schedule: exponential, linear, epochs (in --epochs steps) or drop (once, after two thirds)",
    ),
    "epochs": (int, "parts of the run in which the rate is held, with --decay epochs"),
    "refine_from_step": (int, "train only the coarse stage until this step"),
    "precision": (str, ", ".join(CHOICES["precision"])),
    "device": (str, ", ".join(CHOICES["device"])),
    "threads": (int, "CPU threads per process (default: that of PyTorch)"),
    "validate_every": (int, "steps between validations"),
    "checkpoint_minutes": (float, "minutes between checkpoints"),
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments; what is not given keeps its default, or the run's own value when it is resumed."""
    parser.add_argument(
        "--data", nargs="+", metavar="DIR", help="roots of the data sets (default: those of the resumed run)"
    )
    parser.add_argument(
        "--out", type=Path, metavar="DIR", required=True, help="folder of the run: checkpoint, log.csv, log.json"
    )
    parser.add_argument("--resume", action="store_true", help="continue the run in --out")
    parser.add_argument(
        "--network",
        help="wang2020, wang2020-photometric, fast, or cascade (the network of the model accurate)"
        + _default("network"),
    )
    parser.add_argument(
        "--crop", type=int, nargs=2, metavar=("H", "W"), help="size of the crops, px (default: the network's own)"
    )
    parser.add_argument(
        "--refine-crop",
        type=int,
        nargs=2,
        metavar=("H", "W"),
        help="crop size for the refinement stage, px (default: all)",
    )
    parser.add_argument(
        "--refine-only", action="store_true", default=None, help="train only the refinement stage (with --init-from)"
    )
    parser.add_argument(
        "--looks",
        nargs="*",
        metavar="NAME",
        help=f"augmentations with faults of real endoscopes: {', '.join(LOOKS)} (default: none)",
    )
    parser.add_argument(
        "--quantised",
        action="store_true",
        default=None,
        help="quantisation-aware: most layers round weights and activations as the 8-bit model does",
    )
    parser.add_argument(
        "--frozen-norm",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="keep the statistics of batch norm: for batches of few crops (with --init-from)",
    )
    parser.add_argument("--no-augment", dest="augment", action="store_false", default=None, help="no augmentation")
    for name, (kind, text) in _SETTINGS.items():
        parser.add_argument("--" + name.replace("_", "-"), type=kind, help=text + _default(name))


def _default(name: str) -> str:
    """Say what a setting is when it is not given; None stands for what the text says."""
    default = next(field.default for field in fields(TrainConfig) if field.name == name)
    return "" if default is None else f" (default: {default})"


def run(args: argparse.Namespace) -> int:
    """Train and print where the result lies."""
    from endosdk.training import checkpoint
    from endosdk.training.train import train

    report = Report(args)
    given = _given(args)
    if args.resume:
        given = {**checkpoint.load(args.out).config.as_dict(), **given}
    elif args.init_from is not None:
        taken_over = checkpoint.inherited(args.init_from, given)
        report.record["inherited"] = taken_over
        report.line(f"from {args.init_from}: {', '.join(f'{name} {_shown(taken_over[name])}' for name in taken_over)}")
        given = {**taken_over, **given}
    try:
        trained = train(TrainConfig.from_dict(given), args.out, resume=args.resume)
    except KeyboardInterrupt:
        if not (args.out / checkpoint.LAST).exists():  # before the run began
            raise
        again = shlex.join(["endosdk", "train", "--resume", "--out", str(args.out)])
        raise KeyboardInterrupt(f"stopped; {again} continues") from None
    report.record["checkpoint"] = trained
    report.line(f"checkpoint {trained}")
    return report.end()


def _shown(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.3g}"
    if isinstance(value, tuple | list):
        return " ".join(map(str, value)) or "none"
    return "none" if value is None else str(value)


def _given(args: argparse.Namespace) -> dict[str, Any]:
    flags = ("refine_only", "augment", "quantised", "frozen_norm")
    names = ("data", "network", "crop", "refine_crop", "looks", *flags, *_SETTINGS)
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}
