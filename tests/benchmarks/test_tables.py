"""What README.md and the cards say is what was measured."""

import re
import shutil
import tomllib

import pytest

from benchmarks import tables


@pytest.mark.parametrize("name", tables.DOCUMENTS)
def test_tables_are_those_of_the_records(name):
    text = (tables.ROOT / name).read_text()
    assert tables.PLACE.search(text), "the document has no table"
    assert tables.filled(text) == text


def test_a_row_of_a_file_that_no_longer_ships_is_marked(tmp_path, monkeypatch):
    (tmp_path / "models.toml").write_text('[fast]\nfile = "fast.onnx"\nsha256 = "abc"\n')
    record = {"fps": 50, "stream_fps": 60, "against": {"sgbm": {"fps": 20}}, "model": {"sha256": "abc"}}
    monkeypatch.setattr(tables, "MANIFEST", tmp_path / "models.toml")
    monkeypatch.setattr(tables, "_record", lambda name: record)
    assert tables.STALE not in tables.short_speed_table()
    record["model"]["sha256"] = "abd"
    marked = tables.short_speed_table()
    assert marked.count(f"VNNI {tables.STALE} | 50") == len(tables.SHORT_SPEEDS)
    assert marked.endswith(f"\n\n{tables.STALE_NOTE}\n")
    assert tables._marked("StereoSGBM", None) == "StereoSGBM"


def test_functions_that_are_run_are_counted():
    assert tables.tests_in("def helper():\ndef test_one(x):\n    def test_inner():\ndef test_two():\n") == {
        "test_one",
        "test_two",
    }
    program = "void helper(int x) {}\nvoid frames_come(int at) {}\nint main() {\n  frames_come(3);\n}\n"
    assert tables.tests_in(program) == {"frames_come"}
    assert all(tables.tests_in(file.read_text()) for files in tables.ATTACKS.values() for file in files)


def hashes_in(record):
    """Return the hashes of all model files that a record, or a part of it, names."""
    found = set()
    for key, value in record.items():
        if key == "model_sha256":
            found |= {value} if isinstance(value, str) else set(value.values())
        elif key == "model" and "sha256" in value:
            found.add(value["sha256"])
        elif key == "models":
            found |= {one for one in value.values() if isinstance(one, str)}
        if isinstance(value, dict):
            found |= hashes_in(value)
    return found


def behind(name, monkeypatch):
    """Return the text of a table, and the hashes of the model files in the records that it reads."""
    read, found = tables._record, set()

    def record_of(record):
        found.update(hashes_in(read(record)))
        return read(record)

    with monkeypatch.context() as patched:
        patched.setattr(tables, "_record", record_of)
        return tables.TABLES[name](), found


# The record of the C library has the models of its other parts.
SHOWING_MODELS = sorted(set(tables.TABLES) - {"fuzzed"})


@pytest.mark.parametrize("name", SHOWING_MODELS)
def test_numbers_of_a_file_that_does_not_ship_are_marked(name, monkeypatch):
    shipped = {entry["sha256"] for entry in tomllib.loads(tables.MANIFEST.read_text()).values()}
    text, found = behind(name, monkeypatch)
    assert found <= shipped or tables.STALE_NOTE in text


@pytest.mark.parametrize("name", SHOWING_MODELS)
def test_no_table_shows_an_unmarked_row_when_every_file_was_replaced(name, tmp_path, monkeypatch):
    (tmp_path / "models.toml").write_text("")
    monkeypatch.setattr(tables, "MANIFEST", tmp_path / "models.toml")
    text, found = behind(name, monkeypatch)
    if not found:
        return
    head, _, *rows = [line for line in text.splitlines() if line.startswith("|")]
    if tables.STALE not in head:
        assert [row for row in rows if tables.STALE not in row and "StereoSGBM" not in row.split("|")[1]] == []
    assert tables.STALE_NOTE in text


def test_a_number_that_no_record_backs_is_found(tmp_path, monkeypatch):
    for name in tables.DOCUMENTS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(tables.ROOT / name, tmp_path / name)
    monkeypatch.setattr(tables, "ROOT", tmp_path)
    monkeypatch.setattr("sys.argv", ["tables", "--check"])
    assert tables.main() == 0
    readme = tmp_path / "README.md"
    true = readme.read_text()
    readme.write_text(true.replace("| wang2020 | 0.", "| wang2020 | 9."))
    assert readme.read_text() != true
    assert tables.main() == 1
    monkeypatch.setattr("sys.argv", ["tables"])
    tables.main()
    assert readme.read_text() == true


def test_every_accuracy_record_has_its_command():
    page = (tables.ROOT / "benchmarks" / "README.md").read_text()
    rows = dict(re.findall(r"^\| (`[^|]*\.json`) \| ([^|]*) \|$", page, re.MULTILINE))
    named = {record for records in rows for record in re.findall(r"`([^`]+)`", records)}
    assert named == {path.name for path in (tables.RESULTS / "accuracy").glob("*.json")}
    for records, command in rows.items():
        module = re.match(r"`python -m (\S+) ", command)
        if module:
            assert records.strip("`") in command
            assert (tables.ROOT / f"{module[1].replace('.', '/')}.py").is_file()
