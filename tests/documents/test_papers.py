"""The papers of a device name every component that is shipped, and are the ones that their script writes."""

import importlib.util
import re
import tomllib

import pytest

from tests.conftest import ROOT

pytest.importorskip("cyclonedx", reason="no cyclonedx-python-lib: pip install 'endosdk[dev]'")
pytest.importorskip("spdx_tools", reason="no spdx-tools: pip install 'endosdk[dev]'")
_SPEC = importlib.util.spec_from_file_location("device_papers", ROOT / "scripts" / "device_papers.py")
papers = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(papers)


def test_every_dependency_is_a_component_of_a_locked_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    needed = project["project"]["dependencies"] + project["project"]["optional-dependencies"]["cpu"]
    names = {re.split(r"[><=\[]", line)[0] for line in needed + project["build-system"]["requires"]}
    assert names <= {entry["name"] for entry in papers.components()}


def test_no_locked_version_lacks_a_component():
    locked = re.findall(r"^([\w-]+)==", (ROOT / "constraints-release.txt").read_text(), re.MULTILINE)
    assert sorted(locked) == sorted(entry["name"] for entry in papers.components())


def test_the_papers_are_those_that_the_script_writes(tmp_path):
    assert papers.CYCLONEDX.read_text() == papers.cyclonedx()
    assert papers.SOUP.read_text() == papers.soup()
    document = papers.spdx()  # refused where it is not valid
    written = papers.json.loads(papers.SPDX.read_text())
    assert [package["name"] for package in written["packages"]] == [package.name for package in document.packages]
    assert {package["versionInfo"] for package in written["packages"]} == {p.version for p in document.packages}


def test_every_model_is_in_both_lists_with_its_hash():
    for name, entry in papers.models().items():
        assert entry["sha256"] in papers.CYCLONEDX.read_text(), name
        assert entry["sha256"] in papers.SPDX.read_text(), name
