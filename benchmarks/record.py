"""Benchmarks write their numbers here: with the command, the machine and the hashes of the model files behind them."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from endosdk.io.whole_files import write_json
from endosdk.jobs.machine import machine_record

Hashes = Mapping[str, str | Mapping[str, str]]  # by the key that they have in the record: one, or one by each name

NO_MODEL: Hashes = {"model_sha256": {}}  # of numbers that no model file stands behind
SHA256 = re.compile(r"[0-9a-f]{64}")


def write_record(path: Path, found: Mapping[str, Any], *, command: str, hashes: Hashes) -> None:
    """Write what one run found, whole or not at all. Raises as `signed` does."""
    write_json(path, signed(found, command=command, hashes=hashes))


def write_part(path: Path, part: str, found: Mapping[str, Any], *, command: str, hashes: Hashes) -> None:
    """Write one part of a record whose parts are measured apart; the others stay. Raises as `signed` does."""
    others = json.loads(path.read_text()) if path.is_file() else {}
    write_json(path, {**others, part: signed(found, command=command, hashes=hashes)})


def as_given(words: Iterable[str]) -> str:
    """Return arguments for a command that is recorded, ``NAME=FILE`` among them: files without their folders."""
    parts = (word.rpartition("=") for word in words)
    return shlex.join(f"{name}{equals}{Path(file).name}" for name, equals, file in parts)


def signed(found: Mapping[str, Any], *, command: str, hashes: Hashes) -> dict[str, Any]:
    """Return what was found, with the command, the machine and the hashes of the model files measured.

    Numbers without them back no claim. Raises ValueError where one lacks; `NO_MODEL` says that no file was measured.
    """
    if not command.startswith("python -m benchmarks."):
        raise ValueError(f"no command of a benchmark: {command!r}")
    if not hashes:
        raise ValueError("no hashes of the model files measured")
    for key, value in hashes.items():
        for sha256 in [value] if isinstance(value, str) else value.values():
            if not SHA256.fullmatch(sha256):
                raise ValueError(f"{key}: no SHA-256 of a file: {sha256!r}")
    signature = {"command": command, **hashes, "machine": machine_record()}
    return {**signature, **found, **signature}  # it stands first, and in place of what a record of before had
