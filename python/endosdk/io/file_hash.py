"""The hash by which files are told apart."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path


def file_sha256(path: Path) -> str:
    """Return the SHA-256 of a file's bytes. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def files_sha256(files: Iterable[tuple[str, Path]]) -> str:
    """Return the SHA-256 over names and contents of files, in the order given. Raises OSError."""
    total = hashlib.sha256()
    for name, path in files:
        total.update(f"{name}:{file_sha256(path)}\n".encode(errors="surrogateescape"))
    return total.hexdigest()
