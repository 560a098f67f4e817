"""Sizes of the files of a release, and the glibc that their libraries need.

`scripts/release_files.sh` runs it on what it built:
``python -m benchmarks.speed.release_files FILE ... --floor 2.28 --json benchmarks/results/speed/release_files.json``.
It fails where a library needs a newer glibc than the floor.
"""

from __future__ import annotations

import argparse
import io
import re
import subprocess
import sys
import tarfile
import zipfile
from collections.abc import Iterator
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

from benchmarks.record import NO_MODEL, write_record

ROOT = Path(__file__).parents[2]
KINDS = {".whl": "Python wheel", ".gz": "tarball", ".deb": "Debian package"}
LIBRARY = re.compile(r"\.so(\.[\d.]+)?$")
GLIBC = re.compile(r"\bGLIBC_(\d+(?:\.\d+)+)")


def libraries(file: Path) -> Iterator[tuple[str, bytes]]:
    """Yield name and content of each shared library inside a wheel, a tarball or a Debian package."""
    if file.suffix == ".whl":
        with zipfile.ZipFile(file) as archive:
            yield from ((name, archive.read(name)) for name in archive.namelist() if LIBRARY.search(name))
        return
    content = file.read_bytes()
    if file.suffix == ".deb":
        content = subprocess.run(["dpkg-deb", "--fsys-tarfile", str(file)], capture_output=True, check=True).stdout
    with tarfile.open(fileobj=io.BytesIO(content)) as archive:
        for member in archive:
            if member.isfile() and LIBRARY.search(member.name) and (opened := archive.extractfile(member)):
                yield member.name, opened.read()


def needed_glibc(library: bytes) -> str:
    """Return the newest version of glibc whose symbols a library asks for."""
    with NamedTemporaryFile(suffix=".so") as file:
        file.write(library)
        file.flush()
        symbols = subprocess.run(["objdump", "-T", file.name], capture_output=True, text=True, check=True).stdout
    return max(GLIBC.findall(symbols), key=_numbers)


def described(file: Path) -> dict[str, Any]:
    """Return size, and by library the glibc that it needs. Raises ValueError where a file holds no library."""
    needed = {Path(name).name: needed_glibc(content) for name, content in libraries(file)}
    if not needed:
        raise ValueError(f"no shared library in {file.name}")
    return {"kind": KINDS[file.suffix], "bytes": file.stat().st_size, "glibc": needed}


def commit() -> str:
    """Return the commit of these sources. The machine's entry has none: a wheel is installed outside of a checkout."""
    if not (ROOT / ".git").exists():
        return "unknown"  # they were unpacked from an archive
    describe = ["git", "describe", "--always", "--abbrev=12", "--dirty=+changes", "--exclude=*"]
    return subprocess.run(describe, cwd=ROOT, capture_output=True, text=True, check=True).stdout.strip()


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, version.split(".")))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE")
    parser.add_argument("--floor", required=True, help="newest glibc that a library may need")
    parser.add_argument("--json", type=Path, required=True)
    arguments = parser.parse_args()
    found = {file.name: described(file) for file in arguments.files}
    for name, file in found.items():
        print(f"{file['bytes'] / 1e6:6.1f} MB  {name}")
        for library, version in file["glibc"].items():
            print(f"{'':10} {library} needs glibc {version}")
            if _numbers(version) > _numbers(arguments.floor):
                sys.exit(f"{library} must run with glibc {arguments.floor}")
    command = f"python -m benchmarks.speed.release_files {' '.join(found)} --floor {arguments.floor}"
    record = {"commit": commit(), "floor": arguments.floor, "files": found}
    write_record(arguments.json, record, command=command, hashes=NO_MODEL)


if __name__ == "__main__":
    main()
