"""The hash that tells whether a sample is the one that its set records."""

from __future__ import annotations

import hashlib
from pathlib import Path


def hash_sample(folder: Path) -> str:
    """Return the sha256 over the names and contents of a sample's files."""
    total = hashlib.sha256()
    for path in sorted(folder.iterdir()):
        total.update(f"{path.name}:{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return total.hexdigest()
