"""Pictures and files that many tests share."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

os.environ["ORT_DISABLE_TELEMETRY"] = "1"

ROOT = Path(__file__).resolve().parents[1]
TINY_MODEL = ROOT / "models" / "tiny-for-tests.onnx"


# Folders whose tests share what takes long to make: one worker runs them all, so that it is made once.
TOGETHER = ("tests/c_library/", "tests/training/")
SLOW = ROOT / "tests" / "slow.txt"
# Lines of that list without a test, though the tests of their file were collected.
IDLE_LINES = pytest.StashKey[list[str]]()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what is slow, and begin with what takes longest: one process works on it while the other does the rest."""
    items.sort(key=lambda item: not item.nodeid.startswith(TOGETHER))
    slow = [line for line in SLOW.read_text().splitlines() if not line.startswith("#")]
    files, meant = set(), set()
    for item in items:
        file = f"tests/{item.path.relative_to(ROOT / 'tests').as_posix()}"
        name = f"{file}::{item.nodeid.partition('::')[2]}"
        fixtures = {f"fixture {fixture}" for fixture in getattr(item, "fixturenames", ())}
        lines = {line for line in slow if line in fixtures or name.startswith(line)}
        if lines:
            item.add_marker(pytest.mark.slow)
        files.add(file)
        meant |= lines
    # A whole file may be skipped, for want of a package: nothing is known of its lines then.
    known = [line for line in slow if line.startswith("fixture ") or line.partition("::")[0] in files]
    config.stash[IDLE_LINES] = [line for line in known if line not in meant]


@pytest.hookimpl(optionalhook=True)  # where pytest-xdist is not installed, nobody asks
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each worker whole files, or some whole folders."""
    from xdist.scheduler import LoadScopeScheduling

    class Together(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            folder = [folder for folder in TOGETHER if nodeid.startswith(folder)]
            return folder[0] if folder else nodeid.partition("::")[0]

    return Together(config, log)


@pytest.fixture
def interruptible():
    """A shell starts what runs in its background with interrupts ignored: not so here."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="session")
def watcher(tmp_path_factory) -> Path:
    """A library that writes down every attempt of a program to reach the network."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no C compiler (Debian: apt-get install gcc)")
    library = tmp_path_factory.mktemp("watch") / "watch_network.so"
    source = ROOT / "tests" / "data" / "watch_network.c"
    subprocess.run([compiler, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    return library


@pytest.fixture
def restored_settings():
    """Whatever a test sets in the compiled core, the next one finds it as it was."""
    from endosdk import _core

    isa, threads = _core.isa(), _core.threads()
    yield
    _core.set_isa(isa)
    _core.set_threads(threads)


def textured_picture(height: int, width: int, seed: int = 0) -> np.ndarray:
    """A smooth tissue-like RGB picture uint8 [H, W, 3]: blotches over fine grain, nothing periodic, no hard noise."""
    import cv2

    rng = np.random.default_rng(seed)
    picture = np.zeros((height, width, 3), np.float32)
    for cell, weight in ((3, 26.0), (9, 30.0), (40, 34.0)):
        coarse = rng.standard_normal((height // cell + 3, width // cell + 3, 3)).astype(np.float32)
        smooth = cv2.resize(coarse, None, fx=cell, fy=cell, interpolation=cv2.INTER_CUBIC)
        picture += weight * smooth[:height, :width]
    picture += np.array([150.0, 80.0, 75.0], np.float32)
    return np.clip(picture, 0, 245).astype(np.uint8)


def shifted_pair(height: int, width: int, disparity: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """A rectified pair of a fronto-parallel plane: ``right[x - disparity] == left[x]``."""
    wide = textured_picture(height, width + disparity, seed)
    return np.ascontiguousarray(wide[:, :width]), np.ascontiguousarray(wide[:, disparity:])


def noisy(view: np.ndarray, levels: float, seed: int) -> np.ndarray:
    """A picture with noise of so many grey levels."""
    rng = np.random.default_rng(seed)
    return np.clip(view + rng.normal(0, levels, view.shape), 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real endoscope frames, which are not part of the project."""
    folder = Path(os.environ.get("ENDOSDK_SHARED_DATA", ROOT.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip("no real endoscope frames here: name their folder in ENDOSDK_SHARED_DATA")
    return folder
