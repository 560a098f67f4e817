"""The page "Embed endosdk in ten minutes" is followed word for word, after its first section; prefixes are others.

`scripts/test_bare_root.py` follows the whole page, in a Debian that holds nothing else.
"""

import os
import subprocess
import tarfile

from scripts.page_steps import script, ways
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "device" / "embed.md"


def test_a_stranger_gets_there(installed, tmp_path):
    # No way is chosen: they build and install, which is what the fixture did.
    steps = script(PAGE)
    assert "apt-get" not in steps and "cmake" not in steps
    steps = steps.replace("/opt/endosdk", str(installed.prefix)).replace("/opt/", f"{tmp_path}/")
    environment = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
    command = ["bash", "-euo", "pipefail", "-c", steps]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("ready\n")


def test_every_way_through_the_page_brings_the_library():
    assert len(ways(PAGE)) == 3
    for way in ways(PAGE):
        first, _, rest = script(PAGE, way).partition(": 1. The library")
        assert "endosdk" in first and rest.partition("\n")[2] == script(PAGE)


def test_the_tarball_holds_library_header_models_papers_and_examples(installed, tmp_path):
    command = ["cpack", "-G", "TGZ", "--config", str(installed.build / "CPackConfig.cmake"), "-B", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    with tarfile.open(next(tmp_path.glob("endosdk-*.tar.gz"))) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    for name in (
        "include/endosdk/endosdk.h",
        "lib/libendosdk.so.0",
        "share/endosdk/models/fast.onnx",
        "share/doc/endosdk/THIRD_PARTY_NOTICES.md",
        "share/doc/endosdk/CHANGELOG.md",
        "share/doc/endosdk/docs/c-library.md",
        "share/doc/endosdk/docs/real-time.md",
        "share/doc/endosdk/docs/device/real-time.md",
        "share/doc/endosdk/docs/device/soup.md",
        "share/doc/endosdk/docs/device/requirements.md",
        "share/doc/endosdk/docs/device/endosdk.cdx.json",
        "share/doc/endosdk/docs/device/endosdk.spdx.json",
        "share/doc/endosdk/examples/depth_cli.c",
    ):
        assert any(found.endswith(name) for found in names), name
    assert not any("tiny-for-tests" in name for name in names)
