"""The hash that tells whether a sample is the one that its set records."""

from __future__ import annotations

import hashlib
from pathlib import Path

from endosdk.errors import DatasetInvalid


def hash_sample(folder: Path) -> str:
    """Return the sha256 over the names and contents of a sample's files.

    Raises DatasetInvalid, which names what is in the folder and no file that can be read.
    """
    total = hashlib.sha256()
    try:
        for path in sorted(folder.iterdir()):
            total.update(f"{path.name}:{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    except OSError as error:
        rule = "must hold nothing but files that can be read"
        raise DatasetInvalid("sample", rule, f"{error.filename or folder} ({error.strerror})") from error
    return total.hexdigest()
