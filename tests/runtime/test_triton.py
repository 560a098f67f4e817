"""Model repositories for NVIDIA's Triton server, read with the server's own message types."""

from __future__ import annotations

import pytest
from google.protobuf import text_format
from tritonclient.grpc.model_config_pb2 import TYPE_FP32, TYPE_UINT8, ModelConfig

from endosdk import errors
from endosdk.commands.cli import main
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession
from endosdk.runtime.triton import write_repository
from tests.conftest import TINY_MODEL


@pytest.mark.parametrize("model", [*sorted(shipped_models()), str(TINY_MODEL)])
def test_the_configuration_fits_the_model_beside_it(model, tmp_path):
    config = write_repository(model, tmp_path)
    parsed = text_format.Parse(config.read_text(), ModelConfig())
    info = StereoSession(read_model(model), threads=1).info
    assert config == tmp_path / parsed.name / "config.pbtxt"
    served = tmp_path / parsed.name / info.version / "model.onnx"
    assert served.read_bytes() == read_model(model).data
    assert parsed.backend == "onnxruntime"
    assert parsed.max_batch_size == 0
    assert [(i.name, i.data_type, list(i.dims)[1]) for i in parsed.input] == [
        ("left", TYPE_UINT8, 3),
        ("right", TYPE_UINT8, 3),
    ]
    assert [(o.name, o.data_type, list(o.dims)[1]) for o in parsed.output] == [
        ("disparity", TYPE_FP32, 1),
        ("confidence", TYPE_FP32, 1),
    ]
    for tensor in (*parsed.input, *parsed.output):
        assert list(tensor.dims)[2:] == [-1, -1]
        assert next(iter(tensor.dims)) in (1, -1)
    assert parsed.parameters["endosdk.sha256"].string_value == info.sha256
    assert int(parsed.parameters["endosdk.input_multiple"].string_value) == info.input_multiple
    assert ("endosdk.max_candidate_disparity" in parsed.parameters) == (info.max_candidate_disparity is not None)


def test_models_share_a_repository_and_the_command_line_writes_it(tmp_path, capsys):
    for name in ("fast", "wang2020"):
        assert main(["export", name, "--triton", str(tmp_path)]) == 0
    assert "config.pbtxt" in capsys.readouterr().out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fast", "wang2020"]


def test_bad_input_is_refused(tmp_path, capsys):
    with pytest.raises(errors.ModelNotFound):
        write_repository("no such model", tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(errors.StorageFailed, match="triton"):
        write_repository("fast", tmp_path / "file")
    assert main(["export", "fast"]) == 2
    assert "out: must name" in capsys.readouterr().err
    assert main(["export", "fast", "--triton", str(tmp_path), "--int8", str(tmp_path / "i.onnx")]) == 2
    assert "int8: is for a training run" in capsys.readouterr().err
