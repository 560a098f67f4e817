"""Damage to a model's bytes is noticed at opening, whether anybody has stated its hash or not."""

import logging

import numpy as np
import onnx
import pytest
from onnx import numpy_helper

from endosdk import DepthEstimator
from endosdk._core import check_seal, seal
from endosdk._core import seal_mark as MARK
from endosdk.errors import ModelHashMismatch, ModelMetadata
from endosdk.runtime.models import read_model, shipped_models
from endosdk.training.model_file import sealed_bytes
from tests.conftest import TINY_MODEL

FILES = [TINY_MODEL, *shipped_models().values()]


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_model_here_is_sealed(path):
    assert check_seal(path.read_bytes(), path.name)


def test_every_flipped_byte_of_a_small_model_is_noticed():
    data = TINY_MODEL.read_bytes()
    begin = data.index(MARK)
    passed = []
    for at in range(len(data)):
        damaged = data[:at] + bytes([data[at] ^ 0x01]) + data[at + 1 :]
        try:
            if check_seal(damaged, "tiny"):
                passed.append(at)
        except ModelHashMismatch:
            continue
        else:
            assert begin <= at < begin + len(MARK), "only in the mark itself is a flip taken for a missing seal"
    assert passed == []


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_flipped_weights_are_noticed_by_path_and_by_bytes(path, tmp_path):
    data = path.read_bytes()
    rng = np.random.default_rng(0)
    for at, bit in zip(rng.integers(0, data.index(MARK), 20), rng.integers(0, 8, 20), strict=True):
        damaged = bytearray(data)
        damaged[at] ^= 1 << bit
        with pytest.raises(ModelHashMismatch, match="must hold the bytes that were sealed"):
            read_model(bytes(damaged))
        (tmp_path / "m.onnx").write_bytes(damaged)
        with pytest.raises(ModelHashMismatch, match=r"m\.onnx"):
            read_model(tmp_path / "m.onnx")


def test_a_changed_weight_never_reaches_an_estimator():
    data = TINY_MODEL.read_bytes()
    weights = max((numpy_helper.to_array(w).tobytes() for w in onnx.load(TINY_MODEL).graph.initializer), key=len)
    at = data.index(weights) + len(weights) // 2
    with pytest.raises(ModelHashMismatch):
        DepthEstimator(data[:at] + bytes([data[at] ^ 0x80]) + data[at + 1 :])


def test_a_model_without_a_seal_is_taken_with_a_warning(caplog):
    model = onnx.load(TINY_MODEL)
    del model.metadata_props[-1]
    with caplog.at_level(logging.WARNING, logger="endosdk"):
        read_model(model.SerializeToString())
    assert "<memory> carries no seal" in caplog.text
    caplog.clear()
    read_model(sealed_bytes(model))
    assert caplog.text == ""


def test_two_seals_and_a_seal_over_a_seal_are_refused():
    data = TINY_MODEL.read_bytes()
    with pytest.raises(ModelMetadata, match="once; got 2 times"):
        check_seal(data + MARK + b"0" * 64, "tiny")
    with pytest.raises(ModelMetadata, match="before the model is sealed"):
        seal(data)


def test_sealing_again_changes_nothing():
    assert sealed_bytes(onnx.load(TINY_MODEL)) == TINY_MODEL.read_bytes()
