"""What README.md and the cards say is what was measured."""

import re
import shutil

import pytest

from benchmarks.tables import attacks, records, speed
from benchmarks.tables.__main__ import main
from benchmarks.tables.markdown import table
from benchmarks.tables.pages import DOCUMENTS, PLACE, TABLES, filled


@pytest.mark.parametrize("name", DOCUMENTS)
def test_tables_are_those_of_the_records(name):
    text = (records.SOURCES / name).read_text()
    assert PLACE.search(text), "the document has no table"
    assert filled(text) == text


@pytest.mark.parametrize("name", [name for name in DOCUMENTS if not name.startswith("docs/history/")])
def test_only_the_history_shows_numbers_of_files_that_no_longer_ship(name):
    assert records.STALE_NOTE not in (records.SOURCES / name).read_text()


def test_a_row_of_a_file_that_no_longer_ships_is_marked(tmp_path, monkeypatch):
    (tmp_path / "models.toml").write_text('[fast]\nfile = "fast.onnx"\nsha256 = "abc"\n')
    record = {"fps": 50, "stream_fps": 60, "against": {"sgbm": {"fps": 20}}, "model": {"sha256": "abc"}, "models": {}}
    monkeypatch.setattr(records, "MANIFEST", tmp_path / "models.toml")
    monkeypatch.setattr(records, "read", lambda name: record)
    assert records.STALE not in speed.short_speed_table()
    record["model"]["sha256"] = "abd"
    marked = speed.short_speed_table()
    assert marked.count(f" {records.STALE} | 50") == len(speed.SHORT_SPEEDS)
    assert marked.endswith(f"\n\n{records.STALE_NOTE}\n")
    assert records.marked("StereoSGBM", None) == "StereoSGBM"


def test_a_row_of_an_earlier_file_of_the_same_weights_has_a_mark_of_its_own(tmp_path, monkeypatch):
    (tmp_path / "models.toml").write_text('[fast]\nfile = "fast.onnx"\nsha256 = "abc"\n')
    monkeypatch.setattr(records, "MANIFEST", tmp_path / "models.toml")
    newest, oldest = records.EARLIER_RECORDS
    compared = {
        newest: {"earlier_sha256": "aaa", "model_sha256": "abc"},
        oldest: {"earlier_sha256": "000", "model_sha256": "aaa"},
    }
    monkeypatch.setattr(records, "read", lambda name: {"models": {"fast": compared[name]}})
    for sha256 in ("aaa", "000"):
        assert records.marked("fast", sha256) == f"fast {records.EARLIER}"
    assert table(["model"], [[records.marked("fast", "aaa")]]).endswith(f"\n\n{records.EARLIER_NOTE}\n")
    compared[newest]["model_sha256"] = "abb"  # what it was compared with does not ship either
    for sha256 in ("aaa", "000"):
        assert records.marked("fast", sha256) == f"fast {records.STALE}"


def test_files_that_are_called_earlier_ones_give_the_same_answers():
    later = records.shipped()
    for record in records.EARLIER_RECORDS:
        models = records.read(record)["models"]
        assert models
        for name, found in models.items():
            one, other = found["epe_px"].values()
            assert abs(one - other) < 0.002 and found["validity_differs"] < 0.005, name
            assert found["model_sha256"] in later
        later = {found["earlier_sha256"] for found in models.values()}


def test_every_fuzz_target_was_fuzzed():
    targets = {file.stem.removeprefix("fuzz_") for file in (records.SOURCES / "cpp" / "fuzz").glob("fuzz_*.cpp")}
    assert set(records.read("speed/c_library")["fuzz"]["result"]) == targets


def test_functions_that_are_run_are_counted():
    assert attacks.tests_in("def helper():\ndef test_one(x):\n    def test_inner():\ndef test_two():\n") == {
        "test_one",
        "test_two",
    }
    program = "void helper(int x) {}\nvoid frames_come(int at) {}\nint main() {\n  frames_come(3);\n}\n"
    assert attacks.tests_in(program) == {"frames_come"}
    assert all(attacks.tests_in(file.read_text()) for files in attacks.ATTACKS.values() for file in files)


def hashes_in(record):
    """Return the hashes of all model files that a record, or a part of it, names."""
    found = set()
    for key, value in record.items():
        if key == "model_sha256":
            found |= {value} if isinstance(value, str) else set(value.values())
        elif key == "model" and "sha256" in value:
            found.add(value["sha256"])
        elif key == "models" and isinstance(value, dict):
            found |= {one for one in value.values() if isinstance(one, str)}
        if isinstance(value, dict):
            found |= hashes_in(value)
    return found


def behind(name, monkeypatch):
    """Return the text of a table, and the hashes of the model files in the records that it reads."""
    read, found = records.read, set()

    def record_of(record):
        found.update(hashes_in(read(record)))
        return read(record)

    with monkeypatch.context() as patched:
        patched.setattr(records, "read", record_of)
        return TABLES[name](), found


# The record of the C library has the models of its other parts. The tables of the paper have tests of their own.
SHOWING_MODELS = sorted(name for name in TABLES if name != "fuzzed" and not name.startswith("paper-"))


# They show what the core, the shipped files or the code say of themselves, or what was built; and errors of versions
# before the files were.
WITHOUT_MODELS = {
    "arm-instructions",
    "attacks",
    "causes",
    "error-codes",
    "range:accurate",
    "range:fast",
    "range:fast-320",
    "range:wang2020",
    "reasons",
    "release-files",
    "spoilt-files",
    "versions",
}


def test_only_known_tables_have_no_model_behind_them(monkeypatch):
    """Of a table without hashes the two tests below ask nothing."""
    assert {name for name in SHOWING_MODELS if not behind(name, monkeypatch)[1]} == WITHOUT_MODELS


@pytest.mark.parametrize("name", SHOWING_MODELS)
def test_numbers_of_a_file_that_does_not_ship_are_marked(name, monkeypatch):
    text, found = behind(name, monkeypatch)
    assert found <= records.shipped() | records.earlier_files() or records.STALE_NOTE in text


@pytest.mark.parametrize("name", SHOWING_MODELS)
def test_no_table_shows_an_unmarked_row_when_every_file_was_replaced(name, tmp_path, monkeypatch):
    (tmp_path / "models.toml").write_text("")
    monkeypatch.setattr(records, "MANIFEST", tmp_path / "models.toml")
    text, found = behind(name, monkeypatch)
    if not found:
        return
    head, _, *rows = [line for line in text.splitlines() if line.startswith("|")]
    if records.STALE not in head:
        assert [row for row in rows if records.STALE not in row and "StereoSGBM" not in row.split("|")[1]] == []
    assert records.STALE_NOTE in text


def test_a_number_that_no_record_backs_is_found(tmp_path):
    for name in DOCUMENTS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(records.SOURCES / name, tmp_path / name)
    assert main(["--check"], tmp_path) == 0
    readme = tmp_path / "README.md"
    true = readme.read_text()
    readme.write_text(true.replace("| wang2020 | 0.", "| wang2020 | 9."))
    assert readme.read_text() != true
    assert main(["--check"], tmp_path) == 1
    assert main([], tmp_path) == 0
    assert readme.read_text() == true


def test_every_accuracy_record_has_its_command():
    page = (records.SOURCES / "benchmarks" / "README.md").read_text()
    rows = dict(re.findall(r"^\| (`[^|]*\.json`) \| ([^|]*) \|$", page, re.MULTILINE))
    named = {record for names in rows for record in re.findall(r"`([^`]+)`", names)}
    assert named == {path.name for path in (records.RESULTS / "accuracy").glob("*.json")}
    for names, command in rows.items():
        module = re.match(r"`python -m (\S+) ", command)
        if module:
            assert names.strip("`") in command
            assert (records.SOURCES / f"{module[1].replace('.', '/')}.py").is_file()


@pytest.mark.parametrize("record", ["accuracy/accuracy", "accuracy/accuracy_cycles"])
def test_every_card_has_its_row_of_the_two_plain_sets(record):
    """A run with fewer models would write a record without the others, and their rows would be gone."""
    assert set(records.CARDS) <= set(records.read(record)["methods"])
