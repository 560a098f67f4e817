"""``endosdk bench`` (``endosdk-bench``): frames a second, latency and error of a model on this machine."""

from __future__ import annotations

import argparse
from pathlib import Path


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("--model", default="fast", help="shipped name or .onnx file (default: %(default)s)")
    parser.add_argument("--size", default="960x720", help="size of the camera frames (default: %(default)s)")
    parser.add_argument(
        "--network-size",
        metavar="WxH",
        help="size the network works at (default: what the model is made for)",
    )
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=300, help="frames timed (default: %(default)s)")
    parser.add_argument("--warmup", type=int, default=20, help="frames before the clock starts (default: %(default)s)")
    parser.add_argument("--provider", default="cpu", help="cpu, cuda, tensorrt (default: %(default)s)")
    parser.add_argument(
        "--against",
        choices=["sgbm", "none"],
        default="sgbm",
        help="a rival timed in turns on the same frames (default: %(default)s)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures as JSON")


def run(args: argparse.Namespace) -> int:
    """Run the benchmark and print a short table."""
    from endosdk.commands.sizes import parse_size
    from endosdk.io.whole_files import write_json
    from endosdk.jobs.bench import BenchSettings, run_benchmark

    settings = BenchSettings(
        model=args.model,
        size=parse_size(args.size),
        network_size=parse_size(args.network_size) if args.network_size else None,
        threads=args.threads,
        frames=args.frames,
        warmup=args.warmup,
        provider=args.provider,
        against=None if args.against == "none" else args.against,
    )
    record = run_benchmark(settings)
    latency, stages = record["latency_ms"], record["stages_ms"]
    print(f"model      {record['model']['name']} {record['model']['version']}, {args.size}, {args.threads} threads")
    print(f"error      {record['epe_px']:.3f} px against the truth of the rendered pairs")
    print(f"speed      {record['fps']:.2f} FPS")
    print(f"stream     {record['stream_fps']:.2f} FPS, {args.threads} frames in flight")
    print(f"start-up   {record['startup_s']:.2f} s from the import to the first answer")
    print("latency    " + ", ".join(f"{name} {value:.2f}" for name, value in latency.items()) + " ms")
    print("stages     " + ", ".join(f"{name} {value:.2f}" for name, value in stages.items()) + " ms")
    print(f"memory     {record['peak_rss_mb']:.0f} MB at most")
    for name, rival in record["against"].items():
        ratio = record["fps"] / rival["fps"]
        print(f"{name:10} {rival['fps']:.2f} FPS (we: {ratio:.2f} times), {rival['epe_px']:.3f} px with holes filled")
    if args.json:
        write_json(args.json, record, "json")
        print(f"written    {args.json}")
    return 0
