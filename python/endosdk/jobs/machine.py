"""The machine, the versions and the commit that a number was measured with."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

# Packages whose version can change a measured number.
PACKAGES = ("endosdk", "numpy", "opencv-python-headless", "onnxruntime", "onnxruntime-gpu", "torch")
# Instruction sets, as Linux names them, that decide how fast networks run; virtual machines hide the model's name.
INSTRUCTIONS = ("avx2", "avx512f", "avx_vnni", "avx512_vnni", "avx512_bf16", "amx_int8", "asimddp", "i8mm")


def machine_record() -> dict[str, Any]:
    """Return cpu, instructions, threads, os, versions, commit and date as JSON-ready values."""
    return {
        "cpu": cpu_name(),
        "instructions": instructions(),
        "threads": available_threads(),
        "os": f"{platform.system()} {platform.release()} {platform.machine()}",
        "versions": versions(),
        "commit": commit(),
        "date": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }


def peak_memory_mb() -> float | None:
    """Return the most memory that this process has had at a time, MB; None where the system does not tell it."""
    # Linux's getrusage starts a program at what its parent had. The program's own peak stands in its status.
    status = Path("/proc/self/status")
    for line in status.read_text().splitlines() if status.is_file() else ():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024  # bytes of what getrusage counts
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**20


def cpu_name() -> str:
    """Return the processor's marketing name where the system tells it."""
    return _cpu_info("model name") or platform.processor() or platform.machine()


def instructions() -> list[str]:
    """Return those of `INSTRUCTIONS` that the processor has, where the system tells it."""
    found = (_cpu_info("flags") or _cpu_info("Features")).split()
    return [name for name in INSTRUCTIONS if name in found]


def _cpu_info(key: str) -> str:
    """Return the first value of a key in Linux's description of the processor; empty where there is none."""
    info = Path("/proc/cpuinfo")
    for line in info.read_text().splitlines() if info.is_file() else ():
        name, _, value = line.partition(":")
        if name.strip() == key:
            return value.strip()
    return ""


def available_threads() -> int:
    """Return how many threads this process may run on at once, which a container can hold below the core count."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def versions() -> dict[str, str]:
    """Return the installed versions of Python and of the packages that matter here."""
    found = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    return found


def commit() -> str:
    """Return the checkout's commit, with ``+changes`` when tracked files differ from it; ``unknown`` outside of one."""
    root = Path(__file__).resolve().parents[3]
    if not (root / ".git").exists():
        return "unknown"
    try:
        head = _git(root, "rev-parse", "--short=12", "HEAD")
        changes = _git(root, "status", "--porcelain", "--untracked-files=no")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{head}+changes" if changes else head


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout.strip()
