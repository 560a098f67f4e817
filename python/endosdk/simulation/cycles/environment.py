"""The Python that runs Blender: found where the user says or where the command put it, made only when asked for."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from endosdk.errors import RendererUnavailable
from endosdk.io.new_folders import made_folder

BPY = "bpy==4.5.15"  # needs Python 3.11 and numpy 1, which opencv 5 refuses: hence the environment of its own
PACKAGES = (BPY, "numpy>=1.26,<2")
VARIABLE = "ENDOSDK_CYCLES_PYTHON"
REMEDY = f"make it with `endosdk simulate --setup-cycles` (400 MB), or name a Python 3.11 with {BPY} by --cycles-python"


def default_folder() -> Path:
    """Return where the environment is kept: the user's cache folder."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "endosdk" / "cycles"


def find_python(named: Path | None = None) -> Path:
    """Return the Python that has bpy: ``named``, that of $ENDOSDK_CYCLES_PYTHON, or the one that `set_up` made.

    Raises RendererUnavailable, saying how to get one.
    """
    chosen = named or os.environ.get(VARIABLE)
    python = Path(chosen) if chosen else default_folder() / "bin" / "python"
    if not python.exists():
        raise RendererUnavailable("cycles_python", f"cycles needs Blender as a Python package: {REMEDY}", python)
    asked = "import importlib.util as u, sys; sys.exit(u.find_spec('bpy') is None or u.find_spec('numpy') is None)"
    try:
        done = subprocess.run([python, "-E", "-s", "-c", asked], capture_output=True, check=False, timeout=60)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise RendererUnavailable("cycles_python", f"must be a Python that starts; {REMEDY}", error) from error
    if done.returncode:
        raise RendererUnavailable("cycles_python", f"must have bpy and numpy installed; {REMEDY}", python)
    return python


def set_up(folder: Path | None = None) -> Path:
    """Make the environment with pip, which downloads Blender; return its Python.

    Raises RendererUnavailable when there is no Python 3.11 or pip fails, StorageFailed when the folder cannot be made.
    """
    folder = folder or default_folder()
    base = sys.executable if sys.version_info[:2] == (3, 11) else shutil.which("python3.11")
    if base is None:
        raise RendererUnavailable("cycles_python", "needs Python 3.11 on the path: no other has bpy", sys.version)
    made_folder(folder, "cycles_python")
    python = folder / "bin" / "python"
    for words in ([base, "-m", "venv", str(folder)], [str(python), "-m", "pip", "install", *PACKAGES]):
        status = subprocess.run(words, check=False).returncode
        if status:
            raise RendererUnavailable("cycles_python", f"must install: {' '.join(words)}", f"status {status}")
    return find_python(python)
