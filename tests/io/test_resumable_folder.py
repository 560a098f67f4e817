"""A folder is claimed by one job, which goes on there after a stop; nothing of anybody else is touched."""

import json
import os
import subprocess
import sys

import pytest

from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.io.resumable_folder import claim_folder, difference
from endosdk.io.whole_files import whole_file, whole_folder, whole_path

SETTINGS = {"settings": {"size": 3}}


def claim(folder, settings=SETTINGS):
    return claim_folder(folder, "job.json", settings, lambda begun: difference(begun, settings), "must be the same job")


def test_a_new_folder_is_begun_and_gone_on_with(tmp_path):
    out = tmp_path / "new" / "out"
    assert claim(out) == SETTINGS
    (out / ".partial-left-by-a-killed-process").mkdir()
    (out / "finished").write_text("kept")
    assert claim(out) == SETTINGS
    assert sorted(path.name for path in out.iterdir()) == ["finished", "job.json"]


def test_another_job_is_refused(tmp_path):
    claim(tmp_path)
    with pytest.raises(InvalidArgument, match=r"out: must be the same job; got .*, begun with size 3, not 4 "):
        claim(tmp_path, {"settings": {"size": 4}})


def test_the_setting_that_differs_is_named_with_both_values():
    kept = {"settings": {"rig": {"focal": [1.5, None]}, "bits": None, "same": True}}
    assert difference(kept, json.loads(json.dumps(kept))) is None
    assert difference(kept, {"settings": {**kept["settings"], "rig": {"focal": [1.5]}}}) == (
        "rig.focal [1.5, null], not [1.5]"
    )
    assert difference(kept, {"settings": {**kept["settings"], "rig": None}}) == ('rig {"focal": [1.5, null]}, not null')
    assert difference(kept, {"settings": {"rig": kept["settings"]["rig"], "same": True}}) == "bits null, not nothing"
    assert difference({}, {"version": "x" * 200}) == f'version nothing, not "{"x" * 79} ...'


def test_what_another_is_at_work_on_stays(tmp_path):
    claim(tmp_path)
    with whole_folder(tmp_path / "parts" / "a", tmp_path) as part:
        (part / "picture").write_text("half")
        assert claim(tmp_path) == SETTINGS
        (part / "picture").write_text("whole")
    assert (tmp_path / "parts" / "a" / "picture").read_text() == "whole"


KILLED = """
import os, pathlib, sys
from endosdk.io.whole_files import whole_folder
with whole_folder(pathlib.Path(sys.argv[1]) / "parts" / "a", pathlib.Path(sys.argv[1])):
    os._exit(9)
"""


def test_what_a_killed_process_was_at_work_on_goes(tmp_path):
    claim(tmp_path)
    assert subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False).returncode == 9
    assert len(list(tmp_path.glob(".partial-*"))) == 1
    claim(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["job.json"]


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff", b'{"a": 1, "a": 2}'])
def test_a_record_that_is_none_is_refused(tmp_path, content):
    (tmp_path / "job.json").write_bytes(content)
    with pytest.raises(InvalidArgument, match=r"job\.json must be what this command wrote"):
        claim(tmp_path)
    assert (tmp_path / "job.json").read_bytes() == content


def test_a_folder_of_somebody_else_is_left_alone(tmp_path):
    (tmp_path / "thesis.txt").write_text("years of work")
    (tmp_path / ".partial-x").write_text("")
    with pytest.raises(InvalidArgument, match="out: must be an empty or new folder"):
        claim(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".partial-x", "thesis.txt"]


def test_a_file_in_the_way_is_an_error(tmp_path):
    (tmp_path / "out").write_text("")
    with pytest.raises(StorageFailed, match="out: the folder must be writable"):
        claim(tmp_path / "out")


def test_what_a_library_writes_appears_whole_or_not_at_all(tmp_path):
    with whole_path(tmp_path / "a.txt") as partial:
        partial.write_text("new")
        assert not (tmp_path / "a.txt").exists()
    with pytest.raises(ZeroDivisionError), whole_path(tmp_path / "a.txt") as partial:
        partial.write_text("half")
        raise ZeroDivisionError
    with whole_path(tmp_path / "folder") as partial:
        partial.mkdir()
        (partial / "b").write_text("b")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.txt", "folder"]
    assert (tmp_path / "a.txt").read_text() == "new"


def test_of_two_writers_of_one_name_each_writes_its_own(tmp_path):
    path = tmp_path / "a.txt"
    with whole_path(path) as first:
        first.write_text("first, whole")
        with whole_path(path) as second:
            second.write_text("second, whole")
        assert path.read_text() == "second, whole"
    assert path.read_text() == "first, whole"
    assert list(tmp_path.iterdir()) == [path]


def test_what_a_killed_writer_left_goes_with_the_next_one(tmp_path):
    code = (
        "import os, sys; from pathlib import Path; from endosdk.io.whole_files import whole_path\n"
        "with whole_path(Path(sys.argv[1])) as partial: partial.write_text('half'); os._exit(9)"
    )
    path = tmp_path / "a.txt"
    assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == 9
    assert len(list(tmp_path.iterdir())) == 1
    with whole_path(path) as partial:
        partial.write_text("whole")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("kind", ["pipe", "link to a device"])
def test_a_library_never_writes_onto_what_is_no_file(tmp_path, kind):
    path = tmp_path / "a.mkv"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to("/dev/null")
    with (
        pytest.raises(StorageFailed, match="out: must be a regular file, a folder"),
        whole_path(path, "out") as partial,
    ):
        partial.write_text("x")
    assert path.is_fifo() if kind == "pipe" else path.is_symlink()
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("write", [whole_file, whole_path])
def test_a_name_that_is_too_long_is_named(tmp_path, write):
    with pytest.raises(StorageFailed, match="out: must be writable"), write(tmp_path / ("a" * 300), "out"):
        pass


def test_a_folder_that_is_not_there_is_named(tmp_path):
    with (
        pytest.raises(StorageFailed, match="out: must be writable"),
        whole_path(tmp_path / "no" / "a", "out") as partial,
    ):
        partial.write_text("x")
