"""``endosdk evaluate``: the error of a model on a data set with truth."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from endosdk.commands.options import MODEL, add_model, add_session, session_options
from endosdk.commands.report import Report
from endosdk.datasets.layouts import LAYOUTS
from endosdk.evaluation.scores import PIXEL_LIMITS
from endosdk.evaluation.sgbm import RANGE as SGBM_RANGE

if TYPE_CHECKING:
    from endosdk.datasets.dataset import DatasetReader
    from endosdk.evaluation.methods import Method

FOR_MODELS = (("network_size", None), ("provider", "cpu"), ("provider_option", None), ("threads", None))
PARTS = (
    "all",
    "non_occluded",
    "occluded",
    "edges",
    "instrument_edges",
    "glare",
    "low_texture",
    "in_range",
    "valid",
)
SHORT = {"instrument_edges": "instruments"}
NONE_THERE = {
    "edges": "the ground truth has no depth edge",
    "instrument_edges": "the ground truth has no edge of an instrument",
    "glare": "no ground truth lies in glare",
    "low_texture": "no ground truth lies where texture is low",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_model(parser, others=" or sgbm")
    parser.add_argument(
        "--maps",
        type=Path,
        metavar="DIR",
        help="score disparity maps from this folder instead of a model: ID.png (16 bits, 256 times the disparity),"
        " ID.pfm or ID.npy for each pair (default: none)",
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the data set")
    parser.add_argument(
        "--layout",
        default="endosdk",
        help=f"format of the data set: {', '.join(LAYOUTS)}",
    )
    parser.add_argument("--split", help="train or test (default: test, or the split with published ground truth)")
    parser.add_argument("--pairs", type=int, help="use only the first N pairs (default: all)")
    add_session(parser)
    parser.add_argument(
        "--sgbm-range",
        type=int,
        metavar="N",
        help=f"disparities that sgbm searches, px, a multiple of 16 (default: {SGBM_RANGE})",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        help="write scores.json and images of the ten worst pairs to this folder (default: none)",
    )


def run(args: argparse.Namespace) -> int:
    """Evaluate and print a table; the status is 1 where no pixel could be scored."""
    from endosdk.datasets.layouts import default_split, open_dataset
    from endosdk.evaluation.methods import evaluate, write_worst
    from endosdk.evaluation.own_maps import maps_sha256
    from endosdk.io.whole_files import write_json
    from endosdk.jobs.machine import machine_record

    method, model = _method(args)
    split = args.split or default_split(args.layout)
    reader = open_dataset(args.data, split, layout=args.layout)
    scores = evaluate(method, reader, args.pairs)
    if args.maps is not None:
        model["sha256"] = maps_sha256(args.maps, reader.ids[: args.pairs])
        del scores["ms_median"]  # what computed the maps took another time
    report = Report(args)
    report.record = {
        "command": _command(args, reader),
        "model": model,
        "data": {"name": reader.name, "layout": args.layout, "split": split, "sha256": reader.sha256},
        "scores": scores,
        "machine": machine_record(),
    }
    for part in PARTS:
        if part in scores:
            _report_part(report, part, scores[part])
    if "ms_median" in scores:
        report.line(f"time          {scores['ms_median']:.1f} ms per pair (median)")
    if args.out:
        pictures = write_worst(method, reader, scores, args.out / "worst")
        write_json(args.out / "scores.json", report.record, "out")
        report.line(f"written       {args.out / 'scores.json'} and {len(pictures)} images in {args.out / 'worst'}")
    return report.end(usable=bool(scores["all"]["valid"]))


def _method(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    """Return what is scored, and its entry in the record."""
    if args.maps is not None:
        return _maps(args)
    return _sgbm(args) if args.model == "sgbm" else _estimator(args)


def _maps(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    from endosdk.errors import InvalidArgument
    from endosdk.evaluation.own_maps import maps_method

    for name, default in (("model", MODEL), ("sgbm_range", None), *FOR_MODELS):
        if getattr(args, name) != default:
            raise InvalidArgument(name, "is for what computes maps; leave it out with --maps", getattr(args, name))
    return maps_method(args.maps), {"name": "maps"}


def _estimator(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    from endosdk.errors import InvalidArgument
    from endosdk.evaluation.methods import estimator_method
    from endosdk.runtime.estimator import DepthEstimator

    if args.sgbm_range is not None:
        raise InvalidArgument("sgbm_range", "is for --model sgbm", args.sgbm_range)
    options = session_options(args)
    # Loaded once before any data is read: a wrong option is refused at once, and the record names the model that runs,
    # which is another than the one asked for where the processor lacks instructions.
    info = DepthEstimator(args.model, **options).model
    return estimator_method(args.model, **options), dict(info.identity())


def _sgbm(args: argparse.Namespace) -> tuple[Method, dict[str, Any]]:
    from endosdk.errors import InvalidArgument
    from endosdk.evaluation.methods import sgbm_method
    from endosdk.evaluation.sgbm import SgbmSettings

    for name, default in FOR_MODELS:
        if getattr(args, name) != default:
            raise InvalidArgument(name, "is for models; leave it out with sgbm", getattr(args, name))
    try:
        settings = SgbmSettings() if args.sgbm_range is None else SgbmSettings(max_disparity=args.sgbm_range)
    except InvalidArgument as error:  # it names the matcher's setting, which has another name
        raise InvalidArgument("sgbm_range", error.rule, error.value) from error
    return sgbm_method(filled=True, settings=settings), {"name": "sgbm", "max_disparity": settings.max_disparity}


def _command(args: argparse.Namespace, reader: DatasetReader) -> str:
    """Return the command that measures the same again; of files only their names: no private paths."""
    what = ["--model", Path(args.model).name] if args.maps is None else ["--maps", args.maps.resolve().name]
    words = ["endosdk", "evaluate", *what, "--data", args.data.resolve().name]
    words += ["--layout", args.layout, "--split", reader.split]
    for name in ("pairs", "network_size", "provider", "threads", "sgbm_range"):
        if getattr(args, name) is not None:
            words += ["--" + name.replace("_", "-"), str(getattr(args, name))]
    words += [word for option in args.provider_option or () for word in ("--provider-option", option)]
    return shlex.join(words)


def _report_part(report: Report, name: str, measures: dict[str, Any]) -> None:
    shown = SHORT.get(name, name)
    if name in NONE_THERE and not measures["pixels"]:
        report.line(f"{shown:13} {NONE_THERE[name]}")
        return
    if not measures["valid"]:
        report.line(f"{shown:13} no pixel counted: {measures['pixels']} with truth, none of them answered")
        return
    shares = ", ".join(f"{100 * measures[f'kpe_{k}']:.2f} % over {k} px" for k in PIXEL_LIMITS)
    report.line(f"{shown:13} EPE {measures['epe_px']:.4f} px; {shares}")
    if "depth_mae_mm" in measures:
        report.line(f"{'':13} depth error {measures['depth_mae_mm']:.3f} mm, {100 * measures['depth_relative']:.2f} %")
    if measures.get("flying") is not None:
        report.line(f"{'':13} {100 * measures['flying']:.2f} % flying pixels")
    share = "" if name == "all" else f" ({100 * measures['share']:.1f} % of all)"
    report.line(f"{'':13} {measures['pixels']} pixels with truth{share}, {100 * measures['coverage']:.1f} % answered")
