"""The codes of errors, with what each means and what to do, as their classes say it."""

from __future__ import annotations

import inspect

from benchmarks.tables.markdown import table
from endosdk.errors import EndoError


def error_codes_table() -> str:
    """Each code that an error can have."""
    kinds = sorted(EndoError.__subclasses__(), key=lambda kind: kind.code)
    rows = [[str(kind.code.value), f"`{kind.code.name}`", *_said_of(kind)] for kind in kinds]
    return table(["number", "code", "what it means", "what to do"], rows)


def _said_of(kind: type[EndoError]) -> tuple[str, str]:
    """The first sentence of a class says what went wrong, the others what to do."""
    meaning, _, remedy = " ".join(inspect.cleandoc(kind.__doc__ or "").split()).partition(". ")
    return meaning, remedy.removesuffix(".")
