"""The command line: ``endosdk <verb>`` finds the verb's file in `endosdk.commands` and runs it."""

from __future__ import annotations

import argparse
import errno
import importlib
import io
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from endosdk import __version__
from endosdk.commands.interrupts import interrupts_heard
from endosdk.commands.options import Parser, sentence
from endosdk.errors import EndoError, StorageFailed
from endosdk.io.extras import dependency_missing

VERBS = {
    "predict": "compute disparity and depth of one stereo pair and save them as files",
    "batch": "compute disparity and depth of all pairs in two folders, on one machine or a Ray cluster",
    "view": "show live depth of a video or camera in the browser, with measuring tools",
    "run": "record depth of a video or camera: lossless maps, a preview video, one log line per frame",
    "replay": "write the frames and maps of a recording as files or as a ROS bag",
    "bench": "measure speed and error of a model on this machine, compared with StereoSGBM",
    "evaluate": "score a model on a data set with ground truth",
    "calibrate": "print a board, calibrate from images of it, convert files, or check a rig from tissue images",
    "doctor": "check this machine, a calibration or a stereo pair",
    "simulate": "render endoscopic stereo pairs with exact ground truth",
    "train": "train a network on a data set",
    "export": "export a trained network as a model file",
}
# One call of each command, shown at the end of its help.
EXAMPLES = {
    "predict": "endosdk predict left.png right.png --calibration rig.json --out out",
    "batch": "endosdk batch LEFT_DIR RIGHT_DIR --calibration rig.json --out maps --workers 2",
    "view": "endosdk view surgery.mp4 --calibration rig.json",
    "run": "endosdk run surgery.mp4 --calibration rig.json --out recording",
    "replay": "endosdk replay recording --out frames",
    "bench": "endosdk bench --model fast --size 960x720 --threads 2",
    "evaluate": "endosdk evaluate --model fast --data data/mix",
    "calibrate convert": "endosdk calibrate convert rig.yaml --out rig.json",
    "calibrate print": "endosdk calibrate print --pattern 14x10 --square-mm 3 --out board.png",
    "calibrate board": "endosdk calibrate board LEFT_DIR RIGHT_DIR --pattern 14x10 --square-mm 3 --out rig.json",
    "calibrate check": "endosdk calibrate check rig.json tissue.mp4",
    "calibrate refine": "endosdk calibrate refine rig.json tissue.mp4 --out new.json",
    "doctor": "endosdk doctor --pair left.png right.png --calibration rig.json",
    "simulate": "endosdk simulate --organ mix --pairs 100 --test-pairs 10 --seed 1 --out data/mix",
    "train": "endosdk train --data data/mine --init-from fast --out runs/tuned",
    "export": "endosdk export runs/tuned --out tuned.onnx --int8 tuned-int8.onnx --data data/mix",
}
EXIT_STATUS = (
    "Exit status: 0 = result usable, 1 = result not usable or fault found, 2 = bad input or missing dependency."
)
COMPLETION = "--print-completion"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``endosdk``; the exit status is 0, 1 (the result cannot be used) or 2 (bad input).

    Like a program that a signal has ended it is 130 after Ctrl-C, 143 after SIGTERM, and 141 when nobody reads the
    output any more.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # a file's name need not be UTF-8
    if COMPLETION in words:
        verbs: Iterable[str] = VERBS
    else:  # only the verb that runs is imported
        verbs = [word for word in words if not word.startswith("-")][:1]
    options = argparse.Namespace(verb="", json=False)
    with interrupts_heard() as interrupts:
        try:
            options = _parsed(build_parser(verbs), words)
            status = int(importlib.import_module(f"endosdk.commands.{options.verb}").run(options))
            _flush_output()
            return status
        except EndoError as error:
            return _refuse(options, error)
        except ModuleNotFoundError as error:
            missing = dependency_missing(error)
            if missing is None:
                raise
            return _refuse(options, missing)
        except KeyboardInterrupt as interrupt:  # a verb that can go on says how
            said = interrupt.args[0] if interrupt.args else "interrupted"
            print(f"{_name(options)}: {said}", file=sys.stderr)
            return interrupts.status
        except BrokenPipeError:
            _drop_output()  # whoever read it has enough
            return 141
        except OSError as error:
            return _refuse(options, _named(error))


def _parsed(parser: Parser, words: list[str]) -> argparse.Namespace:
    """Return the arguments; a help or a completion is printed, and ends the program."""
    try:
        return parser.parse_args(words)
    except SystemExit:
        _flush_output()
        raise


def _flush_output() -> None:
    """Write what is left now, where a reader that has gone away is still an exception to catch."""
    if sys.stdout is not None:  # None where the caller closed it
        sys.stdout.flush()


def _drop_output() -> None:
    """Let what is still in the buffer go nowhere when the interpreter ends."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def bench() -> int:
    """Run ``endosdk-bench``, the short name of ``endosdk bench``."""
    return main(["bench", *sys.argv[1:]])


def build_parser(configured: Iterable[str]) -> Parser:
    """Return the parser; the verbs in ``configured`` know their arguments, the others only their names."""
    parser = Parser(prog="endosdk", description="Stereo depth for binocular endoscopes.", epilog=EXIT_STATUS)
    parser.add_argument("--version", action="version", version=f"endosdk {__version__}")
    parser.add_argument(
        COMPLETION,
        action=_PrintCompletion,
        metavar="SHELL",
        help="print a shell completion script for bash, zsh or tcsh; source it in your shell",
    )
    verbs = parser.add_subparsers(dest="verb", metavar="COMMAND", required=True)
    for name, summary in VERBS.items():
        verb = verbs.add_parser(name, help=summary, description=sentence(summary))
        if name in configured:
            importlib.import_module(f"endosdk.commands.{name}").configure(verb)
            for leaf in _leaves(verb):
                example = f"Example:\n  {EXAMPLES[leaf.prog.removeprefix('endosdk ')]}"
                leaf.epilog = "\n\n".join(filter(None, [leaf.epilog, example, EXIT_STATUS]))
                leaf.add_argument("--json", action="store_true", help="print JSON instead of text")
    return parser


def _leaves(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield the parsers that take the last words: the verb's own, or those of its sources."""
    below = [action.choices for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not below:
        yield parser
    for choices in below:
        for one in choices.values():
            yield from _leaves(one)


class _PrintCompletion(argparse.Action):
    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option_string: Any = None) -> None:
        import shtab

        if values not in shtab.SUPPORTED_SHELLS:
            parser.error(f"{COMPLETION}: must be one of {', '.join(shtab.SUPPORTED_SHELLS)}; got {values}")
        print(shtab.complete(parser, values))
        parser.exit()


def _named(error: OSError) -> StorageFailed:
    """Name what the system refused and no command has named, be it to write the output."""
    unwritable = error.errno == errno.ENOSPC  # where output is not buffered, nothing of it is left to flush
    try:
        _flush_output()
    except OSError:
        unwritable = True
    if unwritable:
        _drop_output()
        return StorageFailed("output", "must be writable", error.strerror)
    return StorageFailed("", f"the system refused a file, a folder or a connection: {error}", error)


def _name(options: argparse.Namespace) -> str:
    return f"endosdk {options.verb}".strip()


def _refuse(options: argparse.Namespace, error: EndoError) -> int:
    """Say what is wrong, to people on stderr and with --json to programs on stdout."""
    print(f"{_name(options)}: {error}", file=sys.stderr)
    if options.json:
        said = {"code": error.code.name, "argument": error.argument, "rule": error.rule, "value": str(error.value)}
        print(json.dumps({"error": said}))
    return 2
