"""Archives as they are found: pictures that are broken, folders used twice, maps that changed on the disk."""

import json
import os
import shutil
import struct
from pathlib import Path

import pytest

from endosdk.commands.cli import main
from endosdk.errors import DatasetInvalid, InvalidArgument
from endosdk.io.locks import locked_folder
from endosdk.io.pictures import write_picture
from endosdk.jobs.batch import Settings, find_pairs, run_batch
from tests.conftest import TINY_MODEL, shifted_pair

SETTINGS = Settings(str(TINY_MODEL), threads=1)
PAIRS = 5


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
    for number in range(PAIRS):
        for side, picture in zip(("left", "right"), shifted_pair(48, 64, 6, seed=number), strict=True):
            write_picture(tmp_path / side / f"{number}.png", picture)
    return tmp_path


def run(archive: Path) -> dict:
    return run_batch(find_pairs(archive / "left", archive / "right"), SETTINGS, archive / "out")


def test_broken_pictures_neither_end_nor_pass_a_batch(archive: Path) -> None:
    good = (archive / "left" / "0.png").read_bytes()
    (archive / "left" / "0.png").write_bytes(good[: len(good) // 2])
    header = bytearray(good)
    struct.pack_into(">II", header, 16, 2**31 - 1, 2**31 - 1)
    (archive / "left" / "1.png").write_bytes(header)
    (archive / "left" / "2.png").unlink()
    os.mkfifo(archive / "left" / "2.png")
    (archive / "left" / "3.png").write_bytes(b"")
    record = run(archive)
    assert sorted(record["failed"]) == ["0", "1", "2", "3"]
    assert all("INVALID_ARGUMENT" in error for error in record["failed"].values())
    assert sum(record["status"].values()) == PAIRS - 4
    assert sorted(path.name for path in (archive / "out" / "pairs").iterdir()) == ["4"]


def test_names_that_are_not_utf8_pass_and_are_told(archive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for side in ("left", "right"):
        strange = os.fsencode(archive / side) + b"/\xff4.png"
        (archive / side / "4.png").rename(Path(os.fsdecode(strange)))
    (archive / "left" / "0.png").write_bytes(b"")
    words = ["batch", str(archive / "left"), str(archive / "right"), "--model", str(TINY_MODEL)]
    assert main([*words, "--out", str(archive / "out")]) == 1
    assert os.path.exists(os.fsencode(archive / "out" / "pairs") + b"/\xff4")  # noqa: PTH110
    assert "FAILED     0: " in capsys.readouterr().out


@pytest.mark.parametrize("name", ["disparity.png", "reasons.png", "result.json"])
def test_a_map_that_changed_on_the_disk_is_noticed_on_resuming(archive: Path, name: str) -> None:
    run(archive)
    damaged = archive / "out" / "pairs" / "1" / name
    whole = damaged.read_bytes()
    at = len(whole) // 2
    damaged.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
    if name == "result.json":
        damaged.write_text(whole.decode().replace('"disparity.png": "', '"disparity.png": "0'))
    with pytest.raises(DatasetInvalid, match="delete its folder"):
        run(archive)
    shutil.rmtree(damaged.parent)
    assert sum(run(archive)["status"].values()) == PAIRS
    assert damaged.read_bytes() == whole


@pytest.mark.parametrize("change", ["missing", "more"])
def test_a_file_that_went_or_came_is_noticed(archive: Path, change: str) -> None:
    run(archive)
    folder = archive / "out" / "pairs" / "1"
    (folder / "confidence.png").unlink() if change == "missing" else (folder / "notes.txt").touch()
    with pytest.raises(DatasetInvalid, match="files"):
        run(archive)


def test_two_batches_never_share_a_folder(archive: Path) -> None:
    (archive / "out").mkdir()
    with locked_folder(archive / "out", "out"), pytest.raises(InvalidArgument, match="in use by another process"):
        run(archive)
    assert json.loads(json.dumps(run(archive)))["failed"] == {}
