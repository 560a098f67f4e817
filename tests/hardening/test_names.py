"""Names inside files that would lead out of a folder."""

import hashlib
import json
from pathlib import Path

import numpy as np
import onnx
import pytest

from endosdk.datasets.dataset import Sample, read_record
from endosdk.datasets.writer import write_sample
from endosdk.errors import DatasetInvalid, EndoError, InvalidArgument
from endosdk.io.names import is_plain_name
from endosdk.runtime.triton import write_repository
from endosdk.training.model_file import sealed_bytes
from tests.conftest import TINY_MODEL

LEADING_OUT = ["../../x", "/x", "..", ".", "a/b", "a\\b", "", " x", "x\n", "\u2024\u2024", "-x", "x" * 101, "C:x"]


@pytest.mark.parametrize("name", LEADING_OUT)
def test_a_name_that_leads_out_is_not_plain(name: str) -> None:
    assert not is_plain_name(name)


@pytest.mark.parametrize("name", ["fast", "fast-320", "wang2020", "000000017", "a.b_c-d", "X" * 100])
def test_names_in_use_are_plain(name: str) -> None:
    assert is_plain_name(name)


def renamed(key: str, value: str, path: Path) -> Path:
    model = onnx.load(TINY_MODEL)
    for entry in model.metadata_props:
        if entry.key == f"endosdk.{key}":
            entry.value = value
    path.write_bytes(sealed_bytes(model))
    return path


@pytest.mark.parametrize("name", ["../../x", "/x", "..", "a/b"])
def test_a_model_writes_into_its_repository_only(tmp_path: Path, name: str) -> None:
    model = renamed("name", name, tmp_path / "m.onnx")
    home = tmp_path / "deep" / "er" / "repository"
    before = hashlib.sha256(model.read_bytes()).hexdigest()
    with pytest.raises(EndoError, match=r"letters, digits|name"):
        write_repository(model, home)
    assert not home.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["m.onnx"]
    assert hashlib.sha256(model.read_bytes()).hexdigest() == before


@pytest.mark.parametrize("version", ["../1", "0", "-1", "\u0661"])
def test_a_version_writes_into_its_repository_only(tmp_path: Path, version: str) -> None:
    with pytest.raises(EndoError, match="version"):
        write_repository(renamed("version", version, tmp_path / "m.onnx"), tmp_path / "repository")
    assert not (tmp_path / "repository").exists()


@pytest.mark.parametrize("name", ["../../x", "/x", "a/b"])
def test_an_id_of_a_data_set_stays_inside(tmp_path: Path, name: str) -> None:
    record = {"format_version": 1, "name": "x", "samples": {"train": {name: "0"}, "test": {}}}
    (tmp_path / "dataset.json").write_text(json.dumps(record))
    with pytest.raises(DatasetInvalid, match="an id must be"):
        read_record(tmp_path)
    view = np.zeros((8, 8, 3), np.uint8)
    sample = Sample(name, view, view, np.ones((8, 8), np.float32), None, None, 10.0, 4.0)
    with pytest.raises(InvalidArgument, match="its id must be"):
        write_sample(tmp_path / "set", "train", sample)
    assert not (tmp_path / "set").exists()
