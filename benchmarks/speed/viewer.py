"""What `endosdk view` costs: frames a second of the depth path with a page that looks on and without, in turns.

    python -m benchmarks.speed.viewer --json benchmarks/results/speed/viewer.json

The demonstration pair comes again and again, without waiting. The page is a process of its own that takes every message
and says that it has drawn it, as a browser does; what a browser needs for drawing is not counted. Before a time counts,
the answers must equal those of `predict`, and the page must have got pictures. It needs a quiet machine.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import numpy as np

from benchmarks.record import write_record
from endosdk import DepthEstimator, StereoCalibration
from endosdk.io.pictures import read_frame
from endosdk.live.frames import Frame, Picture
from endosdk.live.sources.source import Source
from endosdk.live.viewer import Player, Server
from endosdk.live.viewer.player import Shown

DATA = Path(__file__).parents[2] / "examples" / "data"
ROUNDS = 5
WARM_S, MEASURED_S = 2.0, 6.0
LIMIT = 0.10  # of the frame rate
PAGE = """
import asyncio, sys, aiohttp
async def look(address):
    origin = {"Origin": address.rsplit("/", 2)[0]}
    async with aiohttp.ClientSession() as session:
        page, pictures = await session.ws_connect(address + "live", headers=origin, max_msg_size=0), 0
        async for message in page:
            if message.type == aiohttp.WSMsgType.BINARY:
                pictures += 1
                await page.send_str("drawn")
        print(pictures)
asyncio.run(look(sys.argv[1]))
"""


class Again(Source):
    """One pair, time and again; its clock does not hold the player up."""

    def __init__(self, pair: tuple[Picture, Picture]) -> None:
        super().__init__("demonstration pair")
        self._pair = pair

    def _read(self, start: int) -> Iterator[Frame]:
        for number in count(start):
            yield Frame(*self._pair, number, number)


def rate(estimator: DepthEstimator, pair: tuple[Picture, Picture], viewed: bool) -> tuple[float, np.ndarray, int]:
    """Return frames a second, the last disparity and how many pictures the page got."""
    player = Player(estimator, Again(pair))
    done: list[float] = []
    last: list[Shown] = []

    def note(shown: Shown) -> None:
        done.append(time.perf_counter())
        last[:] = [shown]

    player.listeners.append(note)
    server = Server(player) if viewed else None
    page = None
    if server is None:
        player.start()
    else:
        page = subprocess.Popen([sys.executable, "-c", PAGE, server.address], stdout=subprocess.PIPE, text=True)
    while not done:  # the page starts the player
        time.sleep(0.01)
    time.sleep(WARM_S)
    begin = time.perf_counter()
    time.sleep(MEASURED_S)
    end = time.perf_counter()
    if server is not None:
        server.close()
    player.close()
    pictures = 0 if page is None else int(page.communicate(timeout=20)[0])
    return sum(begin <= at < end for at in done) / (end - begin), last[0].result.disparity, pictures


def main() -> None:
    """Measure and write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", default="fast")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    pair = read_frame(DATA / "demo" / "left.png"), read_frame(DATA / "demo" / "right.png")
    rig = StereoCalibration.load(DATA / "rig.json")
    estimator = DepthEstimator(args.model, calibration=rig, threads=args.threads)
    expected = estimator.predict(*pair).disparity.copy()
    rates: dict[bool, list[float]] = {False: [], True: []}
    pictures = 0
    for turn in range(2 * ROUNDS):
        viewed = turn % 2 == 1
        found, disparity, got = rate(estimator, pair, viewed)
        if not np.array_equal(disparity, expected):
            raise SystemExit("the answers of the player are not those of predict")
        if viewed and not got:
            raise SystemExit("the page got no picture")
        rates[viewed].append(found)
        pictures += got
    plain, viewed_rate = (float(np.median(rates[on])) for on in (False, True))
    record = {
        "frames_per_second": {"without_a_page": round(plain, 2), "with_a_page": round(viewed_rate, 2)},
        "slowed_by": round(1 - viewed_rate / plain, 4),
        "allowed": LIMIT,
        "pictures_a_second": round(pictures / ROUNDS / (WARM_S + MEASURED_S), 2),
    }
    command = f"python -m benchmarks.speed.viewer --model {args.model} --threads {args.threads}"
    write_record(args.json, record, command=command, hashes={"model_sha256": estimator.model.sha256})
    print(record)


if __name__ == "__main__":
    main()
