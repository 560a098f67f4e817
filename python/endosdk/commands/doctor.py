"""``endosdk doctor``: what is installed, what is missing, what would be used."""

from __future__ import annotations

import argparse
import importlib.metadata
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import add_calibration
from endosdk.commands.report import Report

if TYPE_CHECKING:
    from endosdk.io.overview import Picture

OPTIONAL = ("torch", "onnx", "moderngl", "matplotlib", "ray")
OPENCV = tuple(f"opencv{contrib}-python{headless}" for contrib in ("", "-contrib") for headless in ("", "-headless"))


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--pair",
        nargs=2,
        type=Path,
        metavar=("LEFT", "RIGHT"),
        help="also check that the rows of a pair correspond, after rectification where there is a --calibration"
        " (default: none)",
    )
    add_calibration(parser)


def run(args: argparse.Namespace) -> int:
    """Print the report; exit status 1 when something that every user needs does not work."""
    report = Report(args)
    problems = _packages(report) + _runtime(report)
    if not problems:
        problems += _models(report)
    if args.pair:
        problems += _pair(report, args.pair, args.calibration)
    for problem in problems:
        report.line(f"PROBLEM      {problem}")
    report.line("not ready" if problems else "all well")
    report.record["problems"] = problems
    return report.end(usable=not problems)


def _packages(report: Report) -> list[str]:
    """Say what there is beside the run time, and which packages overwrite each other."""
    from endosdk import _core
    from endosdk.errors import extra_of, install_command
    from endosdk.jobs.machine import machine_record

    record = machine_record()
    integers = _core.has_integer_units()
    report.record |= {"machine": record, "kernels": _core.isa(), "integer_units": integers, "packages": {}}
    report.line(f"endosdk      {_core.version}, kernels {_core.isa()}, {_core.threads()} threads")
    report.line(f"8-bit units  {'yes' if integers else 'no: shipped 8-bit models give way to their float32 models'}")
    report.line(f"machine      {record['cpu']}, {record['os']}, Python {record['versions']['python']}")
    for package in OPTIONAL:
        found = report.record["packages"][package] = _version(package)
        missing = f"not installed ({install_command(extra_of(package) or package)})"
        report.line(f"{package:12} {found or missing}")
    several = [package for package in OPENCV if _version(package)]
    report.line(f"opencv       {', '.join(f'{package} {_version(package)}' for package in several) or 'not installed'}")
    if len(several) < 2:
        return []
    mended = f"python -m pip uninstall {' '.join(several)} && python -m pip install opencv-python-headless"
    return [f"{' and '.join(several)} overwrite each other's files; keep one: {mended}"]


def _version(package: str) -> str | None:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return None


def _runtime(report: Report) -> list[str]:
    from endosdk.errors import EndoError
    from endosdk.runtime import telemetry
    from endosdk.runtime.session import load_runtime

    try:
        runtime = load_runtime()
    except EndoError as error:
        return [str(error)]
    on = telemetry.started_by_host()
    providers = runtime.get_available_providers()
    report.record["onnxruntime"] = {"version": runtime.__version__, "telemetry": on, "providers": providers}
    report.line(f"onnxruntime  {runtime.__version__}, telemetry {'on' if on else 'off'}")
    report.line(f"providers    {', '.join(providers)}")
    rule = f"onnxruntime was imported first, with its telemetry on: set {telemetry.VARIABLE}=1 in the environment"
    return [rule] if on else []


def _models(report: Report) -> list[str]:
    from endosdk.errors import EndoError
    from endosdk.runtime.models import read_model, shipped_models
    from endosdk.runtime.session import StereoSession

    problems = []
    report.record["models"] = {}
    for name in shipped_models():
        try:
            info = StereoSession(read_model(name)).info
        except EndoError as error:
            problems.append(f"{name}: {error}")
        else:
            report.record["models"][name] = {"version": info.version, "sha256": info.sha256}
            report.line(f"model        {name} {info.version}, up to {info.max_disparity} px, sha256 {info.sha256[:12]}")
    return problems


def _pair(report: Report, pair: list[Path], calibration: Path | None) -> list[str]:
    """Say whether the rows of a pair correspond; raw pairs are rectified first by their calibration."""
    from endosdk.commands.predict import VERTICAL_DISPARITY_LIMIT
    from endosdk.evaluation.vertical_disparity import vertical_disparity
    from endosdk.io.pictures import read_frame

    views = read_frame(pair[0]), read_frame(pair[1])
    if calibration is not None:
        views = _rectified(views, calibration)
    offset = vertical_disparity(*views)
    report.record["pair"] = {"vertical_disparity_px": offset.median_px, "matches": offset.matches}
    if offset.median_px is None:
        report.line(f"pair         too few matches to judge ({offset.matches})")
        return []
    differ = f"rows differ by {offset.median_px:.2f} px (median of {offset.matches} matches)"
    report.line(f"pair         {differ}")
    if offset.median_px <= VERTICAL_DISPARITY_LIMIT:
        return []
    if calibration is None:
        return [f"the pair is not rectified: {differ}; for a raw pair give its --calibration"]
    return [f"the calibration does not fit the pair: {differ} after rectification"]


def _rectified(views: tuple[Picture, Picture], calibration: Path) -> tuple[Picture, Picture]:
    from endosdk import DepthEstimator, StereoCalibration

    return DepthEstimator("fast", calibration=StereoCalibration.load(calibration)).rectify(*views)
