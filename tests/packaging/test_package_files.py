"""What goes into a source distribution, and so into a wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from tests.conftest import ROOT

BUILD = "import sys; from scikit_build_core.build import build_sdist; build_sdist(sys.argv[1])"


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Names of the files in the source distribution, from the project's root."""
    pytest.importorskip("scikit_build_core", reason="no scikit-build-core: pip install scikit-build-core")
    folder = tmp_path_factory.mktemp("sdist")
    subprocess.run([sys.executable, "-c", BUILD, folder], cwd=ROOT, check=True, capture_output=True)
    (archive,) = folder.glob("*.tar.gz")
    with tarfile.open(archive) as opened:
        return {name.partition("/")[2] for name in opened.getnames()}


def test_every_module_and_model_is_packed(packed: set[str]) -> None:
    package = ROOT / "python" / "endosdk"
    links = {package / "_models", package / "_samples"}
    modules = {
        Path(folder, file).relative_to(ROOT).as_posix()
        for folder, _, files in os.walk(package)
        for file in files
        if Path(folder) not in links and file.endswith((".py", ".pyi", ".js", ".html"))
    }
    models = {f"models/{file.name}" for file in (ROOT / "models").glob("*.onnx")}
    assert len(modules) > 100 and models
    assert sorted((modules | models) - packed) == []


def test_the_sets_of_pictures_stay_outside(packed: set[str]) -> None:
    assert not [name for name in packed if name.startswith("datasets/")]
