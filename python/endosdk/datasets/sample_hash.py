"""The hash that tells whether a sample is the one that its set records."""

from __future__ import annotations

from pathlib import Path

from endosdk.errors import DatasetInvalid
from endosdk.io.file_hash import files_sha256


def hash_sample(folder: Path) -> str:
    """Return the sha256 over the names and contents of a sample's files.

    Raises DatasetInvalid, which names what is in the folder and no file that can be read.
    """
    try:
        return files_sha256((path.name, path) for path in sorted(folder.iterdir()))
    except OSError as error:
        rule = "must hold nothing but files that can be read"
        raise DatasetInvalid("sample", rule, f"{error.filename or folder} ({error.strerror})") from error
