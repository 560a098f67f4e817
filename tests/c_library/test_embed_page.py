"""The page "Embed endosdk in ten minutes" is followed word for word: only the prefix is another."""

import os
import re
import subprocess
import tarfile

from tests.conftest import ROOT

PAGE = ROOT / "docs" / "device" / "embed.md"


def test_a_stranger_gets_there(installed, tmp_path):
    page = PAGE.read_text().replace("/opt/endosdk", str(installed.prefix))
    blocks = re.findall(r"^```(sh|c)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    (program,) = (text for kind, text in blocks if kind == "c")
    (tmp_path / "device.c").write_text(program)
    # The first block builds and installs, which is what the fixture did.
    commands = [text for kind, text in blocks if kind == "sh"][1:]
    for text in commands:
        command = ["bash", "-euo", "pipefail", "-c", text]
        environment = {"PATH": os.environ["PATH"], "HOME": str(tmp_path)}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, text + done.stderr
    assert done.stdout == "ready\n"


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
        "share/doc/endosdk/endosdk.cdx.json",
        "share/doc/endosdk/endosdk.spdx.json",
        "share/doc/endosdk/examples/depth_cli.c",
    ):
        assert any(found.endswith(name) for found in names), name
    assert not any("tiny-for-tests" in name for name in names)
