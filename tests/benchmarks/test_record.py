"""Numbers are written with the command, the machine and the model files behind them, or not at all."""

import json
import re
from pathlib import Path

import pytest

from benchmarks.record import NO_MODEL, write_part, write_record

ROOT = Path(__file__).parents[2]
COMMAND = "python -m benchmarks.speed.one --json FILE"
SHA256 = "ab" * 32


def test_a_record_says_what_it_was_measured_by(tmp_path):
    file = tmp_path / "made" / "one.json"
    write_record(file, {"fps": 45}, command=COMMAND, hashes={"model_sha256": SHA256})
    record = json.loads(file.read_text())
    assert record | {"machine": None} == {
        "command": COMMAND,
        "model_sha256": SHA256,
        "fps": 45,
        "machine": None,
    }
    assert {"cpu", "versions", "commit", "date"} <= set(record["machine"])


def test_a_record_of_before_keeps_no_signature(tmp_path):
    file = tmp_path / "one.json"
    old = {"command": "old", "machine": {"cpu": "old"}, "fps": 45}
    write_record(file, old, command=COMMAND, hashes=NO_MODEL)
    record = json.loads(file.read_text())
    assert record["command"] == COMMAND and record["machine"]["cpu"] != "old" and record["fps"] == 45


def test_parts_are_signed_apart(tmp_path):
    file = tmp_path / "parts.json"
    write_part(file, "gl", {"fps": 1}, command=COMMAND, hashes=NO_MODEL)
    first = json.loads(file.read_text())["gl"]
    write_part(file, "cycles", {"fps": 2}, command=COMMAND, hashes={"model_sha256": {"fast": SHA256}})
    record = json.loads(file.read_text())
    assert record["gl"] == first and record["cycles"]["model_sha256"] == {"fast": SHA256}


@pytest.mark.parametrize(
    ("command", "hashes"),
    [
        ("", NO_MODEL),
        ("benchmarks.speed.one", NO_MODEL),
        (COMMAND, {}),
        (COMMAND, {"model_sha256": ""}),
        (COMMAND, {"models": {"fast": "fast.onnx"}}),
    ],
)
def test_nothing_is_written_without_command_and_hashes(tmp_path, command, hashes):
    with pytest.raises(ValueError):
        write_record(tmp_path / "one.json", {"fps": 45}, command=command, hashes=hashes)
    assert not list(tmp_path.iterdir())


def test_every_benchmark_writes_its_record_so():
    """A machine told elsewhere would be a record written by hand; the paper's rows say on which each was timed."""
    told = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "benchmarks").rglob("*.py")
        if re.search(r"machine_record\(|RECORD\.write_text", path.read_text())
    }
    assert told == {"benchmarks/record.py", "benchmarks/paper/tables.py"}
