"""Requirements have tests in Python and C, or say what is open; the tests exist; the page says what the list says."""

import importlib.util
import re

import pytest

from tests.conftest import ROOT

_SPEC = importlib.util.spec_from_file_location("requirements_page", ROOT / "scripts" / "requirements_page.py")
requirements_page = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(requirements_page)
REQUIREMENTS = requirements_page.requirements()


def faults_of(requirement: dict) -> list[str]:
    """What is wrong with a requirement; nothing where both interfaces have tests, or it says what is open."""
    faces = [face for face in ("python", "c") if not requirement[face]]
    untested = [f"{requirement['id']}: no test in {face}, and nothing said to be open" for face in faces]
    tests = requirement["python"] + requirement["c"]
    return (untested if "open" not in requirement else []) + missing_tests(requirement["id"], tests)


def missing_tests(name: str, tests: list[str]) -> list[str]:
    """Which tests do not exist, and whether there is none."""
    faults = [] if tests else [f"{name} has no test"]
    for test in tests:
        file, function = test.split("::")
        path = ROOT / file
        kind = "void" if path.suffix == ".cpp" else "def"
        if not path.is_file() or not re.search(rf"^\s*{kind} {function}\(", path.read_text(), re.MULTILINE):
            faults.append(f"{name}: no {test}")
    return faults


@pytest.mark.parametrize("requirement", REQUIREMENTS, ids=lambda entry: entry["id"])
def test_every_requirement_has_a_test_that_exists(requirement):
    assert faults_of(requirement) == []


@pytest.mark.parametrize("finding", requirements_page.findings(), ids=lambda entry: entry["text"][:40])
def test_every_finding_has_a_test_that_exists(finding):
    assert missing_tests(finding["text"], finding["tests"]) == []


def test_a_requirement_without_a_test_is_found():
    assert missing_tests("X-1", []) == ["X-1 has no test"]
    gone = "tests/documents/test_requirements.py::test_of_yesterday"
    assert missing_tests("X-2", [gone]) == [f"X-2: no {gone}"]


@pytest.mark.parametrize("face", ["python", "c"])
def test_an_interface_without_a_test_must_be_said_to_be_open(face):
    there = "tests/documents/test_requirements.py::test_a_requirement_without_a_test_is_found"
    one_sided = {"id": "X-3", "python": [there], "c": [there], face: []}
    assert faults_of(one_sided) == [f"X-3: no test in {face}, and nothing said to be open"]
    assert faults_of({**one_sided, "open": "what is missing"}) == []


def test_the_page_tells_the_score():
    left = requirements_page.open_points()
    page = requirements_page.page()
    assert f"{15 - len(left)} of 15 points are complete" in page
    assert all(f"{point} ({', '.join(names)})" in page for point, names in left.items())


def test_every_point_of_the_checklist_has_a_requirement():
    assert {entry["point"] for entry in REQUIREMENTS} == set(requirements_page.POINTS) == set(range(1, 16))
    assert len({entry["id"] for entry in REQUIREMENTS}) == len(REQUIREMENTS)


def test_the_page_is_the_one_the_list_makes():
    assert (ROOT / "docs" / "device" / "requirements.md").read_text() == requirements_page.page()
