"""Read a whole file that a stranger may have made: a regular one, of bounded size, under any name."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from endosdk.errors import OutOfMemory


class Refused(Exception):
    """Content that is read no further: the ``rule`` it breaks and the ``value`` seen. Callers raise their own error."""

    def __init__(self, rule: str, value: object) -> None:
        self.rule = rule
        self.value = value
        super().__init__(f"{rule}; got {value}")


def is_there(path: Path) -> bool:
    """Whether something has this path; unlike ``Path.exists`` for any name and for folders that are shut."""
    try:
        return path.exists()
    except (OSError, ValueError):
        return False


def read_bounded(path: Path, limit: int) -> bytes:
    """Return the bytes of a regular file of at most ``limit`` bytes.

    A named pipe, a socket and a device are refused before anything is read from them: they may never end, or never
    begin. Raises `Refused`, also where the file cannot be opened; OutOfMemory where memory cannot hold it.
    """
    try:
        # Without O_NONBLOCK the opening of a pipe that nobody writes to would wait for ever.
        flags = (getattr(os, name, 0) for name in ("O_RDONLY", "O_CLOEXEC", "O_NONBLOCK", "O_BINARY"))
        handle = os.open(path, sum(flags))
        with os.fdopen(handle, "rb") as stream:
            facts = os.fstat(handle)
            if not stat.S_ISREG(facts.st_mode):
                raise Refused("must be a regular file", "a pipe, a socket or a device")
            if facts.st_size > limit:
                raise Refused(f"must have at most {limit} bytes", f"{facts.st_size} bytes")
            data = stream.read(facts.st_size + 1)
            if len(data) > facts.st_size:  # it grows, or the system makes it up as it is read
                data += stream.read(limit + 1 - len(data))
    except FileNotFoundError as error:
        raise Refused("must be a file that exists", "no such file") from error
    except MemoryError as error:
        raise OutOfMemory("", "out of memory", "") from error
    except (OSError, ValueError) as error:  # ValueError: a name with a zero byte
        raise Refused("must be readable", getattr(error, "strerror", None) or error) from error
    if len(data) > limit:
        raise Refused(f"must have at most {limit} bytes", "a larger file")
    return data
