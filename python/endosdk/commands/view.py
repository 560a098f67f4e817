"""``endosdk view``: a page in the browser that shows depth as it is computed, and measures in it."""

from __future__ import annotations

import argparse
import json
import sys
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from endosdk.commands.options import add_estimator, made_estimator
from endosdk.commands.sources import add_source, add_temporal, opened_source

if TYPE_CHECKING:
    from endosdk.live.viewer import Player
    from endosdk.live.viewer.player import Shown


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.epilog = (
        "This command opens a socket. It listens on 127.0.0.1. Every request needs the token in the printed address."
    )
    add_source(parser)
    add_estimator(parser)
    add_temporal(parser)
    parser.add_argument("--port", type=int, default=0, help="port on 127.0.0.1 (default: a free port)")
    parser.add_argument("--open", action="store_true", help="open the page in the default browser")
    parser.add_argument("--paused", action="store_true", help="start paused")
    parser.add_argument("--recordings", type=Path, default=Path(), help="folder for recordings of the record button")
    parser.add_argument(
        "--rerun",
        type=Path,
        metavar="FILE.rrd",
        help="also write a file for the Rerun viewer; needs --calibration (default: none)",
    )


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; the status is 1 where the source failed."""
    from endosdk.errors import CalibrationRequired
    from endosdk.live.viewer import Player, Server

    if args.rerun is not None and args.calibration is None:
        raise CalibrationRequired("rerun", "needs --calibration: the file holds depth and points in mm", args.rerun)
    player = Player(made_estimator(args), opened_source(args), playing=not args.paused, temporal=args.temporal)
    if args.rerun is not None:
        player.listeners.append(rerun_writer(args.rerun, player))
    server = Server(player, port=args.port, recordings=args.recordings)
    if args.rerun is not None:
        player.start()  # the file is wanted, whether a page is open or not
    print(json.dumps({"address": server.address}) if args.json else f"open       {server.address}", flush=True)
    if args.open:
        webbrowser.open(server.address)
    told = None

    def tell() -> None:
        nonlocal told
        if player.error is not None and player.error is not told:
            told = player.error
            print(f"endosdk view: {player.problem}", file=sys.stderr, flush=True)

    try:
        while True:
            time.sleep(0.5)
            tell()
    except KeyboardInterrupt:
        pass
    finally:
        server.close()
        player.close()
    tell()
    return int(player.error is not None)


def rerun_writer(path: Path, player: Player) -> Callable[[Shown], None]:
    """Return what writes every answer into a recording of Rerun."""
    from endosdk.errors import DependencyMissing
    from endosdk.io.extras import must_install_package

    try:
        import rerun
    except ImportError as error:
        raise DependencyMissing("rerun", must_install_package("rerun-sdk"), "nothing") from error
    rerun.init("endosdk")
    rerun.save(path)

    def write(shown: Shown) -> None:
        rerun.set_time("frame", sequence=shown.frame.number)
        rerun.set_time("stamp", duration=shown.frame.stamp_ns / 1e9)
        result = shown.result
        result.to_rerun(player.left_view(shown))
        rerun.log("endosdk/camera/reasons", rerun.SegmentationImage(result.reasons))
        causes = ", ".join(f"{cause.name} {measure:.3g}" for cause, measure in result.causes.items())
        rerun.log("endosdk/status", rerun.TextLog(f"{result.status.name} {causes}".strip()))
        plots = {"frames_per_second": shown.frames_per_second, "delay_ms": shown.delay_ms}
        plots["valid_share"] = result.valid_share
        if result.rig is not None:
            plots["vertical_disparity_px"] = result.rig.vertical_disparity_px
        for name, value in plots.items():
            rerun.log(f"endosdk/plots/{name}", rerun.Scalars(value))

    return write
