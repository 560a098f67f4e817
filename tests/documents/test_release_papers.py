"""What accompanies a release beside the code: change log, security page, model cards, hazard hints, checks of CI."""

from __future__ import annotations

import importlib.util
import re
import tomllib

import pytest

from endosdk import Cause
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession
from tests.conftest import ROOT

VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]

_SPEC = importlib.util.spec_from_file_location("requirements_page", ROOT / "scripts" / "requirements_page.py")
requirements_page = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(requirements_page)


def test_the_change_log_begins_with_this_version():
    sections = re.findall(r"^## (\S+) \((.+)\)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    version, when = sections[0]
    assert version == VERSION
    assert when == "unreleased" or re.fullmatch(r"20\d\d-\d\d-\d\d", when)


def test_the_security_page_names_a_way_to_report_and_how_long_this_version_is_supported():
    page = (ROOT / "SECURITY.md").read_text()
    assert "Report a vulnerability through a private security advisory" in page
    assert re.search(r"reply within .* working days", page)
    supported = dict(re.findall(r"^\| (\d+\.\d+)\.x \| (.+) \|$", page, re.MULTILINE))
    assert re.search(r"until one year after", supported[VERSION.rpartition(".")[0]])


@pytest.mark.parametrize("name", sorted(shipped_models()))
def test_the_card_of_a_model_states_use_limits_data_and_licence(name):
    """In the words of its file, where that states it too. The files of one network have one card."""
    file = shipped_models()[name]
    info = StereoSession(read_model(file), threads=1).info
    card = (ROOT / "models" / f"{name.removesuffix('-fp32')}.md").read_text()
    assert f"`{file.name}`" in card
    parts = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", card, re.MULTILINE | re.DOTALL))
    assert parts["For which rigs"].strip()
    assert "It is not a medical device." in parts["Limits"] and "not a medical device" in info.intended_use
    assert "Trained on rendered pairs" in parts["Data and licence"] and "No patient data" in parts["Data and licence"]
    assert f"Licence: {info.license}, weights included" in parts["Data and licence"]


def test_every_cause_belongs_to_a_hazard_and_every_control_is_a_requirement():
    hazards = requirements_page.hazards()
    known = {entry["id"] for entry in requirements_page.requirements()}
    assert {cause for hazard in hazards for cause in hazard["causes"]} == set(Cause.__members__)
    for hazard in hazards:
        assert hazard["controls"] and set(hazard["controls"]) <= known, hazard["text"]


def test_continuous_integration_runs_sanitizers_and_static_analysis():
    run, make = (ROOT / ".ci" / "run").read_text(), (ROOT / "Makefile").read_text()
    assert "scripts/clang_tidy.sh" in run and "make test-slow" in run
    assert "fixture sanitized" in (ROOT / "tests" / "slow.txt").read_text().splitlines()
    assert re.search(r"^test:.* lint$", make, re.MULTILINE)
    lint = make.partition("\nlint:")[2].partition("\n\n")[0]
    assert "ruff check" in lint and "mypy" in lint
