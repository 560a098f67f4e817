"""What the library says of its own making: the commit above all, which must never be another one."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.c_library import binding as c
from tests.conftest import ROOT

NOBODY = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_SYSTEM": os.devnull}


def git(folder: Path, *arguments: str) -> str:
    identity = ["-c", "user.name=nobody", "-c", "user.email=nobody@example.invalid"]
    command = ["git", "-C", str(folder), *identity, *arguments]
    done = subprocess.run(command, env={**os.environ, **NOBODY}, check=True, capture_output=True, text=True)
    return done.stdout.strip()


@pytest.fixture
def repository(tmp_path) -> Path:
    """A repository of one commit."""
    if shutil.which("git") is None or shutil.which("cmake") is None:
        pytest.skip("no git or no CMake (Debian: apt-get install git cmake)")
    folder = tmp_path / "repository"
    (folder / "vendored").mkdir(parents=True)
    (folder / "file").write_text("one")
    git(folder, "init", "--quiet")
    git(folder, "add", "file")
    git(folder, "commit", "--quiet", "-m", "first")
    return folder


def written(source: Path) -> Path:
    """The file that a build of these sources would write with its commit."""
    template, output = source.parent / "template", source.parent / "output"
    template.write_text("@ENDOSDK_COMMIT@")
    script = ROOT / "cmake" / "build_info.cmake"
    c.cmake("-D", f"SOURCE={source}", "-D", f"TEMPLATE={template}", "-D", f"OUTPUT={output}", "-P", script)
    return output


def commit_of(source: Path) -> str:
    """What a build of these sources would take for their commit."""
    return written(source).read_text().strip()


def test_the_library_says_what_it_is(library):
    said = json.loads(library.endo_build_info())
    assert said["version"] == library.endo_version().decode()
    assert "plain" in said["instruction_sets"].split()
    assert {"compiler", "build_type", "sanitizers", "target", "onnxruntime_api"} <= set(said)


def test_every_build_looks_for_the_commit(installed):
    """Not every configuration, after which the sources may change."""
    output = c.cmake("--build", installed.build, "--target", "endosdk_build_info")
    assert "commit" in output
    text = next(installed.build.rglob("build_info.cpp")).read_text()
    if (ROOT / ".git").exists():
        assert git(ROOT, "rev-parse", "--short=12", "HEAD") in text


def test_a_commit_is_named_with_its_changes(repository):
    head = git(repository, "rev-parse", "--short=12", "HEAD")
    assert commit_of(repository) == head
    (repository / "untracked").write_text("")
    assert commit_of(repository) == head
    (repository / "file").write_text("two")
    assert commit_of(repository) == f"{head}+changes"
    git(repository, "commit", "--quiet", "-am", "second")
    assert commit_of(repository) == git(repository, "rev-parse", "--short=12", "HEAD") != head


def test_a_file_that_would_say_the_same_is_left_alone(repository):
    """Otherwise every build would compile and link anew."""
    before = written(repository).stat().st_mtime_ns
    assert written(repository).stat().st_mtime_ns == before


def test_the_commit_of_a_repository_around_the_sources_is_not_theirs(repository, monkeypatch):
    assert commit_of(repository / "vendored") == "unknown"
    monkeypatch.setenv("GIT_DIR", str(repository / ".git"))
    assert commit_of(repository / "vendored") == "unknown"
