"""Every error code of Python, and every status of the C library, is met by a test that calls the real thing."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from endosdk import errors
from tests.conftest import ROOT

HEADER = ROOT / "cpp" / "include" / "endosdk" / "endosdk.h"
# Tests of the classes and numbers themselves raise nothing.
OTHERS = {Path(__file__), ROOT / "tests" / "runtime" / "test_errors.py"}
CLASSES = {
    cls.__name__: cls.code.name
    for cls in vars(errors).values()
    if isinstance(cls, type) and issubclass(cls, errors.EndoError) and cls is not errors.EndoError
}


def names_in(node: ast.AST) -> set[str]:
    """Names, attributes and texts."""
    found = set()
    for part in ast.walk(node):
        if isinstance(part, ast.Name):
            found.add(part.id)
        elif isinstance(part, ast.Attribute):
            found.add(part.attr)
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            found |= set(re.findall(r"[A-Z][A-Z_]+[A-Z]", part.value))
    return found


def expected_in(test: ast.AST) -> Iterator[set[str]]:
    """What a test expects: the arguments of each `pytest.raises`, and each assertion."""
    for part in ast.walk(test):
        if isinstance(part, ast.Call) and isinstance(part.func, ast.Attribute) and part.func.attr == "raises":
            yield names_in(part)
        elif isinstance(part, ast.Assert):
            yield names_in(part)


def codes_met(source: str) -> set[str]:
    """Codes that the tests of a Python file expect, by the class of the error or by name.

    What a test is given by its parameters counts as what it expects.
    """
    met: set[str] = set()
    for test in ast.walk(ast.parse(source)):
        if isinstance(test, ast.FunctionDef) and test.name.startswith("test_"):
            named = set().union(*expected_in(test), *(names_in(decorator) for decorator in test.decorator_list))
            met |= {CLASSES.get(name, name) for name in named}
    return met & set(CLASSES.values())


def statuses_met(source: str) -> set[str]:
    """Statuses that a C++ test expects of a call."""
    program = re.sub(r"//[^\n]*|/\*.*?\*/", "", source, flags=re.DOTALL)
    return set(re.findall(r"(?:==|,)\s*ENDO_([A-Z_]+)\b", program))


@pytest.fixture(scope="module")
def met_in_python() -> set[str]:
    files = [
        file for file in (ROOT / "tests").rglob("test_*.py") if file not in OTHERS and file.parent.name != "c_library"
    ]
    return set().union(*(codes_met(file.read_text()) for file in files))


@pytest.fixture(scope="module")
def met_in_c() -> set[str]:
    programs = (ROOT / "cpp" / "tests" / "library").glob("*.cpp")
    tests = (ROOT / "tests" / "c_library").glob("test_*.py")
    return set().union(
        *(statuses_met(file.read_text()) for file in programs), *(codes_met(file.read_text()) for file in tests)
    )


@pytest.mark.parametrize("code", [code.name for code in errors.ErrorCode if code != errors.ErrorCode.OK])
def test_a_test_of_python_meets_the_code(met_in_python, code):
    assert code in met_in_python


STATUSES = re.findall(r"^    ENDO_([A-Z_]+) = \d+[,\s]", HEADER.read_text().split("endo_status;")[0], re.MULTILINE)


@pytest.mark.parametrize("status", [name for name in STATUSES if name != "OK"])
def test_a_test_of_c_meets_the_status(met_in_c, status):
    assert status in met_in_c


def test_only_what_is_expected_counts():
    assert codes_met("def test_x():\n    with pytest.raises(errors.ModelNotFound):\n        f()\n") == {
        "MODEL_NOT_FOUND"
    }
    assert codes_met("def test_x():\n    assert '[CANCELLED]' in said\n") == {"CANCELLED"}
    assert codes_met("def test_x():\n    f(errors.ModelNotFound)\n") == set()
    assert statuses_met("CHECK(f() == ENDO_CANCELLED);  // not ENDO_INTERNAL\n") == {"CANCELLED"}
    assert statuses_met("int x = ENDO_CANCELLED;") == set()
