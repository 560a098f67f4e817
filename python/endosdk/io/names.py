"""Names of files: those that callers give, and those that come out of files and go into paths."""

from __future__ import annotations

import re
from os import PathLike
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument

RULE = "must be 1 to 100 letters, digits, '.', '_' or '-', and begin with a letter or a digit"

_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}", re.ASCII)


def is_plain_name(name: object) -> bool:
    """Whether a name leads nowhere but into the folder it is put in: see `RULE`."""
    return isinstance(name, str) and _PLAIN.fullmatch(name) is not None


def file_name(argument: str, path: Any) -> Path:
    """Return the name of a file as a path. Raises InvalidArgument for what is none."""
    if not isinstance(path, str | PathLike):
        raise InvalidArgument(argument, "must be a file name", repr(path))
    return Path(path)
