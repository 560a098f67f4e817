"""The glibc that a library needs is read from its symbols, whatever file of a release it is in."""

import io
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from benchmarks.speed import release_files
from benchmarks.speed.release_files import described, needed_glibc
from endosdk import _core
from tests.conftest import ROOT

pytestmark = pytest.mark.skipif(shutil.which("objdump") is None, reason="needs objdump")
LIBRARY = Path(_core.__file__).read_bytes()


def test_the_newest_glibc_is_found():
    said = subprocess.run(["objdump", "-p", _core.__file__], capture_output=True, text=True, check=True).stdout
    versions = re.findall(r"GLIBC_([\d.]+)$", said, re.MULTILINE)
    assert needed_glibc(LIBRARY) == max(versions, key=lambda version: [int(part) for part in version.split(".")])


def test_libraries_are_found_in_wheels_and_tarballs(tmp_path):
    wheel, tarball = tmp_path / "one.whl", tmp_path / "one.tar.gz"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("endosdk/_core.cpython-311-x86_64-linux-gnu.so", LIBRARY)
        archive.writestr("endosdk/notes.so.txt", "no library")
    with tarfile.open(tarball, "w:gz") as archive:
        member = tarfile.TarInfo("one/lib/libendosdk.so.0.1.0")
        member.size = len(LIBRARY)
        archive.addfile(member, io.BytesIO(LIBRARY))
    assert list(described(wheel)["glibc"].items()) == [("_core.cpython-311-x86_64-linux-gnu.so", needed_glibc(LIBRARY))]
    assert list(described(tarball)["glibc"]) == ["libendosdk.so.0.1.0"]
    assert described(wheel) | {"glibc": None} == {"kind": "Python wheel", "bytes": wheel.stat().st_size, "glibc": None}


def test_a_file_without_a_library_is_refused(tmp_path):
    with zipfile.ZipFile(tmp_path / "empty.whl", "w") as archive:
        archive.writestr("endosdk/__init__.py", "")
    with pytest.raises(ValueError, match="no shared library"):
        described(tmp_path / "empty.whl")


@pytest.mark.parametrize("checkout", [False, True])
def test_sources_from_an_archive_have_no_commit(tmp_path, monkeypatch, checkout):
    monkeypatch.chdir(tmp_path)
    if checkout:
        for command in (["init", "-q"], ["commit", "-q", "--allow-empty", "-m", "one"]):
            identity = ["-c", "user.name=one", "-c", "user.email=one@example.org"]
            subprocess.run(["git", *identity, *command], check=True)
    monkeypatch.setattr(release_files, "ROOT", tmp_path)
    wheel = tmp_path / "one.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr("endosdk/_core.so", LIBRARY)
    given = [str(wheel), "--floor", "99.0", "--json", "found.json"]
    monkeypatch.setattr("sys.argv", ["release_files", *given])
    release_files.main()
    found = json.loads(Path("found.json").read_text())["commit"]
    assert re.fullmatch("[0-9a-f]{12}", found) if checkout else found == "unknown"


# What stands for every program that the script calls: it notes the call, and makes the files that the real one makes.
PROGRAM = """#!{python}
import os, pathlib, shutil, sys
name, given = pathlib.Path(sys.argv[0]).name, sys.argv[1:]
def put(file):
    file.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(__file__, file)
def after(option):
    return pathlib.Path(given[given.index(option) + 1])
with open(os.environ["CALLS"], "a") as calls:
    print(name, *given, sep="\\0", file=calls)
if given[:2] == ["-m", "venv"]:
    for program in ("pip", "python", "endosdk"):
        put(pathlib.Path(given[2], "bin", program))
if given[:1] == ["clone"]:
    pathlib.Path(given[-1]).mkdir(parents=True)
if given[:1] == ["wheel"]:
    put(after("--wheel-dir") / "endosdk-2.0-cp311-cp311-linux_x86_64.whl")
if name == "auditwheel":
    put(after("--wheel-dir") / pathlib.Path(given[-1]).name.replace("linux", "manylinux_2_28"))
if name == "cmake" and "-B" in given:
    put(after("-B") / "cpp/examples/depth_cli")
if name == "cpack":
    put(after("-B") / "endosdk_2.0_amd64.deb")
    put(after("-B") / "endosdk-2.0-Linux-x86_64.tar.gz")
if name == "dpkg-deb" and "--field" in given:
    print("libc6 (>= 2.28)")
"""


def test_files_of_an_earlier_version_and_folders_with_blanks_do_no_harm(tmp_path):
    project = tmp_path / "a b"
    out, calls = project / "build" / "release-files", tmp_path / "calls"
    tools, script = out / "tools" / "bin", project / "scripts" / "release_files.sh"
    for folder in (tools, script.parent, out / "raw", out / "packages"):
        folder.mkdir(parents=True)
    shutil.copy(ROOT / "scripts" / "release_files.sh", script)
    for name in ("python3", "python", "pip", "auditwheel", "cmake", "cpack", "dpkg-deb", "git", "tar"):
        (tools / name).write_text(PROGRAM.format(python=sys.executable))
        (tools / name).chmod(0o755)
    earlier = ["raw/endosdk-1.0-cp311-cp311-linux_x86_64.whl", "endosdk-1.0-cp311-cp311-manylinux_2_28_x86_64.whl"]
    for file in (*earlier, "packages/endosdk_1.0_amd64.deb", "packages/endosdk-1.0-Linux-x86_64.tar.gz"):
        (out / file).touch()
    environment = {"PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "CALLS": str(calls)}
    subprocess.run(["bash", str(script)], env=environment, check=True, capture_output=True)
    lines = [line.split("\0") for line in calls.read_text().splitlines()]
    assert not [line for line in lines if any("1.0" in word for word in line)]
    locked = [line for line in lines if line[0] == "pip" and any(word.startswith("constraints-") for word in line)]
    assert len(locked) == 2 and all("--require-hashes" in line for line in locked)
    assert [line[-2:] for line in lines if "scripts/device_papers.py" in line] == [
        ["scripts/device_papers.py", "--check"]
    ]
    assert [line[1] for line in lines if line[:2] == ["pip", "wheel"]] == ["wheel"] * 2, "built twice"
    (sizes,) = (line for line in lines if "benchmarks.speed.release_files" in line)
    files = [Path(word).name for word in sizes if word.endswith((".whl", ".deb", ".gz"))]
    assert files == [
        "endosdk-2.0-cp311-cp311-manylinux_2_28_x86_64.whl",
        "endosdk_2.0_amd64.deb",
        "endosdk-2.0-Linux-x86_64.tar.gz",
    ]
    subprocess.run([tools.parent / "zig-c++", "one file.cpp"], env=environment, check=True)
    said = calls.read_text().splitlines()[-1].split("\0")
    assert said == ["python", "-m", "ziglang", "c++", "-target", "x86_64-linux-gnu.2.28", "one file.cpp"]
