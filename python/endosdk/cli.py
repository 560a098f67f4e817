"""The command line: ``endosdk <verb>`` finds the verb's file in `endosdk.commands` and runs it."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence

from endosdk import __version__
from endosdk.errors import EndoError

VERBS = {
    "predict": "disparity and depth of one stereo pair, as files and a picture",
    "batch": "disparity and depth of every pair of an archive, on one machine or a Ray cluster",
    "view": "show depth of a video or camera in the browser as it is computed, and measure in it",
    "run": "record depth of a whole video: lossless maps, a preview, a line on every frame",
    "replay": "give back the frames and maps of a recording, as files or as a ROS bag",
    "bench": "time a model on this machine, with its error and a rival beside it",
    "evaluate": "score a model on a data set with truth",
    "calibrate": "calibrate a rig from board pictures, or convert a calibration file",
    "doctor": "say what is installed, what is missing and what would be used",
    "simulate": "render endoscopic stereo pairs with exact truth",
    "train": "train a network on a data set",
    "export": "turn a trained network into a model file",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``endosdk``; the exit status is 0, 1 (the verb found a fault) or 2 (bad input).

    Like a program that a signal has ended it is 130 after Ctrl-C, and 141 when nobody reads the output any more.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    verb = next((word for word in words if not word.startswith("-")), None)
    parser = argparse.ArgumentParser(prog="endosdk", description="Stereo depth for binocular endoscopes.")
    parser.add_argument("--version", action="version", version=f"endosdk {__version__}")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name, summary in VERBS.items():
        sub = verbs.add_parser(name, help=summary, description=summary)
        if name == verb:  # only the verb that runs is imported
            importlib.import_module(f"endosdk.commands.{name}").configure(sub)
    options = parser.parse_args(words)
    try:
        status = int(importlib.import_module(f"endosdk.commands.{options.verb}").run(options))
        sys.stdout.flush()  # here, where a reader that has gone away is still an exception to catch
        return status
    except EndoError as error:
        print(f"endosdk {options.verb}: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as interrupt:  # a verb that can go on says how
        print(f"endosdk {options.verb}: {interrupt.args[0] if interrupt.args else 'interrupted'}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # Whoever read our output has enough. What is still in the buffer goes nowhere when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141


def bench() -> int:
    """Run ``endosdk-bench``, the short name of ``endosdk bench``."""
    return main(["bench", *sys.argv[1:]])
