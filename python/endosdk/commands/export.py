"""``endosdk export``: turn a training run into a model file, and prove that both compute the same."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from endosdk.commands.report import Report
from endosdk.runtime.models import shipped_weights

VERSION = "1"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "run",
        help=f"run folder, checkpoint or shipped weights ({', '.join(shipped_weights())}), which need --data; with"
        " --triton alone a shipped name or .onnx file",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="the .onnx file to write (default: none, which --triton alone allows)"
    )
    parser.add_argument("--name", help="model name (default: name of the network)")
    parser.add_argument("--model-version", help=f"version of the weights (default: {VERSION})")
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="data set whose test split is used to score and verify the model (default: the data of the run)",
    )
    parser.add_argument(
        "--int8",
        type=Path,
        metavar="FILE",
        help="also write an 8-bit model, named after its file; quantisation ranges come from the training data"
        " (default: not written)",
    )
    parser.add_argument(
        "--ranges-of",
        type=Path,
        metavar="FILE",
        help="take the quantisation ranges from this 8-bit model of the same weights (default: from the training data)",
    )
    parser.add_argument(
        "--output-stride",
        type=int,
        metavar="N",
        help="output one value per N x N input px; the SDK upsamples it along image edges (default: as it was trained)",
    )
    parser.add_argument(
        "--weights",
        type=Path,
        metavar="FILE",
        help="also write the weights, for later training (default: not written)",
    )
    parser.add_argument(
        "--triton",
        type=Path,
        metavar="DIR",
        help="add the model (that of --int8, if given) to a Triton repository (default: none)",
    )
    parser.add_argument("--layout", help="format of the data set (default: endosdk)")


def run(args: argparse.Namespace) -> int:
    """Export, compare with torch, and write the figures beside the file."""
    _check(args)
    return (_serve_alone(args) if args.out is None else _export(args)).end()


def _check(args: argparse.Namespace) -> None:
    """Refuse what cannot be exported, before the minutes that scoring takes. Raises InvalidArgument."""
    from endosdk.errors import InvalidArgument

    if args.out is None:
        if args.triton is None:
            raise InvalidArgument("out", "must name the .onnx file to write, or --triton a repository", None)
        for name in ("int8", "ranges_of", "weights", "data", "layout", "name", "model_version", "output_stride"):
            if getattr(args, name) is not None:
                raise InvalidArgument(name, "is for a training run that is exported; give --out", getattr(args, name))
    for name, ending in (("out", ".onnx"), ("int8", ".onnx"), ("weights", ".safetensors")):
        file = getattr(args, name)
        if file is not None and file.suffix != ending:
            raise InvalidArgument(name, f"must be a file that ends in {ending}", file)
    if args.int8 is not None and args.int8.resolve() == args.out.resolve():
        raise InvalidArgument("int8", "must be another file than --out", args.int8)
    if args.layout is not None and args.data is None:
        raise InvalidArgument("layout", "is that of --data; give both", args.layout)
    if args.ranges_of is not None and args.int8 is None:
        raise InvalidArgument("ranges_of", "is for --int8; give both", args.ranges_of)
    version = VERSION if args.model_version is None else args.model_version
    if args.triton is not None and not (version.isascii() and version.isdecimal() and version.strip("0")):
        raise InvalidArgument("model_version", "must be a whole number with --triton", repr(version))


def _serve_alone(args: argparse.Namespace) -> Report:
    """Add a model that is there to a Triton repository."""
    return _serve(Report(args), args.run, args.triton)


def _export(args: argparse.Namespace) -> Report:
    """Write the files of a training run, and say what they reach."""
    from endosdk.training import checkpoint
    from endosdk.training.release import release

    # What lies there comes before a shipped name: a run's own folder may be called the same.
    own = Path(args.run)
    trained = checkpoint.load(own if own.exists() else checkpoint.starting_point(args.run, "run"))
    figures = release(
        trained,
        args.out,
        name=args.name,
        version=VERSION if args.model_version is None else args.model_version,
        data=args.data,
        layout=args.layout or "endosdk",
        int8=args.int8,
        ranges_of=args.ranges_of,
        output_stride=args.output_stride,
    )
    if args.weights:
        checkpoint.save_weights(args.weights, trained)
    report = Report(args)
    files = [file for file in (args.out, args.int8, args.weights) if file]
    report.record = {**figures, "files": files}
    test = figures["training"]["test"]
    report.line(
        f"{figures['model']} {figures['version']}, {test['pairs']} pairs of {test['name']}, split {test['split']}"
    )
    report.line(f"float32     {_scores(test)}")
    if args.int8:
        report.line(f"int8        {_scores(figures['int8'])}")
    report.line(f"parity      {figures['parity']['largest_px']:.1e} px at most between torch and the file")
    report.line("written " + ", ".join(map(str, files)))
    if args.triton:
        _serve(report, str(args.int8 or args.out), args.triton)
    return report


def _scores(scores: dict[str, Any]) -> str:
    found = scores["all"]
    if not found["valid"]:
        return "no pixel answered"
    shares = ", ".join(f"{100 * found[f'kpe_{limit}']:.2f} % over {limit} px" for limit in (1, 3))
    return f"EPE {found['epe_px']:.4f} px; {shares}"


def _serve(report: Report, model: str, repository: Path) -> Report:
    from endosdk.runtime.triton import write_repository

    written = report.record["triton"] = write_repository(model, repository)
    report.line(f"written {written}")
    return report
