"""``endosdk replay``: the very frames of a recording, as pictures, or all of it as one file for other programs."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from endosdk.commands.report import Report

if TYPE_CHECKING:
    from endosdk.live.recording.recording import Recording

RECTIFIED = "left_rectified"  # folder of the pictures that the depth lies over


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.add_argument("recording", type=Path, help="folder or FILE.mkv that endosdk run wrote")
    parser.add_argument(
        "--out",
        type=Path,
        required=True,
        help="folder for images of both views and depth, or FILE.mkv, FILE.mcap, FILE.bag (ROS 1), FOLDER.ros2",
    )


def run(args: argparse.Namespace) -> int:
    """Write the files."""
    from endosdk.errors import InvalidArgument
    from endosdk.io.bounded_read import is_there
    from endosdk.io.new_folders import made_folder
    from endosdk.io.whole_files import whole_path
    from endosdk.live.recording.record import FILES, check_out, export
    from endosdk.live.recording.recording import Recording

    check_out(args.out)
    if is_there(args.out):
        raise InvalidArgument("out", "must not exist yet", args.out)
    recording = Recording(args.recording)
    made_folder(args.out.parent, "out")
    if args.out.suffix.lower() in FILES:
        export(recording, args.out)
    else:
        with whole_path(args.out, "out") as partial:
            _write_pictures(recording, partial)
    report = Report(args)
    report.record = {"out": args.out, "frames": recording.count}
    report.line(f"written    {args.out}: {recording.count} frames")
    return report.end(usable=bool(recording.count))


def _write_pictures(recording: Recording, out: Path) -> None:
    """Write PNG pictures named by the number of their frame, ``frames.jsonl``, and ``rig.json`` where there is a rig.

    Maps of 16 bits, in the steps of the recording, 0 where there is no value. They lie over ``left_rectified``, without
    a rig over ``left``.
    """
    from endosdk.io.pictures import write_picture
    from endosdk.io.whole_files import write_text
    from endosdk.live.recording.texts import LINES
    from endosdk.runtime.rectify import rectified

    name, step = recording.settings["map"]["name"], recording.settings["map"]["step"]
    rig = recording.calibration
    folders = [name, *(["left", "right"] if recording.settings["pictures"] else [])]
    if rig is not None and recording.settings["pictures"]:
        folders.append(RECTIFIED)
    for folder in folders:
        (out / folder).mkdir(parents=True, exist_ok=True)
    write_text(out / LINES, "".join(json.dumps(line) + "\n" for line in recording.lines), "out")
    if rig is not None:
        rig.save(out / "rig.json")
    for line, values in recording.maps():
        levels = np.rint(np.nan_to_num(values) / step).astype(np.uint16)
        write_picture(out / name / f"{line['number']:06d}.png", levels)
    if recording.settings["pictures"]:
        for frame in recording:
            file = f"{frame.number:06d}.png"
            write_picture(out / "left" / file, frame.left)
            write_picture(out / "right" / file, frame.right)
            if rig is not None:
                write_picture(out / RECTIFIED / file, rectified(frame.left, frame.right, rig)[0])
