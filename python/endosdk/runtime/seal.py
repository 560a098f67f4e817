"""The seal of a model file: a hash of all its bytes, kept inside it, so that a damaged file is noticed wherever it is.

The metadata key ``endosdk.content_sha256`` holds 64 hexadecimal digits: the SHA-256 of the file with these digits
replaced by zeros. No parser is needed to check it: the digits follow the only place where `MARK` stands.
"""

from __future__ import annotations

import hashlib

from endosdk.errors import ModelHashMismatch, ModelMetadata

KEY = "endosdk.content_sha256"
EMPTY = "0" * 64
# The entry as protocol buffers write it: field 1, length, key; field 2, length, value.
MARK = b"\x0a" + bytes([len(KEY)]) + KEY.encode() + b"\x12\x40"


def seal(data: bytes) -> bytes:
    """Return the bytes of a model, whose entry `KEY` holds `EMPTY`, with the hash in its place."""
    at = _digits_at(data)
    if at is None or data[at : at + 64] != EMPTY.encode():
        raise ModelMetadata(KEY, f"must hold {EMPTY} before the model is sealed", "something else")
    return data[:at] + hashlib.sha256(data).hexdigest().encode() + data[at + 64 :]


def check_seal(data: bytes, origin: str) -> bool:
    """Return whether a model is sealed. Raises ModelHashMismatch where its bytes are not those that were sealed."""
    at = _digits_at(data)
    if at is None:
        return False
    stated = data[at : at + 64].decode("ascii", "replace")
    found = hashlib.sha256(data[:at])
    found.update(EMPTY.encode())
    found.update(memoryview(data)[at + 64 :])
    if found.hexdigest() != stated:
        raise ModelHashMismatch("model", f"{origin} must hold the bytes that were sealed, {stated}", found.hexdigest())
    return True


def _digits_at(data: bytes) -> int | None:
    count = data.count(MARK)
    if count > 1:
        raise ModelMetadata(KEY, "must stand in a model once", f"{count} times")
    return data.index(MARK) + len(MARK) if count else None
