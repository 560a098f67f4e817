"""The hash of the weights that a study goes on from."""

from __future__ import annotations

from hashlib import sha256

from endosdk.training import checkpoint


def weights_sha256(source: str) -> str:
    """Return the SHA-256 of shipped weights, by name, or of a run's or another file's."""
    path = checkpoint.starting_point(source)
    return sha256((path / checkpoint.LAST if path.is_dir() else path).read_bytes()).hexdigest()
