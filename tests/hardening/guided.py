"""Readers under a fuzzer that is led by coverage (Atheris): a program of its own, because the fuzzer ends it.

    printf 'NAME\\tFOLDER\\tRUNS\\n' | python -m tests.hardening.guided

Each line asks for one reader. FOLDER/inputs holds examples and receives inputs that reach new code, `LOG` says what
came of them. The answer is the exit status: anything but an answer or a typed error makes it other than 0. What leads
the fuzzer is imported and instrumented once. Each reader then has a process of its own, a copy of this one.
"""

from __future__ import annotations

import atexit
import gc
import os
import signal
import sys
import types
import warnings
from pathlib import Path

import atheris

from endosdk.errors import EndoError
from tests.hardening.targets import TARGETS

WATCHED = ("endosdk.", "yaml.", "json.", "xml.")  # modules whose code leads the fuzzer
LOG = "fuzzer.log"


def watch() -> None:
    """Count the branches of what was imported; an editable package's importer leaves no other way."""
    for function in gc.get_objects():
        if isinstance(function, types.FunctionType) and f"{function.__module__}.".startswith(WATCHED):
            atheris.instrument_func(function)


def fuzz(name: str, folder: Path, runs: int) -> None:
    """Try inputs; ends the process."""
    log = os.open(folder / LOG, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    target = TARGETS[name]
    warnings.simplefilter("ignore")

    def one(data: bytes) -> None:
        try:
            target.try_bytes(data)
        except EndoError as error:
            assert error.code.name in str(error)

    # The fuzzer watches for time limits by an alarm. At the end, Python no longer has a handler for it.
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0)
    limits = ["-timeout=20", "-rss_limit_mb=4096", "-max_len=16384", "-seed=1", f"-artifact_prefix={folder}/"]
    atheris.Setup([sys.argv[0], str(folder / "inputs"), f"-atheris_runs={runs}", *limits], one)
    atheris.Fuzz()


def main() -> None:
    """Answer lines until there are no more."""
    watch()
    for line in sys.stdin:
        name, folder, runs = line.rstrip("\n").split("\t")
        child = os.fork()
        if child == 0:
            fuzz(name, Path(folder), int(runs))
        print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)


if __name__ == "__main__":
    main()
