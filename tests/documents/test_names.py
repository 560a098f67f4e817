"""One name, one thing: no two modules and no two public types of the package have the same name."""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests.conftest import ROOT

PACKAGE = ROOT / "python" / "endosdk"


def modules() -> Iterator[Path]:
    """Every module but the verbs, which are called like what they run."""
    for path in sorted(PACKAGE.rglob("*.py")):
        if path.parent.name != "commands" and not path.stem.startswith("__"):
            yield path


def shared(homes: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: found for name, found in homes.items() if len(found) > 1}


def test_no_two_modules_have_one_name():
    homes = defaultdict(list)
    for path in modules():
        homes[path.stem].append(str(path.relative_to(PACKAGE)))
    assert len(homes) > 100
    assert shared(homes) == {}


def test_no_two_public_types_have_one_name():
    homes = defaultdict(list)
    for path in modules():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(str(path.relative_to(PACKAGE)))
    assert len(homes) > 100
    assert shared(homes) == {}
