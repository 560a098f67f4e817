"""``endosdk bench`` (``endosdk-bench``): frames a second, latency and error of a model on this machine."""

from __future__ import annotations

import argparse
from pathlib import Path

from endosdk.commands.options import add_model, add_session, parse_size, session_options
from endosdk.commands.report import Report


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add_model(parser)
    parser.add_argument("--size", metavar="WxH", default="960x720", help="size of the camera frames")
    add_session(parser, threads=2)
    parser.add_argument("--frames", type=int, default=300, help="timed frames, at least 25 per thread")
    parser.add_argument("--warmup", type=int, default=20, help="warm-up frames, not timed")
    parser.add_argument("--load", type=int, default=0, help="number of busy processes that run in parallel")
    parser.add_argument(
        "--against",
        choices=["sgbm", "none"],
        default="sgbm",
        help="reference method, timed alternately on the same frames",
    )
    parser.add_argument("--out", type=Path, metavar="FILE", help="write results to this JSON file (default: none)")


def run(args: argparse.Namespace) -> int:
    """Run the benchmark and print a short table."""
    from endosdk.io.whole_files import write_json
    from endosdk.jobs.bench import BenchSettings, run_benchmark

    settings = BenchSettings(
        model=args.model,
        size=parse_size(args.size),
        frames=args.frames,
        warmup=args.warmup,
        load=args.load,
        against=None if args.against == "none" else args.against,
        **session_options(args),
    )
    report = Report(args)
    report.record = record = run_benchmark(settings)
    latency, stages = record["latency_ms"], record["stages_ms"]
    report.line(
        f"model      {record['model']['name']} {record['model']['version']}, {args.size}, {args.threads} threads"
    )
    report.line(f"error      {record['epe_px']:.3f} px against the ground truth of the rendered pairs")
    report.line(f"speed      {record['fps']:.2f} FPS")
    report.line(f"stream     {record['stream_fps']:.2f} FPS, {args.threads} frames in flight")
    report.line(f"start-up   {record['startup_s']:.2f} s from the import to the first result")
    report.line("latency    " + ", ".join(f"{name} {value:.2f}" for name, value in latency.items()) + " ms")
    report.line("stages     " + ", ".join(f"{name} {value:.2f}" for name, value in stages.items()) + " ms")
    if record["peak_rss_mb"] is not None:
        report.line(f"memory     {record['peak_rss_mb']:.0f} MB at most")
    for name, other in record["against"].items():
        times = f"{other['fps']:.2f} FPS (this model: {record['fps'] / other['fps']:.2f} times)"
        report.line(f"{name:10} {times}, {other['epe_px']:.3f} px with holes filled")
    if args.out:
        write_json(args.out, record, "out")
        report.line(f"written    {args.out}")
    return report.end()
