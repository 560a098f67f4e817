"""What README.md and the cards say is what was measured."""

import shutil

import pytest

from benchmarks import tables


@pytest.mark.parametrize("name", tables.DOCUMENTS)
def test_tables_are_those_of_the_records(name):
    text = (tables.ROOT / name).read_text()
    assert tables.PLACE.search(text), "the document has no table"
    assert tables.filled(text) == text


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
