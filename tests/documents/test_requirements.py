"""Every requirement has a test, every test it names exists, and the page says what the list says."""

import importlib.util
import re

import pytest

from tests.conftest import ROOT

_SPEC = importlib.util.spec_from_file_location("requirements_page", ROOT / "scripts" / "requirements_page.py")
requirements_page = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(requirements_page)
REQUIREMENTS = requirements_page.requirements()


def missing_tests(requirement: dict) -> list[str]:
    """What is wrong with the tests of a requirement; nothing where all exist."""
    named = requirement["python"] + requirement["c"]
    if not named:
        return [f"{requirement['id']} has no test"]
    faults = []
    for test in named:
        file, function = test.split("::")
        path = ROOT / file
        kind = "void" if path.suffix == ".cpp" else "def"
        if not path.is_file() or not re.search(rf"^\s*{kind} {function}\(", path.read_text(), re.MULTILINE):
            faults.append(f"{requirement['id']}: no {test}")
    return faults


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=lambda entry: entry["id"])
def test_every_requirement_has_a_test_that_exists(requirement):
    assert missing_tests(requirement) == []


@pytest.mark.parametrize("finding", requirements_page.findings(), ids=lambda entry: entry["text"][:40])
def test_every_finding_has_a_test_that_exists(finding):
    assert missing_tests({"id": finding["text"], "python": finding["tests"], "c": []}) == []


def test_a_requirement_without_a_test_is_found():
    assert missing_tests({"id": "X-1", "python": [], "c": []}) == ["X-1 has no test"]
    gone = "tests/documents/test_requirements.py::test_of_yesterday"
    assert missing_tests({"id": "X-2", "python": [gone], "c": []}) == [f"X-2: no {gone}"]


def test_every_point_of_the_checklist_has_a_requirement():
    assert {entry["point"] for entry in REQUIREMENTS} == set(requirements_page.POINTS) == set(range(1, 16))
    assert len({entry["id"] for entry in REQUIREMENTS}) == len(REQUIREMENTS)


def test_the_page_is_the_one_the_list_makes():
    assert (ROOT / "docs" / "device" / "requirements.md").read_text() == requirements_page.page()
