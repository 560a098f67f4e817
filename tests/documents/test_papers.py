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
    packages = [entry for entry in papers.components() if "purl" not in entry]
    assert sorted(papers.locked_versions()) == sorted(entry["name"] for entry in packages)


@pytest.mark.parametrize("name", ["release", "build", "papers"])
def test_every_locked_package_has_its_hashes(name):
    text = (ROOT / f"constraints-{name}.txt").read_text().replace("\\\n", " ")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    assert lines and all(re.match(r"[\w.-]+==\S+ .*--hash=sha256:[0-9a-f]{64}", line) for line in lines)


def test_what_is_locked_twice_is_locked_to_one_version():
    found: dict[str, set[str]] = {}
    for name in ("release", "build", "papers"):
        for package, version in re.findall(
            r"^([\w.-]+)==([\w.]+)", (ROOT / f"constraints-{name}.txt").read_text(), re.MULTILINE
        ):
            found.setdefault(package, set()).add(version)
    assert {package: versions for package, versions in found.items() if len(versions) > 1} == {}


def test_what_a_release_tool_links_in_is_listed_with_the_tool_that_is_used():
    used = (ROOT / "constraints-build.txt").read_text()
    brought = {entry["name"]: entry["comes_with"] for entry in papers.components() if "comes_with" in entry}
    assert "llvm-runtimes" in brought
    assert all(f"\n{pin} " in used for pin in brought.values())


def test_the_check_finds_a_paper_that_is_not_the_one_that_is_written(monkeypatch, tmp_path):
    monkeypatch.setattr(papers.sys, "argv", ["device_papers.py", "--check"])
    with pytest.raises(SystemExit) as done:
        papers.main()
    assert done.value.code is None
    changed = ROOT / "build" / "soup-of-a-test.md"
    changed.parent.mkdir(exist_ok=True)
    changed.write_text(papers.SOUP.read_text().replace("MIT", "GPL", 1))
    monkeypatch.setattr(papers, "SOUP", changed)
    with pytest.raises(SystemExit, match=r"not what scripts/device_papers.py writes: build/soup-of-a-test.md"):
        papers.main()
    changed.unlink()


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
