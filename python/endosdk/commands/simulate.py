"""``endosdk simulate``: render stereo pairs with exact truth, or check a set that was rendered."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from endosdk.simulation.recipe import Recipe

INTERRUPTED = 130  # the exit status of a program stopped by control-C


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of the command."""
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", type=Path, help="folder to write the data set to; a set begun there is continued")
    what.add_argument("--check", type=Path, metavar="DIR", help="compare a data set with its recorded hashes")
    what.add_argument("--setup-cycles", action="store_true", help="install Blender for --renderer cycles, by pip")
    parser.add_argument(
        "--recipe", metavar="NAME", help="a published set, such as endosim-gi; settles all that follows"
    )
    parser.add_argument(
        "--organ", default="mix", help="intestine, stomach, ducts, abdomen, gi (the first three) or mix (default)"
    )
    parser.add_argument("--pairs", type=int, default=100, help="training pairs, or videos (default 100)")
    parser.add_argument("--test-pairs", type=int, default=0, help="test pairs, of other seeds (default 0)")
    parser.add_argument("--seed", type=int, default=1, help="0..9999; another seed is another set (default 1)")
    parser.add_argument(
        "--renderer", default="gl", help="gl (default): OpenGL through EGL; cycles: Blender, path traced"
    )
    parser.add_argument("--rig", default="ideal", help="ideal, or raw: add distorted, misaligned views and rig.json")
    parser.add_argument("--width", type=int, default=960, help="pixels (default 960)")
    parser.add_argument("--height", type=int, default=720, help="pixels (default 720)")
    parser.add_argument("--focal", type=float, default=400.0, help="focal length in pixels (default 400)")
    parser.add_argument("--baseline", type=float, default=10.0, help="mm between the lenses (default 10)")
    parser.add_argument("--min-disparity", type=float, default=2.0, help="px, aimed at (default 2)")
    parser.add_argument("--max-disparity", type=float, default=69.5, help="px, never exceeded (default 69.5)")
    parser.add_argument(
        "--video", action="store_true", help="move along the path: every pair becomes a video of frames"
    )
    parser.add_argument("--frames", type=int, default=100, help="of each video, 25 a second (default 100)")
    parser.add_argument(
        "--shutter", type=float, default=0.0, help="video: share of the frame time it is open (default 0)"
    )
    parser.add_argument("--motion-blur", type=float, default=0.0, help="pairs: longest streak in px (default 0)")
    parser.add_argument("--chroma", action="store_true", help="one colour for four pixels, as in 4:2:0 video")
    parser.add_argument("--workers", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--ray", action="store_true", help="render on the Ray cluster of $RAY_ADDRESS, or a local one")
    parser.add_argument(
        "--cycles-python", type=Path, metavar="PATH", help="a Python that has bpy, for --renderer cycles"
    )


def run(args: argparse.Namespace) -> int:
    """Do what the arguments say; return the exit status."""
    if args.setup_cycles:
        from endosdk.simulation.cycles.environment import set_up

        print(set_up())
        return 0
    return _check(args.check) if args.check is not None else _render(args)


def _check(root: Path) -> int:
    from endosdk.dataset import verify_dataset

    count = faults = 0
    for name, fault in verify_dataset(root):
        count += 1
        if fault is not None:
            faults += 1
            print(f"{name}: {fault}")
    print(f"{count - faults} of {count} samples are as recorded")
    return 1 if faults else 0


def _render(args: argparse.Namespace) -> int:
    from endosdk.simulation.generate import generate

    recipe = _recipe(args)
    try:
        record = generate(args.out, recipe, args.workers, progress=True, cycles_python=args.cycles_python, ray=args.ray)
    except KeyboardInterrupt:
        print(f"endosdk simulate: stopped; the same command continues {args.out}", file=sys.stderr)
        return INTERRUPTED
    counts = {split: len(ids) for split, ids in record["samples"].items()}
    print(f"{args.out}: {counts['train']} training and {counts['test']} test pairs", file=sys.stderr)
    return 0


def _recipe(args: argparse.Namespace) -> Recipe:
    from endosdk.errors import InvalidArgument
    from endosdk.simulation.camera import StereoCamera
    from endosdk.simulation.effects import Effects
    from endosdk.simulation.recipe import Recipe, published
    from endosdk.simulation.sample import Limits

    if args.recipe is not None:
        return published(args.recipe).recipe
    if args.video and args.frames < 1:
        raise InvalidArgument("frames", "must be at least 1 for a video", args.frames)
    return Recipe(
        organ=args.organ,
        pairs=args.pairs,
        test_pairs=args.test_pairs,
        seed=args.seed,
        renderer=args.renderer,
        rig=args.rig,
        camera=StereoCamera(args.width, args.height, args.focal, args.baseline),
        limits=Limits(args.min_disparity, args.max_disparity),
        effects=Effects(args.motion_blur, args.shutter, args.chroma),
        frames=args.frames if args.video else 0,
    )
