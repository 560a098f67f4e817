"""The papers of a device name every component that is shipped, and are the ones that their script writes."""

import importlib.util
import json
import re
import tomllib

import pytest

from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession
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
    packages = [entry for entry in papers.components() if "purl" not in entry]
    assert sorted(locked) == sorted(entry["name"] for entry in packages)


def test_what_a_release_tool_links_in_is_listed_with_the_tool_that_is_used():
    used = (ROOT / "scripts" / "release_files.sh").read_text()
    brought = {entry["name"]: entry["comes_with"] for entry in papers.components() if "comes_with" in entry}
    assert "llvm-runtimes" in brought
    assert all(f" {pin} " in used for pin in brought.values())


def test_no_part_lacks_a_supplier_and_a_licence():
    bom = json.loads(papers.CYCLONEDX.read_text())
    for part in (bom["metadata"]["component"], *bom["components"]):
        assert part["supplier"]["name"] and part["licenses"][0]["expression"], part["name"]
    for package in json.loads(papers.SPDX.read_text())["packages"]:
        assert package["supplier"] and package["licenseDeclared"] != "NOASSERTION", package["name"]


def test_what_only_some_need_is_marked():
    parts = {part["name"]: part for part in json.loads(papers.CYCLONEDX.read_text())["components"]}
    scopes = {name: part.get("scope") for name, part in parts.items()}
    assert (scopes["openssl"], scopes["scikit-build-core"], scopes["onnxruntime"]) == (
        "optional",
        "excluded",
        "required",
    )
    assert parts["onnxruntime"]["properties"] == [{"name": "endosdk:in", "value": "wheel, library"}]


def test_the_papers_are_those_that_the_script_writes():
    assert papers.CYCLONEDX.read_text() == papers.cyclonedx()
    assert papers.SPDX.read_text() == papers.spdx()
    assert papers.SOUP.read_text() == papers.soup()
    assert papers.NOTICES.read_text() == papers.notices()


def test_every_model_is_in_both_lists_with_its_own_version_and_hash():
    parts = json.loads(papers.CYCLONEDX.read_text())["components"]
    listed = {part["name"]: (part["version"], part["hashes"][0]["content"]) for part in parts if "hashes" in part}
    packages = json.loads(papers.SPDX.read_text())["packages"]
    sealed = {
        package["name"].removeprefix("model-"): (package["versionInfo"], package["checksums"][0]["checksumValue"])
        for package in packages
        if "checksums" in package
    }
    assert (
        listed
        == sealed
        == {name: (info_of(file).version, info_of(file).sha256) for name, file in shipped_models().items()}
    )


def info_of(file):
    return StereoSession(read_model(file), threads=1).info
