"""Files of another layout, broken files, and paths that are none."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from endosdk.errors import CalibrationUnreadable, InvalidArgument
from tests.calibration.rig_files import load
from tests.calibration.test_opencv_files import OPENCV_4_YAML, opencv_fields, write_opencv


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("broken.json", b'{"format": '),
        ("list.json", b"[1, 2]"),
        ("number.json", b"7"),
        ("broken.yml", OPENCV_4_YAML[:200].encode()),
        ("rows.yml", OPENCV_4_YAML.replace("rows: 3", "rows: 4").encode()),
        ("broken.xml", b"<opencv_storage><K1"),
        ("wrong.xml", b"<html></html>"),
        ("broken.yaml", b"cam0: [1, 2"),
        ("text.yaml", b"just words"),
        ("foreign.yaml", b"recipe: soup\n"),
        ("empty.yaml", b""),
        ("empty.json", b""),
        ("empty.xml", b""),
        ("picture.png", b"\x89PNG\r\n\x1a\n\x00\xff\xfe"),
        ("huge.yaml", b"a: 1\n" * 1_000_000),
    ],
)
def test_foreign_and_broken_files_are_unreadable(tmp_path: Path, name: str, data: bytes) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(CalibrationUnreadable, match=name.replace(".", r"\.")):
        load(tmp_path / name)


@pytest.mark.parametrize("layout", ["endosdk", "opencv", "ros", "kalibr", "text", "foundationstereo"])
def test_a_file_of_another_layout_is_refused_by_every_reader(tmp_path: Path, layout: str) -> None:
    (tmp_path / "other.yaml").write_text("recipe: soup\n")
    with pytest.raises((CalibrationUnreadable, InvalidArgument)):
        load(tmp_path / "other.yaml", layout=layout)


@pytest.mark.parametrize("path", ["missing.yaml", ("a", "b", "c"), (), 5, ("a", 5)])
def test_paths_that_are_none_are_refused(tmp_path: Path, path: Any) -> None:
    with pytest.raises((CalibrationUnreadable, InvalidArgument), match="path"):
        load(tmp_path / path if isinstance(path, str) else path)


def test_a_pair_of_folders_and_unknown_words_are_refused(tmp_path: Path) -> None:
    path = write_opencv(tmp_path / "stereo.yml", opencv_fields())
    with pytest.raises(InvalidArgument, match="two files"):
        load((tmp_path, path))
    with pytest.raises(InvalidArgument, match="layout"):
        load(path, layout="matlab")
    with pytest.raises(InvalidArgument, match="units"):
        load(path, units="inch")
