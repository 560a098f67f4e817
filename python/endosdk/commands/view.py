"""``endosdk view``: a page in the browser that shows depth as it is computed, and measures in it."""

from __future__ import annotations

import argparse
import json
import time
import webbrowser
from pathlib import Path

from endosdk.commands.sources import add_estimator, add_source, made_estimator, opened_source


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.epilog = (
        "This is the one verb that opens a socket: on the loopback address alone, and only for who knows the "
        "token in the address that it prints."
    )
    add_source(parser)
    add_estimator(parser)
    parser.add_argument("--port", type=int, default=0, help="port on the loopback address (default: any that is free)")
    parser.add_argument("--open", action="store_true", help="open the page in the browser of this desktop")
    parser.add_argument("--paused", action="store_true", help="wait for play or step")
    parser.add_argument("--recordings", type=Path, default=Path(), help="folder for what the record button writes")


def run(args: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C; the status is 1 where the source failed."""
    from endosdk.live.viewer import Player, Server

    player = Player(made_estimator(args), opened_source(args), playing=not args.paused)
    server = Server(player, port=args.port, recordings=args.recordings)
    print(json.dumps({"address": server.address}) if args.json else f"open       {server.address}", flush=True)
    if args.open:
        webbrowser.open(server.address)
    try:
        while True:
            time.sleep(0.5)
    except KeyboardInterrupt:
        pass
    finally:
        server.close()
        player.close()
    if player.error is not None:
        raise player.error
    return 0
