"""Files and folders that are written whole or not at all, and what is left of them after a crash."""

from __future__ import annotations

import glob
import json
import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from endosdk.errors import EndoError, StorageFailed
from endosdk.io.bounded_read import is_there
from endosdk.io.locks import held, is_held
from endosdk.io.new_folders import made_folder

PARTIAL = ".partial-"


@contextmanager
def whole_file(path: Path, argument: str = "path") -> Iterator[BinaryIO]:
    """Yield a binary stream whose content becomes ``path`` once it is complete and on the disk.

    A reader never meets half a file, and an error leaves the old one as it was. Raises `StorageFailed`, which names
    the caller's ``argument``. It also refuses a ``path`` that is no regular file: a device must not be replaced.
    """
    if is_there(path) and not path.is_file():
        raise StorageFailed(argument, "must be a regular file or not exist", path)
    partial: Path | None = None
    try:
        new = path.with_name(f"{PARTIAL}{path.name}-{secrets.token_hex(8)}")
        with new.open("xb") as stream:
            partial = new
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
        _flush_folder(path.parent)
    except OSError as error:
        raise StorageFailed(argument, "must be writable", f"{path} ({error.strerror or error})") from error
    finally:
        if partial is not None:
            partial.unlink(missing_ok=True)


def write_text(path: Path, text: str, argument: str = "path") -> None:
    """Write text in UTF-8, whole or not at all. Raises `StorageFailed`.

    Bytes of a file's name that are not UTF-8 are written as escapes.
    """
    with whole_file(path, argument) as stream:
        stream.write(text.encode(errors="backslashreplace"))


def write_json(path: Path, content: Any, argument: str = "path") -> None:
    """Write JSON, whole or not at all; the folder is made. Raises `StorageFailed`."""
    made_folder(path.parent, argument)
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n", argument)


@contextmanager
def whole_folder(final: Path, staging: Path) -> Iterator[Path]:
    """Yield a new folder in ``staging``, on the same disk, that becomes ``final`` once its files have reached the disk.

    A folder that is there already is replaced. `remove_partials` leaves it alone. Raises `StorageFailed`.
    """
    partial = staging / f"{PARTIAL}{final.parent.name}-{final.name}-{os.getpid()}"
    try:
        partial.mkdir(parents=True, exist_ok=True)
        with held(partial):
            yield partial
            for path in partial.iterdir():
                _flush(path)
            _flush_folder(partial)
            final.parent.mkdir(exist_ok=True)
            if final.exists():
                shutil.rmtree(final)
            partial.rename(final)
        _flush_folder(final.parent)
    except EndoError:
        raise
    except OSError as error:
        raise StorageFailed("out", "must be writable", f"{final}: {error}") from error
    finally:
        shutil.rmtree(partial, ignore_errors=True)


@contextmanager
def whole_path(path: Path, argument: str = "path") -> Iterator[Path]:
    """Yield a name on the same disk for what a library writes, file or folder; it becomes ``path`` once it is complete.

    Of several writers the last one to finish wins. Raises `StorageFailed`, which names the caller's ``argument``; also
    for a device or a pipe, which must not be replaced.
    """
    if is_there(path) and not (path.is_file() or path.is_dir()):
        raise StorageFailed(argument, "must be a regular file, a folder or not exist", path)
    staging = path.with_name(f"{PARTIAL}{path.name}-{secrets.token_hex(8)}")
    partial = staging / path.name
    try:
        _remove_abandoned(path)
        staging.mkdir()
        with held(staging):
            yield partial
            for written in partial.rglob("*") if partial.is_dir() else (partial,):
                if written.is_dir():
                    _flush_folder(written)
                else:
                    _flush(written)
            partial.rename(path)
        _flush_folder(path.parent)
    except EndoError:  # of what writes; some are OSErrors too
        raise
    except OSError as error:
        raise StorageFailed(argument, "must be writable", f"{path} ({error.strerror or error})") from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _remove_abandoned(path: Path) -> None:
    """Remove what killed processes left of ``path``: folders that nobody holds."""
    for staging in path.parent.glob(f"{PARTIAL}{glob.escape(path.name)}-*"):
        if staging.is_dir() and not is_held(staging):
            shutil.rmtree(staging, ignore_errors=True)


def remove_partials(folder: Path) -> None:
    """Remove what killed processes left in ``folder``, and no folder that is in work. Raises `StorageFailed`.

    Of a file nobody sees whether it is in work: a caller that is not alone there locks the folder first.
    """
    try:
        for left_over in folder.glob(f"{PARTIAL}*"):
            if not is_held(left_over):
                _remove(left_over)
    except OSError as error:
        raise StorageFailed("out", "what killed processes left must be removable", f"{folder}: {error}") from error


def _remove(path: Path) -> None:
    """Remove a file, or a folder with all it holds, where there is one."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def _flush(path: Path) -> None:
    """Wait until a file has reached the disk, so that a rename cannot outrun its data."""
    with path.open("rb") as file:
        os.fsync(file.fileno())


def _flush_folder(folder: Path) -> None:
    """Wait until the names in a folder have reached the disk. Windows has no such call, and needs none."""
    if os.name == "nt":
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
