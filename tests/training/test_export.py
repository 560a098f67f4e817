import copy
import json

import numpy as np
import onnx
import onnxruntime as ort
import pytest
import torch

from endosdk import _core
from endosdk.errors import InferenceFailed, InvalidArgument, StorageFailed
from endosdk.training.data import planar
from endosdk.training.export import export_model
from endosdk.training.model_file import write_model
from endosdk.training.networks import build_network
from endosdk.training.parity import check_parity, parity_pairs
from tests.tiny_model import FILE, INFO, BlockMatching
from tests.training.exported_networks import shaken
from tests.training.warped_scenes import constant_pair, warped_pair


@pytest.fixture(params=["fast", "wang2020", "wang2020-photometric"])
def model(request, exported):
    return exported[request.param]


def test_inputs_and_outputs_are_those_of_the_contract(model):
    network, path = model.network, model.path
    session = ort.InferenceSession(path)
    sizes = ["height", "width"]
    for value, name in zip(session.get_inputs(), ("left", "right"), strict=True):
        assert (value.name, value.type, value.shape) == (name, "tensor(uint8)", ["batch", 3, *sizes])
    if network.output_stride > 1:
        sizes = [f"{size}/{network.output_stride}" for size in sizes]
    for value, name in zip(session.get_outputs(), ("disparity", "confidence"), strict=True):
        assert (value.name, value.type, value.shape) == (name, "tensor(float)", ["batch", 1, *sizes])
    model = onnx.load(path)
    known = {"", *(function.domain for function in model.functions)}  # nothing that is not in the file
    assert {node.domain for part in (model.graph, *model.functions) for node in part.node} <= known
    assert onnx.load(path).opset_import[0].version >= 18


def test_the_file_describes_itself(model):
    network, path, info = model.network, model.path, model.info
    metadata = ort.InferenceSession(path).get_modelmeta().custom_metadata_map
    expected = {
        "format_version": "1",
        "name": info.name,
        "version": "3",
        "input_multiple": "8",
        "output_stride": str(network.output_stride),
        "max_disparity": "40",
        "channel_order": "rgb",
        "license": "Apache-2.0",
        "training": '{"recipe":"none"}',
        "max_candidate_disparity": {"wang2020": "32", "fast": "36"}[network.name],
        **({} if network.inference_width is None else {"inference_width": str(network.inference_width)}),
    }
    assert {key: metadata[f"endosdk.{key}"] for key in expected} == expected
    assert "not a medical device" in metadata["endosdk.intended_use"]
    assert metadata["endosdk.upsampling"] == _core.upsampling_metadata
    assert len(metadata["endosdk.content_sha256"]) == 64
    assert len(metadata) == len(expected) + 3


def test_torch_and_file_agree_at_three_sizes(model):
    network, path = model.network, model.path
    pairs = parity_pairs(*warped_pair(5, (224, 320))[:2])
    assert any(side % 8 for left, _ in pairs for side in left.shape[:2])
    report = check_parity(network, path, pairs)
    assert len(report["sizes"]) == 3
    assert report["largest_px"] <= 1e-3
    assert max(entry["confidence"] for entry in report["sizes"]) < 1e-3
    assert json.loads(json.dumps(report)) == report


@pytest.mark.parametrize(("part", "seen"), [(0, "nan px, "), (1, r"e-05 px, [1-9].*e-0[12]")])
def test_a_file_that_answers_otherwise_is_refused(exported, monkeypatch, part, seen):
    model = exported["fast"]
    answer = ort.InferenceSession.run

    def changed(session, *given):
        found = answer(session, *given)
        found[part][..., 40, 60] = np.nan if part == 0 else found[part][..., 40, 60] + 0.1
        return found

    monkeypatch.setattr(ort.InferenceSession, "run", changed)
    with pytest.raises(InferenceFailed, match=seen):
        check_parity(model.network, model.path, [warped_pair(5, (96, 160))[:2]])


def test_a_file_may_have_a_larger_output_stride(exported, tmp_path):
    whole = exported["wang2020"]
    file = tmp_path / "cells.onnx"
    network = copy.deepcopy(whole.network)
    network.deploy_at(4)
    export_model(network, file, whole.info)
    assert ort.InferenceSession(file).get_modelmeta().custom_metadata_map["endosdk.output_stride"] == "4"
    left, right, _ = warped_pair(5, (96, 160))
    assert check_parity(network, file, [(left, right)])["largest_px"] <= 1e-3
    views = {"left": planar(left)[None].numpy(), "right": planar(right)[None].numpy()}
    for fine, mean in zip(
        ort.InferenceSession(whole.path).run(None, views), ort.InferenceSession(file).run(None, views), strict=True
    ):
        np.testing.assert_allclose(mean, fine.reshape(1, 1, 24, 4, 40, 4).mean(axis=(3, 5)), rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("name", "own", "stride"), [("wang2020", 1, 0), ("wang2020", 1, 3), ("wang2020", 1, 16), ("fast", 2, 1)]
)
def test_the_output_stride_must_fit(name, own, stride):
    network = build_network(name, 40)
    rule = f"must be a multiple of {own} that divides 8, for {name}"
    with pytest.raises(InvalidArgument, match=f"output_stride: {rule}; got {stride}"):
        network.deploy_at(stride)


def test_a_batch_is_answered_pair_by_pair(model):
    path = model.path
    session = ort.InferenceSession(path)
    lefts, rights = zip(*(warped_pair(seed, (64, 96))[:2] for seed in (1, 2)), strict=True)
    left, right = (np.stack(views).transpose(0, 3, 1, 2) for views in (lefts, rights))
    together = session.run(None, {"left": left, "right": right})
    for index in range(2):
        part = slice(index, index + 1)
        alone = session.run(None, {"left": left[part], "right": right[part]})
        for a, b in zip(together, alone, strict=True):
            np.testing.assert_allclose(a[part], b, atol=1e-3)


def test_the_graph_is_the_one_that_runs_fast(model):
    network, path = model.network, model.path
    kinds = [node.op_type for node in onnx.load(path).graph.node]
    assert "BatchNormalization" not in kinds
    planes = network.max_disparity // 8  # of wang2020, whose five layers of aggregation run for each apart
    assert kinds.count("Conv") == {"wang2020": 18 + 5 * planes, "fast": 28}[network.name]
    graph = onnx.load(path).graph
    ranks = {len(weight.dims) for weight in graph.initializer if weight.name.endswith("weight")}
    assert 5 not in ranks  # no 3-D convolution is left


def test_no_source_path_or_class_name_is_inside(model):
    path = model.path
    data = path.read_bytes()
    for trace in (
        b".py",
        b"/home",
        b"site-packages",
        b"endosdk/training",
        b"stack_trace",
        b"torch.nn",
        str(path.parent).encode(),
    ):
        assert trace not in data
    assert list(path.parent.glob("*.data")) == []


def test_the_same_network_gives_the_same_bytes(exported, tmp_path):
    first = exported["wang2020"]  # which is written fastest
    export_model(first.network, tmp_path / "again.onnx", first.info)
    assert (tmp_path / "again.onnx").read_bytes() == first.path.read_bytes()


def test_a_file_of_other_weights_fails_the_comparison(exported):
    path = exported["fast"].path
    torch.manual_seed(2)
    other = shaken(build_network("fast", max_disparity=40))
    with pytest.raises(InferenceFailed, match="agree"):
        check_parity(other, path, parity_pairs(*warped_pair(5, (64, 96))[:2]))


def test_an_unwritable_place_is_an_error(tmp_path):
    (tmp_path / "file").write_text("")
    model = onnx.load(FILE)  # an export ends in the same call
    with pytest.raises(StorageFailed, match="writable"):
        write_model(model, tmp_path / "file" / "model.onnx")


def test_the_shipped_tiny_model_is_the_one_its_generator_makes(tmp_path):
    network = BlockMatching().eval()
    export_model(network, tmp_path / "tiny.onnx", INFO)
    shipped, made = (ort.InferenceSession(path) for path in (FILE, tmp_path / "tiny.onnx"))
    stated, again = ({**session.get_modelmeta().custom_metadata_map} for session in (shipped, made))
    # The bytes depend on the version of torch, and the seal on the bytes.
    assert stated.pop(_core.seal_key) and again.pop(_core.seal_key)
    assert stated == again
    check_parity(network, FILE, parity_pairs(*warped_pair(5, (96, 128))[:2]))
    assert FILE.stat().st_size < 20_000


@pytest.mark.parametrize("shift", [0, 3, 12, 25])
def test_the_tiny_model_measures_a_shift(shift):
    left, right, truth = constant_pair(1, (96, 160), shift)
    views = [view.transpose(2, 0, 1)[None].copy() for view in (left, right)]
    disparity, confidence = ort.InferenceSession(FILE).run(None, {"left": views[0], "right": views[1]})
    assert disparity.shape == (1, 1, 24, 40)
    matched = slice(shift // 4 + 3, None)  # the band on the left has no match
    error = np.abs(disparity[..., matched] - truth[0, 0])
    assert np.median(error) < 0.05
    assert error.mean() < 0.2
    assert np.median(confidence[..., matched]) > 0.9
