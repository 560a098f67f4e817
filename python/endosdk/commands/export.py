"""``endosdk export``: turn a training run into a model file, and prove that both compute the same."""

from __future__ import annotations

import argparse
import json
from pathlib import Path


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("run", help="run folder or checkpoint; with --triton alone a shipped name or .onnx file")
    parser.add_argument("--out", type=Path, help="the .onnx file to write")
    parser.add_argument("--name", help="name under which the model is loaded (default: that of the network)")
    parser.add_argument("--model-version", default="1", help="version of the weights (default: %(default)s)")
    parser.add_argument(
        "--data",
        type=Path,
        metavar="DIR",
        help="score the model on its test split, where parity frames come from too (default: the data of the run)",
    )
    parser.add_argument(
        "--int8",
        type=Path,
        metavar="FILE",
        help="write the form in 8-bit integers too, named for its file; ranges come from the data of the run",
    )
    parser.add_argument(
        "--answer-cell",
        type=int,
        metavar="N",
        help="give one answer for N x N of the network's, their mean; the SDK then draws edges by the left view"
        " (default: as it was trained)",
    )
    parser.add_argument("--weights", type=Path, metavar="FILE", help="write the weights too, to train on from there")
    parser.add_argument(
        "--triton", type=Path, metavar="DIR", help="add the model (that of --int8, if given) to a Triton repository"
    )
    parser.add_argument("--layout", help="how the set of --data is laid out (default: endosdk)")


def run(args: argparse.Namespace) -> int:
    """Export, compare with torch, and write the figures beside the file."""
    from endosdk.errors import InvalidArgument

    if args.out is None:
        if args.triton is None:
            raise InvalidArgument("out", "must name the .onnx file to write, or --triton a repository", None)
        for name in ("int8", "weights", "data", "name"):
            if getattr(args, name) is not None:
                raise InvalidArgument(name, "is for a training run that is exported; give --out", getattr(args, name))
        _serve(args.run, args.triton)
        return 0
    from endosdk.training import checkpoint
    from endosdk.training.release import release

    for name, ending in (("out", ".onnx"), ("int8", ".onnx"), ("weights", ".safetensors")):
        file = getattr(args, name)
        if file is not None and file.suffix != ending:
            raise InvalidArgument(name, f"must be a file that ends in {ending}", file)
    if args.layout is not None and args.data is None:
        raise InvalidArgument("layout", "is that of --data; give both", args.layout)
    trained = checkpoint.load(Path(args.run))
    report = release(
        trained,
        args.out,
        name=args.name,
        version=args.model_version,
        data=args.data,
        layout=args.layout or "endosdk",
        int8=args.int8,
        answer_cell=args.answer_cell,
    )
    if args.weights:
        checkpoint.save_weights(args.weights, trained)
    print(json.dumps(report, indent=1))
    print("written " + ", ".join(str(file) for file in (args.out, args.int8, args.weights) if file))
    if args.triton:
        _serve(str(args.int8 or args.out), args.triton)
    return 0


def _serve(model: str, repository: Path) -> None:
    from endosdk.io.triton import write_repository

    print(f"written {write_repository(model, repository)}")
