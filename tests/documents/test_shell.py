"""The shell blocks of the pages are run as they stand, in their order, in a folder with what a reader has.

A command that cannot run in a test stands in `NOT_RUN`, with the reason; there is no third kind.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from endosdk.calibration.boards import Board
from endosdk.io.pictures import write_picture
from tests.conftest import ROOT
from tests.core.test_pose_error import RIG, cycles_pair
from tests.documents.pages import FENCE, PAGES, blocks, name_of
from tests.live.videos import write
from tests.rendered_boards import POSES, shown

INSTALLS = "installs the package from the network; .ci/run does"
RENDERS = "renders for minutes to hours; tests/simulation render with these options"
TRAINS = "trains for minutes to hours; tests/training/test_page_commands.py takes one step of such a command"
CAMERA = "needs a camera"
NO_DATA = "needs a public set, which is not part of the repository; tests/datasets read its layout"
DEVICE_PAGE = "builds the library; tests/c_library/test_embed_page.py follows the page"
BARE_ROOT = "installs a file of a release; scripts/test_bare_root.py follows the page"
# By how a command begins.
NOT_RUN = {
    "make ": INSTALLS,
    "pip install ": INSTALLS,
    "apt-get ": "needs the rights of an administrator; scripts/test_bare_root.py follows the pages",
    ". .venv/bin/activate": "needs what make demo installed; tests/documents/test_quick_start.py follows the page",
    ".venv/bin/pre-commit install": "changes the hooks of the repository",
    "sudo chrt ": "needs the rights of an administrator",
    "mkdir /opt/endosdk": BARE_ROOT,
    "tar -xf endosdk-": BARE_ROOT,
    "cmake --": DEVICE_PAGE,
    "pip download ": DEVICE_PAGE,
    "unzip ": DEVICE_PAGE,
    "export PKG_CONFIG_PATH=": DEVICE_PAGE,
    "prefix=$(realpath ": DEVICE_PAGE,
    "cc device.c ": DEVICE_PAGE,
    "model=$prefix/": DEVICE_PAGE,
    "./device ": DEVICE_PAGE,
    "python3 ros1/": "needs ROS 1; tests/live/test_ros_node.py runs the node where ROS is",
    "colcon build ": "needs ROS 2",
    "ros2 run ": "needs ROS 2",
    "scripts/release_files.sh": "builds every release file, for an hour",
    "scripts/test_windows.sh": "needs Wine; .ci/run runs it where Wine is",
    "ffmpeg -i rtsp://": CAMERA,
    "endosdk calibrate board /dev/video0": CAMERA,
    "endosdk calibrate board boards.mp4": "needs a film of a moving board; tests/calibration/test_rendered_boards.py",
    "endosdk view ": "serves until it is stopped; tests/live/test_view.py opens the page",
    "endosdk predict left.png right.png --provider openvino": "needs OpenVINO; make test-providers runs it",
    "endosdk predict left.png right.png --model tuned.onnx": TRAINS,
    "endosdk simulate --organ mix": RENDERS,
    "endosdk simulate --organ lap": RENDERS,
    "endosdk simulate --organ shapes": RENDERS,
    "endosdk simulate --organ gi": RENDERS,
    "endosdk simulate --recipe ": RENDERS,
    "endosdk simulate --spoil set": "needs the set of the lines before it; tests/simulation/test_faults.py",
    "endosdk simulate --check set": "needs the set of the lines before it; tests/simulation/test_generate.py",
    "endosdk train ": TRAINS,
    "torchrun ": TRAINS,
    "endosdk export ": TRAINS,
    "endosdk evaluate --model ": TRAINS,
    "endosdk evaluate --layout ": NO_DATA,
    "endosdk evaluate --maps ": NO_DATA,
    "endosdk-bench --model fast --threads 2 --frames 3000 --load 2": "keeps two processors busy for minutes",
    "python -m benchmarks.speed.soak ": "takes an hour; tests/benchmarks/test_soak.py runs it for fewer frames",
}
# What runs for more than a few seconds, by how it begins.
LONG = ("endosdk-bench ", "endosdk simulate --organ abdomen")

# What a reader puts in for these words of a command that begins so; SOURCE is a folder of that name.
FILLED_IN = {
    "endosdk batch ": {"LEFT_DIR": "SOURCE/left", "RIGHT_DIR": "SOURCE/right"},
    "endosdk calibrate board ": {"LEFT_DIR": "left", "RIGHT_DIR": "right"},
}

SHELL = [page for page in PAGES if blocks(page, "sh", "bash")]
BOARD = Board((14, 10), 3.0)
NEARER = 0.8  # of the poses, whose rig sees a smaller field


def commands_of(page: Path) -> list[str]:
    """Commands of a page's shell blocks in their order, each on one line, without comments."""
    lines = "\n".join(blocks(page, "sh", "bash")).replace("\\\n", " ").splitlines()
    return [line for line in lines if line.strip() and not line.startswith("#")]


def runnable(page: Path, long: bool) -> list[str]:
    """Commands of a page that a test can run."""
    can = [line for line in commands_of(page) if not line.startswith(tuple(NOT_RUN))]
    return [line for line in can if line.startswith(LONG) == long]


def run(page: Path, folder: Path, long: bool) -> None:
    # The programs of this Python, wherever it lies; benchmarks as from a clone.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PYTHONPATH": str(ROOT)}
    for line in runnable(page, long):
        for start, words in FILLED_IN.items():
            for word, value in words.items():
                line = line.replace(word, value) if line.startswith(start) else line
        command = ["bash", "-euo", "pipefail", "-c", line]
        done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"


def paired(folder: Path, pairs: list) -> None:
    for number, pair in enumerate(pairs):
        for side, view in zip(("left", "right"), pair, strict=True):
            (folder / side).mkdir(parents=True, exist_ok=True)
            write_picture(folder / side / f"{number:02}.png", view)


@pytest.fixture(scope="module")
def reader(tmp_path_factory):
    """A folder as a reader has it: the examples, and files by the names that pages use."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copytree(ROOT / "examples" / "data", folder / "examples" / "data")
    # One endoscope made them all: a calibration from its boards fits its tissue.
    for name in ("rig.json", "rig.yaml"):
        RIG.save(folder / name)
    tissue = [cycles_pair(number) for number in range(4)]
    for side, view in zip(("left", "right"), tissue[0], strict=True):
        write_picture(folder / f"{side}.png", view)
    write(folder / "surgery.mp4", [np.hstack(pair) for pair in tissue])
    shutil.copy(ROOT / "models" / "fast.onnx", folder / "model.onnx")
    poses = [(turn, tuple(NEARER * np.array(place))) for turn, place in POSES[:6]]
    boards = [shown(BOARD, RIG, pose, seed=number) for number, pose in enumerate(poses)]
    paired(folder, boards)
    paired(folder / "SOURCE", tissue)
    return folder


@pytest.mark.parametrize("page", [page for page in SHELL if runnable(page, long=False)], ids=name_of)
def test_commands_run(page, reader, tmp_path):
    run(page, shutil.copytree(reader, tmp_path / "reader"), long=False)


# tests/documents/test_quick_start.py follows the whole page.
ELSEWHERE = ROOT / "docs" / "quick-start.md"


def pages_of_long_commands() -> list[Path]:
    """Pages with a long command that no page before runs."""
    known, pages = set(runnable(ELSEWHERE, long=True)), []
    for page in SHELL:
        new = set(runnable(page, long=True)) - known
        pages += [page] if new else []
        known |= new
    return pages


@pytest.mark.parametrize("page", pages_of_long_commands(), ids=name_of)
def test_long_commands_run(page, reader, tmp_path):
    run(page, shutil.copytree(reader, tmp_path / "reader"), long=True)


def test_every_reason_is_that_of_a_command():
    lines = [line for page in SHELL for line in commands_of(page)]
    assert [start for start in (*NOT_RUN, *LONG) if not any(line.startswith(start) for line in lines)] == []


def test_no_shell_block_has_another_name():
    """A block of a language that nothing here looks at would run nowhere."""
    others = {"python", "c", "cmake", "ini", "text", "{toctree}", "{eval-rst}"}
    for page in PAGES:
        assert {language for _, language, _ in FENCE.findall(page.read_text())} <= {"sh", "bash", *others, ""}, page
