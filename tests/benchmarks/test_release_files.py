"""The glibc that a library needs is read from its symbols, whatever file of a release it is in."""

import io
import re
import shutil
import subprocess
import tarfile
import zipfile
from pathlib import Path

import pytest

from benchmarks.speed.release_files import described, needed_glibc
from endosdk import _core

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
