"""Hashes of files whose names may be any bytes."""

from __future__ import annotations

import os
from pathlib import Path

from endosdk.io.file_hash import files_sha256


def test_a_name_that_is_not_utf8_counts_by_its_bytes(tmp_path: Path) -> None:
    names = [os.fsdecode(name) for name in (b"gr\xfc", "gr\u00fc".encode())]
    for name in names:
        (tmp_path / name).write_bytes(b"content")
    one, other = (files_sha256([(name, tmp_path / name)]) for name in names)
    assert one != other
