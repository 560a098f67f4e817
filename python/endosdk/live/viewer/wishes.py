"""What the page asks for, as one text of JSON each: checked, because any program can write to the socket."""

from __future__ import annotations

from typing import Any

from endosdk.errors import InvalidArgument
from endosdk.io.bounded_read import Refused
from endosdk.io.documents import parse_json

SIMPLE = ("play", "pause", "step", "restart", "record")


def parse_wish(text: str) -> dict[str, Any]:
    """Return a wish: what to ``do``, and for ``measure`` its ``kind``, its ``pixels`` (x, y) and its ``id``.

    Raises InvalidArgument.
    """
    try:
        wish = parse_json(text)
    except Refused as refused:
        raise InvalidArgument("wish", refused.rule, refused.value) from refused
    if not isinstance(wish, dict) or wish.get("do") not in (*SIMPLE, "measure"):
        raise InvalidArgument("do", "must be something that the page can ask for", repr(wish))
    if wish["do"] == "measure":
        pixels = wish.get("pixels")
        if not isinstance(pixels, list) or not all(map(_is_pixel, pixels)):
            raise InvalidArgument("pixels", "must be a list of x and y", repr(pixels))
        if not isinstance(wish.get("kind"), str):
            raise InvalidArgument("kind", "must be a word", repr(wish.get("kind")))
        if not isinstance(wish.get("id"), int):
            raise InvalidArgument("id", "must be a whole number", repr(wish.get("id")))
    return wish


def _is_pixel(value: Any) -> bool:
    return isinstance(value, list) and len(value) == 2 and all(isinstance(each, int | float) for each in value)
