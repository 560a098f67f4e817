"""One reader under a fuzzer that is led by coverage (Atheris): a program of its own, because the fuzzer ends it.

    python -m tests.hardening.guided NAME FOLDER RUNS

FOLDER holds examples and receives inputs that reach new code. Anything but an answer or a typed error ends it with a
status that is not 0.
"""

from __future__ import annotations

import atexit
import gc
import signal
import sys
import types
import warnings

import atheris

from endosdk.errors import EndoError
from tests.hardening.targets import TARGETS

WATCHED = ("endosdk.", "yaml.", "json.", "xml.")  # modules whose code leads the fuzzer


def watch() -> None:
    """Count the branches of what was imported; an editable package's importer leaves no other way."""
    for function in gc.get_objects():
        if isinstance(function, types.FunctionType) and f"{function.__module__}.".startswith(WATCHED):
            atheris.instrument_func(function)


def main() -> None:
    name, folder, runs = sys.argv[1:]
    watch()
    target = TARGETS[name]
    warnings.simplefilter("ignore")

    def one(data: bytes) -> None:
        try:
            target.try_bytes(data)
        except EndoError as error:
            assert error.code.name in str(error)

    # The fuzzer watches for time limits by an alarm. At the end, Python no longer has a handler for it.
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0)
    limits = ["-timeout=20", "-rss_limit_mb=4096", "-max_len=16384", "-seed=1"]
    atheris.Setup([sys.argv[0], folder, f"-atheris_runs={runs}", *limits], one)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
