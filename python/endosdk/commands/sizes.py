"""Sizes as people type them: ``960x720``."""

from __future__ import annotations

from endosdk.errors import InvalidArgument


def parse_size(text: str) -> tuple[int, int]:
    """Turn ``WIDTHxHEIGHT`` into (width, height), px."""
    parts = text.lower().split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise InvalidArgument("size", "must be WIDTHxHEIGHT in whole pixels, such as 960x720", repr(text))
    return int(parts[0]), int(parts[1])
