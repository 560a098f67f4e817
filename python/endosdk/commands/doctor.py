"""``endosdk doctor``: what is installed, what is missing, what would be used."""

from __future__ import annotations

import argparse
import importlib.metadata
from pathlib import Path

OPTIONAL = {
    "torch": "train",
    "onnx": "train",
    "moderngl": "simulate",
    "matplotlib": "viz",
}


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--pair", nargs=2, type=Path, metavar=("LEFT", "RIGHT"), help="also check that a pair is rectified"
    )


def run(args: argparse.Namespace) -> int:
    """Print the report; exit status 1 when something that every user needs does not work."""
    healthy = _report_runtime() and _report_models()
    if args.pair:
        healthy = _report_pair(*args.pair) and healthy
    print("all well" if healthy else "not ready: see the lines marked PROBLEM")
    return 0 if healthy else 1


def _report_runtime() -> bool:
    from endosdk import _core
    from endosdk.errors import EndoError
    from endosdk.jobs.machine import machine_record
    from endosdk.runtime import telemetry
    from endosdk.runtime.session import load_runtime

    record = machine_record()
    print(f"endosdk      {_core.version}, kernels {_core.isa()}, {_core.threads()} threads")
    integers = "yes" if _core.has_integer_units() else "no: shipped 8-bit models give way to float32 ones"
    print(f"8-bit units  {integers}")
    print(f"machine      {record['cpu']}, {record['os']}, Python {record['versions']['python']}")
    for package, extra in OPTIONAL.items():
        try:
            print(f"{package:12} {importlib.metadata.version(package)}")
        except importlib.metadata.PackageNotFoundError:
            print(f"{package:12} not installed (pip install 'endosdk[{extra}]')")
    try:
        runtime = load_runtime()
    except EndoError as error:
        print(f"onnxruntime  PROBLEM {error}")
        return False
    telemetry_state = "PROBLEM on" if telemetry.started_by_host() else "off"
    print(f"onnxruntime  {runtime.__version__}, telemetry {telemetry_state}")
    print(f"providers    {', '.join(runtime.get_available_providers())}")
    return not telemetry.started_by_host()


def _report_models() -> bool:
    from endosdk.errors import EndoError
    from endosdk.runtime.models import read_model, shipped_models
    from endosdk.runtime.session import StereoSession

    healthy = True
    for name in shipped_models():
        try:
            info = StereoSession(read_model(name)).info
        except EndoError as error:
            print(f"model        {name}: PROBLEM {error}")
            healthy = False
        else:
            print(f"model        {name} {info.version}, up to {info.max_disparity} px, sha256 {info.sha256[:12]}")
    return healthy


def _report_pair(left: Path, right: Path) -> bool:
    from endosdk.commands.predict import VERTICAL_DISPARITY_LIMIT
    from endosdk.evaluation.vertical_disparity import vertical_disparity
    from endosdk.io.pictures import read_frame

    offset = vertical_disparity(read_frame(left), read_frame(right))
    if offset.median_px is None:
        print(f"pair         too few matches to judge ({offset.matches})")
        return True
    rectified = offset.median_px <= VERTICAL_DISPARITY_LIMIT
    verdict = "rectified" if rectified else "PROBLEM not rectified"
    print(f"pair         rows differ by {offset.median_px:.2f} px (median of {offset.matches} matches): {verdict}")
    return rectified
