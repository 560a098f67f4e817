"""A folder that a long job fills: begun once, and gone on with by the same command after any stop."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.documents import parse_json
from endosdk.io.locks import LOCK
from endosdk.io.whole_files import PARTIAL, remove_partials, write_text

LARGEST_RECORD = 1 << 28  # bytes: the errors of a million pictures that cannot be used


def claim_folder(
    folder: Path, record: str, fresh: dict[str, Any], misfit: Callable[[dict[str, Any]], str | None], rule: str
) -> dict[str, Any]:
    """Write ``fresh`` as the ``record`` of a new folder, or return the record of one that was begun and still fits.

    ``misfit`` returns what of a record does not fit, as `difference` says it, or None. What killed processes left is
    removed, and not what another is at work on. Raises InvalidArgument, with the ``rule``, where a folder that was
    begun does not fit, or holds anything else; StorageFailed where it cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if (folder / record).exists():
            begun = _read(folder / record)
            if (differs := misfit(begun)) is not None:
                raise InvalidArgument("out", rule, f"{folder}, begun with {differs}")
        elif all(found.name == LOCK or found.name.startswith(PARTIAL) for found in folder.iterdir()):
            begun = fresh
            write_text(folder / record, json.dumps(fresh, indent=1) + "\n", "out")
        else:
            raise InvalidArgument("out", "must be an empty or new folder, or one begun by this command", folder)
        remove_partials(folder)
    except OSError as error:
        raise StorageFailed("out", "the folder must be writable", f"{folder}: {error}") from error
    return begun


def difference(kept: Any, given: Any, name: str = "") -> str | None:
    """Name the first setting that differs, with the value kept and the one given; None where all are the same."""
    if isinstance(kept, dict) and isinstance(given, dict):
        return next(
            (
                said
                for key in (*given, *kept)
                if (said := difference(kept.get(key, _NOTHING), given.get(key, _NOTHING), f"{name}.{key}".lstrip(".")))
            ),
            None,
        )
    return None if kept == given else f"{name.removeprefix('settings.')} {_shown(kept)}, not {_shown(given)}"


_NOTHING = object()  # stands for a setting that is not there; null is a value
LONGEST_SHOWN = 80  # characters of a value, which may be all numbers of a rig


def _shown(value: Any) -> str:
    text = "nothing" if value is _NOTHING else json.dumps(value)
    return text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]} ..."


def _read(path: Path) -> dict[str, Any]:
    try:
        begun = parse_json(read_bounded(path, LARGEST_RECORD).decode())
    except (Refused, ValueError) as error:
        raise InvalidArgument("out", f"{path.name} must be what this command wrote", f"{path}: {error}") from error
    if not isinstance(begun, dict):
        raise InvalidArgument("out", f"{path.name} must be what this command wrote", path)
    return begun
