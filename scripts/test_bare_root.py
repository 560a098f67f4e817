#!/usr/bin/env python3
"""Follows pages of first steps word for word, each in a Debian 12 that holds nothing but its base.

scripts/release_files.sh && scripts/test_bare_root.py [WAY ...]        all ways, or some of: deb tarball source python

It needs root, mmdebstrap and a mirror of Debian, which is that of this machine. Where it cannot run it ends with 77.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

from page_steps import script

ROOT = Path(__file__).resolve().parents[1]
WORK = ROOT / "build" / "bare-root"
RELEASE = ROOT / "build" / "release-files"
SUITE = "bookworm"
EMBED = ROOT / "docs" / "device" / "embed.md"
# How this machine reaches packages.
PASSED_ON = ("http_proxy", "https_proxy", "no_proxy", "PIP_INDEX_URL")
CERTIFICATES = Path(os.environ.get("PIP_CERT", "/etc/ssl/certs/ca-certificates.crt"))


@dataclass(frozen=True)
class Way:
    """A page, the heading of the way through it, what the reader has, and what must be there in the end."""

    page: Path
    heading: str
    brings: str | None  # pattern of a release file; without one it is a clone
    said: str = ""
    left: str = ""


WAYS = {
    "deb": Way(EMBED, "From the Debian package", "packages/endosdk_*.deb", said="ready\n"),
    "tarball": Way(EMBED, "From the tarball", "packages/endosdk-*.tar.gz", said="ready\n"),
    "source": Way(EMBED, "From the source code", None, said="ready\n"),
    "python": Way(ROOT / "docs" / "quick-start.md", "", None, left="out/depth.npy"),
}


def mirror() -> str:
    """Return the mirror of Debian that this machine uses."""
    for name in ("sources.list.d/debian.sources", "sources.list"):
        file = Path("/etc/apt") / name
        found = re.search(
            r"^(?:URIs:|deb(?: \[.*?\])?) *(\S+)", file.read_text() if file.is_file() else "", re.MULTILINE
        )
        if found:
            return found[1]
    raise SystemExit("no mirror of Debian in /etc/apt")


def bare_root(folder: Path) -> None:
    """Unpack a new Debian; its packages are fetched once."""
    base = WORK / f"{SUITE}.tar"
    if not base.is_file():
        new = base.with_suffix(".new.tar")
        command = ["mmdebstrap", "--quiet", "--variant=minbase", SUITE, str(new), mirror()]
        subprocess.run(command, check=True)
        new.replace(base)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    subprocess.run(["tar", "-xf", str(base), "-C", str(folder)], check=True)
    shutil.copy("/etc/resolv.conf", folder / "etc" / "resolv.conf")
    shutil.copy(CERTIFICATES, folder / CERTIFICATES.name)


def bring(way: Way, folder: Path) -> None:
    """Give the reader the file of the release, or a clone."""
    folder.mkdir()
    if way.brings is None:
        files = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, stdout=subprocess.PIPE, check=True).stdout
        subprocess.run(["tar", "-xf", "-", "-C", str(folder)], input=files, check=True)
        return
    found = sorted(RELEASE.glob(way.brings))
    if len(found) != 1:
        raise SystemExit(f"{RELEASE} must hold one {way.brings}: run scripts/release_files.sh; got {len(found)}")
    shutil.copy(found[0], folder)


def follow(name: str) -> None:
    """Take one way in a root of its own, and look at what came out."""
    way, root = WAYS[name], WORK / name
    bare_root(root)
    bring(way, root / "endosdk")
    (root / "follow.sh").write_text(f"cd /endosdk\n{script(way.page, way.heading)}")
    kept = {key: os.environ[key] for key in PASSED_ON if key in os.environ}
    kept["PIP_CERT"] = f"/{CERTIFICATES.name}"
    environment = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/root", "LANG": "C.UTF-8", **kept}
    command = ["unshare", "--mount", "--pid", "--fork", f"--mount-proc={root}/proc", "chroot", str(root)]
    command += ["bash", "-euo", "pipefail", "/follow.sh"]
    print(f"{name}: {way.page.relative_to(ROOT)}", flush=True)
    start = monotonic()
    done = subprocess.run(
        command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, check=False
    )
    if done.returncode or not done.stdout.endswith(way.said) or not (root / "endosdk" / way.left).exists():
        raise SystemExit(f"{done.stdout[-4000:]}\n{name}: failed with {done.returncode}; its root is {root}")
    print(f"{name}: passed in {monotonic() - start:.0f} s", flush=True)
    shutil.rmtree(root)


def main() -> None:
    """Take all ways, or those that were asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("ways", nargs="*", choices=[*WAYS, []], metavar="WAY", help=f"of {', '.join(WAYS)}")
    chosen = parser.parse_args().ways or list(WAYS)
    lacking = [tool for tool in ("mmdebstrap", "unshare", "chroot") if shutil.which(tool) is None]
    if lacking or os.getuid() != 0:
        reason = f"no {lacking[0]} (Debian: apt-get install mmdebstrap)" if lacking else "only root can make a root"
        print(f"pages are not followed in a bare root: {reason}")
        sys.exit(77)  # what lacks a tool was not run: not the same as passed
    WORK.mkdir(parents=True, exist_ok=True)
    for name in chosen:
        follow(name)


if __name__ == "__main__":
    main()
