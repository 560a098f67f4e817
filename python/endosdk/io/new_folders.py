"""Folders that are made before something is written into them."""

from __future__ import annotations

from pathlib import Path

from endosdk.errors import StorageFailed


def made_folder(folder: Path, argument: str) -> Path:
    """Make ``folder`` and its parents where they are not there yet, and return it.

    Raises StorageFailed, which names the caller's ``argument``.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StorageFailed(argument, "the folder must be writable", f"{folder} ({error.strerror})") from error
    return folder
