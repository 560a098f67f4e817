"""``endosdk doctor``: what is installed, what is missing, what would be used."""

from __future__ import annotations

import argparse
import importlib.metadata
from pathlib import Path

from endosdk.commands.options import add_bits, add_calibration, report_nearest_depths
from endosdk.commands.pair_report import explain_pair
from endosdk.commands.report import Report

OPTIONAL = ("torch", "onnx", "moderngl", "matplotlib", "ray", "av", "aiohttp", "mcap", "rosbags")
OPENCV = tuple(f"opencv{contrib}-python{headless}" for contrib in ("", "-contrib") for headless in ("", "-headless"))


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument(
        "--pair",
        nargs=2,
        type=Path,
        metavar=("LEFT", "RIGHT"),
        help="also check a stereo pair and report its trust status and problems (default: none)",
    )
    add_bits(parser)
    add_calibration(parser, "also print the nearest depth of each model on this rig, and rectify --pair with it")


def run(args: argparse.Namespace) -> int:
    """Print the report; exit status 1 when something that every user needs does not work."""
    report = Report(args)
    problems = _packages(report) + _runtime(report)
    if not problems:
        problems += _models(report)
    if args.calibration and not problems:
        _rig(report, args.calibration)
    if args.pair and not problems:
        problems += explain_pair(report, args.pair, args.calibration, args.bits)
    for problem in problems:
        report.line(f"PROBLEM      {problem}")
    report.line(_verdict(report, problems))
    report.record["problems"] = problems
    return report.end(usable=not problems)


def _verdict(report: Report, problems: list[str]) -> str:
    if problems:
        return "not ready"
    degraded = report.record.get("pair", {}).get("status") == "DEGRADED"
    return "ready, but use this pair with care: see its causes" if degraded else "all well"


def _packages(report: Report) -> list[str]:
    """Say what there is beside the run time, and which packages overwrite each other."""
    from endosdk import _core
    from endosdk.io.extras import extra_of, install_command
    from endosdk.jobs.machine import machine_record

    record = machine_record()
    integers = _core.has_integer_units()
    report.record |= {"machine": record, "kernels": _core.isa(), "integer_units": integers, "packages": {}}
    report.line(f"endosdk      {_core.version}, kernels {_core.isa()}, {_core.threads()} threads")
    eight_bit = "supported (AVX2 or ARM dot products)" if integers else "not supported: float32 models are used instead"
    report.line(f"8-bit models {eight_bit}")
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
            limit = info.max_candidate_disparity or info.max_disparity
            width = f" at inference width {info.inference_width}" if info.inference_width else " at the network input"
            report.line(f"model        {name} {info.version}, up to {limit} px{width}, sha256 {info.sha256[:12]}")
    return problems


def _rig(report: Report, calibration: Path) -> None:
    from endosdk.calibration.rig import StereoCalibration

    report_nearest_depths(report, StereoCalibration.load(calibration))
