"""A folder that one process at a time may write, and one that a process is still at work in."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from endosdk.errors import InvalidArgument, StorageFailed

log = logging.getLogger("endosdk")

LOCK = ".lock"  # stays behind, empty: removing it would let two processes lock two files of one name


@contextmanager
def locked_folder(folder: Path, argument: str) -> Iterator[None]:
    """Hold ``folder``, which is made, until the block ends, or the process, however it ends.

    Raises InvalidArgument where another process holds it, StorageFailed where it cannot be written; both name the
    caller's ``argument``.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | getattr(os, "O_CLOEXEC", 0), 0o666)
    except OSError as error:
        raise StorageFailed(argument, "the folder must be writable", f"{folder}: {error}") from error
    try:
        if not _lock(handle):
            raise InvalidArgument(argument, "must not be in use by another process", folder)
        yield
    finally:
        os.close(handle)


@contextmanager
def held(folder: Path) -> Iterator[None]:
    """Let `is_held` see that ``folder`` is in work until the block ends, or the process, however it ends.

    Nobody is kept out. Raises OSError where the folder cannot be opened.
    """
    if os.name == "nt":  # opens no folders, and removes no file that is open
        yield
        return
    handle = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    try:
        _lock(handle)
        yield
    finally:
        os.close(handle)


def is_held(path: Path) -> bool:
    """Whether `held` is at work in a folder; False for a file, and on a disk that locks no folders."""
    if os.name == "nt":
        return False
    import fcntl

    try:
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError:  # a file, or its work ended meanwhile
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return isinstance(error, BlockingIOError)
    finally:
        os.close(handle)
    return False


def _lock(handle: int) -> bool:
    """Lock, and return whether another process did not hold it."""
    try:
        if os.name == "nt":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError):  # the latter of Windows
        return False
    except OSError as error:
        log.warning("this disk cannot lock folders (%s): nothing keeps a second process out", error.strerror)
    return True
