import hashlib
import json

import pytest

from endosdk import errors
from endosdk.runtime import models
from tests.conftest import TINY_MODEL

GOOD = {
    "endosdk.format_version": "1",
    "endosdk.name": "n",
    "endosdk.version": "1",
    "endosdk.input_multiple": "8",
    "endosdk.output_stride": "4",
    "endosdk.max_disparity": "72",
    "endosdk.channel_order": "rgb",
    "endosdk.license": "Apache-2.0",
    "endosdk.training": "{}",
    "endosdk.intended_use": "tests",
}


def test_metadata_becomes_info():
    info = models.parse_metadata({**GOOD, "endosdk.training": json.dumps({"data": "x"})}, "ab")
    assert (info.input_multiple, info.output_stride, info.max_disparity) == (8, 4, 72)
    assert (info.max_candidate_disparity, info.inference_width) == (None, None)
    assert info.training == {"data": "x"}
    assert info.sha256 == "ab"


def test_what_a_model_may_say_beside():
    info = models.parse_metadata(
        {**GOOD, "endosdk.max_candidate_disparity": "64", "endosdk.inference_width": "480"}, ""
    )
    assert (info.max_candidate_disparity, info.inference_width) == (64, 480)


@pytest.mark.parametrize("key", sorted(GOOD))
def test_missing_key_is_named(key):
    with pytest.raises(errors.ModelMetadata, match=key):
        models.parse_metadata({k: v for k, v in GOOD.items() if k != key}, "")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("format_version", "2"),
        ("input_multiple", "0"),
        ("output_stride", "-4"),
        ("output_stride", "3"),
        ("max_disparity", "many"),
        ("inference_width", "wide"),
        ("max_candidate_disparity", "63.5"),
        ("max_candidate_disparity", "73"),
        ("channel_order", "bgr"),
        ("training", "{"),
    ],
)
def test_wrong_value_is_named(key, value):
    with pytest.raises(errors.ModelMetadata, match=key):
        models.parse_metadata({**GOOD, f"endosdk.{key}": value}, "")


def test_path_and_bytes_give_the_same_hash():
    data = TINY_MODEL.read_bytes()
    assert models.read_model(TINY_MODEL).sha256 == models.read_model(data).sha256 == hashlib.sha256(data).hexdigest()


@pytest.mark.parametrize("name", sorted(models.shipped_models()))
def test_shipped_model_matches_its_recorded_hash(name):
    assert models.read_model(name).data


def test_flipped_byte_in_a_shipped_model_is_refused(tmp_path, monkeypatch):
    data = bytearray(TINY_MODEL.read_bytes())
    digest = hashlib.sha256(data).hexdigest()
    (tmp_path / "models.toml").write_text(f'[tiny]\nfile = "tiny.onnx"\nsha256 = "{digest}"\n')
    (tmp_path / "tiny.onnx").write_bytes(data)
    monkeypatch.setattr(models, "_shipped_folder", lambda: tmp_path)
    assert models.read_model("tiny").sha256 == digest
    data[len(data) // 2] ^= 1
    (tmp_path / "tiny.onnx").write_bytes(data)
    with pytest.raises(errors.ModelHashMismatch, match=digest):
        models.read_model("tiny")


def test_a_model_of_integers_gives_way_where_there_are_no_units_for_it(tmp_path, monkeypatch, caplog):
    data = TINY_MODEL.read_bytes()
    digest = hashlib.sha256(data).hexdigest()
    (tmp_path / "models.toml").write_text(
        f'[quick]\nfile = "quick.onnx"\nsha256 = "{"0" * 64}"\nwithout_integer_units = "quick-fp32"\n'
        f'[quick-fp32]\nfile = "tiny.onnx"\nsha256 = "{digest}"\n'
    )
    (tmp_path / "tiny.onnx").write_bytes(data)
    (tmp_path / "quick.onnx").write_bytes(b"never read here")
    monkeypatch.setattr(models, "_shipped_folder", lambda: tmp_path)
    assert models.read_model("quick", integer_units=False).sha256 == digest
    assert "quick-fp32 is used" in caplog.text
    with pytest.raises(errors.ModelHashMismatch):
        models.read_model("quick", integer_units=True)
    assert models.read_model("quick-fp32", integer_units=False).sha256 == digest


def test_unknown_name_lists_what_there_is():
    with pytest.raises(errors.ModelNotFound, match=r"shipped names \(.*\)"):
        models.read_model("no-such-model")


def test_wrong_type_is_refused():
    with pytest.raises(errors.InvalidArgument, match="model"):
        models.read_model(3)


def test_a_model_larger_than_any_is_refused_before_it_is_read(tmp_path):
    path = tmp_path / "model.onnx"
    with path.open("wb") as file:
        file.truncate(models.LARGEST_MODEL + 1)  # holds no block on the disk
    with pytest.raises(errors.ModelUnreadable, match=f"must have at most {models.LARGEST_MODEL} bytes"):
        models.read_model(path)
