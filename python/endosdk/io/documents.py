"""JSON, YAML and OpenCV's XML from strangers: plain values out, bounded in depth and number, or `Refused`.

No parser here calls itself for nested content, resolves tags to objects, follows entities or multiplies what an alias
names. Numbers of YAML and XML stay text: who needs a number converts it, and says what was wrong with it.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from xml.parsers import expat

from endosdk.io.bounded_read import Refused

# A calibration nests five levels and holds some hundred values; one that carries its lens maps, some hundred thousand.
DEEPEST = 32
MOST_VALUES = 1_000_000
LONGEST_INTEGER = 30  # digits; longer ones fit no float that anything here means

# Possessive, with the closing quote left open, so that no text makes it look twice at a character.
_JSON_MARKS = re.compile(r'"(?:[^"\\]|\\.)*+"?|[\[\]{},]', re.DOTALL)


def parse_json(text: str) -> Any:
    """Return the value of a JSON text. Refuses names stated twice, and what exceeds the limits."""
    _check_json_limits(text)
    try:
        return json.loads(text, object_pairs_hook=_without_twins, parse_int=_short_integer)
    except ValueError as error:
        raise Refused("must be valid JSON", error) from error


def parse_yaml(text: str) -> Any:
    """Return the value of one YAML document with every scalar as text; tags such as OpenCV's are passed over."""
    import yaml

    # OpenCV writes "%YAML:1.0", which no YAML allows.
    text = re.sub(r"\A\ufeff?%YAML[: ][^\n]*\n", "", text)
    text = re.sub(r"\n---\s*\Z", "\n", text)  # ROS ends each message that it prints so
    base: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    loader = type("Loader", (base,), {"construct_mapping": _mapping_without_twins})
    try:
        _check_yaml_limits(yaml.parse(text, Loader=base))
        return yaml.load(text, Loader=loader)
    except (yaml.YAMLError, ValueError) as error:
        raise Refused("must be valid YAML", " ".join(str(error).split())) from error


def parse_opencv_xml(text: str) -> dict[str, Any]:
    """Return the entries of an ``<opencv_storage>`` document: mappings, lists of ``<_>``, and text."""
    reader = _XmlReader()
    parser = expat.ParserCreate("utf-8")  # whatever the document declares: it was decoded before
    parser.StartElementHandler = reader.start
    parser.EndElementHandler = reader.end
    parser.CharacterDataHandler = reader.text
    parser.StartDoctypeDeclHandler = reader.refuse_declaration
    try:
        parser.Parse(text.encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise Refused("must be valid XML", error) from error
    root = reader.root
    if root is None or root[0] != "opencv_storage" or not isinstance(root[1], dict):
        raise Refused("must be an <opencv_storage> with named entries", "another element" if root else "nothing")
    return root[1]


class _Limits:
    """Counts values and levels while a document goes by."""

    def __init__(self) -> None:
        self.values = 0

    def add(self, values: int, depth: int) -> None:
        self.values += values
        if self.values > MOST_VALUES:
            raise Refused(f"must hold at most {MOST_VALUES} values", "more (aliases count as what they name)")
        if depth > DEEPEST:
            raise Refused(f"must nest at most {DEEPEST} levels", "a deeper document")


def _check_json_limits(text: str) -> None:
    limits, depth = _Limits(), 0
    for mark in _JSON_MARKS.finditer(text):
        character = mark[0][0]
        depth += (character in "[{") - (character in "]}")
        limits.add(character != '"', depth)


def _without_twins(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content: dict[str, Any] = {}
    for name, value in pairs:
        if name in content:
            raise Refused("must state each name once", name)
        content[name] = value
    return content


def _short_integer(digits: str) -> int:
    if len(digits) > LONGEST_INTEGER:
        raise Refused(f"must hold whole numbers of at most {LONGEST_INTEGER} digits", f"{len(digits)} digits")
    return int(digits)


@dataclass
class _Open:
    """A YAML collection whose end has not come yet."""

    values_before: int
    anchor: str | None
    levels: int = 1  # that it nests, its own among them


class _YamlLimits(_Limits):
    """Counts the values and levels of a YAML document, those behind aliases as often as they are named."""

    def __init__(self) -> None:
        super().__init__()
        self._open: list[_Open] = []
        self._named: dict[str, tuple[int, int]] = {}  # values and levels behind each anchor

    def begin(self, anchor: str | None) -> None:
        self._open.append(_Open(self.values, anchor))
        self.add(1, len(self._open))

    def end(self) -> None:
        ended = self._open.pop()
        self._name(ended.anchor, self.values - ended.values_before, ended.levels)
        self._inside(0, ended.levels)

    def scalar(self, anchor: str | None) -> None:
        self._name(anchor, 1, 0)
        self._inside(1, 0)

    def alias(self, anchor: str | None) -> None:
        if anchor is None or anchor not in self._named:
            raise Refused("must not hold itself", f"the alias {anchor}")
        self._inside(*self._named[anchor])

    def _name(self, anchor: str | None, values: int, levels: int) -> None:
        if anchor is not None:
            self._named[anchor] = values, levels

    def _inside(self, values: int, levels: int) -> None:
        self.add(values, len(self._open) + levels)
        if self._open:
            self._open[-1].levels = max(self._open[-1].levels, levels + 1)


def _check_yaml_limits(events: Iterator[Any]) -> None:
    import yaml

    limits, documents = _YamlLimits(), 0
    for event in events:
        if isinstance(event, yaml.CollectionStartEvent):
            limits.begin(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            limits.end()
        elif isinstance(event, yaml.ScalarEvent):
            limits.scalar(event.anchor)
        elif isinstance(event, yaml.AliasEvent):
            limits.alias(event.anchor)
        elif isinstance(event, yaml.DocumentStartEvent):
            documents += 1
            if documents > 1:
                raise Refused("must be one document", "several")


def _mapping_without_twins(loader: Any, node: Any, deep: bool = False) -> dict[Any, Any]:
    content: dict[Any, Any] = {}
    for key_node, value_node in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str):
            raise Refused("must name its entries with plain words", type(key).__name__)
        if key in content:
            raise Refused("must state each name once", key)
        content[key] = loader.construct_object(value_node, deep=deep)
    return content


class _XmlReader:
    """Builds values from elements: text, or a list of what ``<_>`` held, or a mapping of names."""

    def __init__(self) -> None:
        self.root: tuple[str, Any] | None = None
        self._limits = _Limits()
        self._open: list[tuple[str, list[str], list[tuple[str, Any]]]] = []  # name, text, children

    def start(self, name: str, attributes: dict[str, str]) -> None:
        self._open.append((name, [], []))
        self._limits.add(1, len(self._open))

    def text(self, words: str) -> None:
        if self._open:
            self._open[-1][1].append(words)

    def end(self, name: str) -> None:
        _, words, children = self._open.pop()
        value: Any = "".join(words).strip()
        if children and all(child == "_" for child, _ in children):
            value = [inner for _, inner in children]
        elif children:
            value = _without_twins(children)
        if self._open:
            self._open[-1][2].append((name, value))
        else:
            self.root = name, value

    def refuse_declaration(self, *_: object) -> None:
        raise Refused("must declare no document type", "a DOCTYPE, which could declare entities")
