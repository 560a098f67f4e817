"""What a verb found: lines for people, or one JSON document for programs."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from endosdk import _core


class Report:
    """Lines go out as they are said, or nothing but ``record`` goes out at the end when ``--json`` was given."""

    def __init__(self, args: argparse.Namespace) -> None:
        self.as_json: bool = args.json
        self.record: dict[str, Any] = {}

    def line(self, text: str) -> None:
        """Say one line to people."""
        if not self.as_json:
            print(text)

    def causes(self, counts: Mapping[str, int], unit: str) -> None:
        """Say how many of the ``unit``, such as frames, have each cause, the most frequent first, and what to do."""
        facts = {cause.name: fact for cause, fact in _core.cause_facts.items()}
        for name, count in sorted(counts.items(), key=lambda item: (-item[1], item[0])):
            # A recording of a later version may name others.
            known = f"{facts[name]['meaning']}; {facts[name]['remedy']}" if name in facts else "unknown"
            self.line(f"cause      {name} in {count} {unit}: {known}")

    def end(self, usable: bool = True) -> int:
        """Print the record if it was asked for, and return the exit status."""
        if self.as_json:
            print(json.dumps({"usable": usable, **_plain(self.record)}, indent=1, allow_nan=False))
        return 0 if usable else 1


def _plain(value: Any) -> Any:
    """Return what JSON can hold: text for paths, null for what is no number."""
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "item"):  # a NumPy scalar
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value
