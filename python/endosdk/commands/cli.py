"""The command line: ``endosdk <verb>`` finds the verb's file in `endosdk.commands` and runs it."""

from __future__ import annotations

import argparse
import importlib
import json
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from endosdk import __version__
from endosdk.commands.interrupts import interrupts_heard
from endosdk.commands.options import Parser
from endosdk.errors import DependencyMissing, EndoError

VERBS = {
    "predict": "compute disparity and depth of one stereo pair, as files and a picture",
    "batch": "compute disparity and depth of every pair of an archive, on one machine or a Ray cluster",
    "view": "show depth of a video or camera live in the browser, and measure in it",
    "run": "record depth of a whole video or camera: lossless maps, a preview, one line for each frame",
    "replay": "write the frames and maps of a recording as files or as a ROS bag",
    "bench": "time a model on this machine, check its error, and time another method beside it",
    "evaluate": "score a model on a data set with truth",
    "calibrate": "calibrate a rig from pictures of a board, convert a calibration file, or check a rig by tissue",
    "doctor": "check this machine; with a rig or a pair, check that too",
    "simulate": "render endoscopic stereo pairs with exact truth",
    "train": "train a network on a data set",
    "export": "turn a trained network into a model file",
}
EXIT_STATUS = (
    "Exit status: 0 when the result can be used, 1 when it cannot or the verb found a fault, 2 for bad input or a "
    "missing dependency."
)
COMPLETION = "--print-completion"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``endosdk``; the exit status is 0, 1 (the result cannot be used) or 2 (bad input).

    Like a program that a signal has ended it is 130 after Ctrl-C, and 141 when nobody reads the output any more.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if COMPLETION in words:
        verbs: Iterable[str] = VERBS
    else:  # only the verb that runs is imported
        verbs = [word for word in words if not word.startswith("-")][:1]
    options = build_parser(verbs).parse_args(words)
    try:
        with interrupts_heard():
            status = int(importlib.import_module(f"endosdk.commands.{options.verb}").run(options))
        sys.stdout.flush()  # here, where a reader that has gone away is still an exception to catch
        return status
    except EndoError as error:
        return _refuse(options, error)
    except ModuleNotFoundError as error:
        missing = DependencyMissing.of(error)
        if missing is None:
            raise
        return _refuse(options, missing)
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


def build_parser(configured: Iterable[str]) -> Parser:
    """Return the parser; the verbs in ``configured`` know their arguments, the others only their names."""
    parser = Parser(prog="endosdk", description="Stereo depth for binocular endoscopes.", epilog=EXIT_STATUS)
    parser.add_argument("--version", action="version", version=f"endosdk {__version__}")
    parser.add_argument(
        COMPLETION,
        action=_PrintCompletion,
        metavar="SHELL",
        help="print the completion script of a shell (bash, zsh or tcsh): source it, or put it where the shell looks",
    )
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name, summary in VERBS.items():
        verb = verbs.add_parser(name, help=summary, description=summary)
        if name in configured:
            importlib.import_module(f"endosdk.commands.{name}").configure(verb)
            for leaf in _leaves(verb):
                leaf.epilog = f"{leaf.epilog} {EXIT_STATUS}" if leaf.epilog else EXIT_STATUS
                leaf.add_argument("--json", action="store_true", help="print one JSON document instead of lines")
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


def _refuse(options: argparse.Namespace, error: EndoError) -> int:
    """Say what is wrong, to people on stderr and with --json to programs on stdout."""
    print(f"endosdk {options.verb}: {error}", file=sys.stderr)
    if options.json:
        said = {"code": error.code.name, "argument": error.argument, "rule": error.rule, "value": str(error.value)}
        print(json.dumps({"error": said}))
    return 2
