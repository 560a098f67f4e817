"""The benchmark of graphics cards, run on the processor at a tiny size."""

import json

import numpy as np
import onnx
import onnxruntime as ort
import pytest
import torch

from benchmarks.speed import gpu
from benchmarks.speed.graph_cost import graph_cost
from endosdk.runtime.models import read_model

SIZE = (96, 64)
PROCESSOR = gpu.Card("cpu", 1.0, 2.0, 10.0)


@pytest.fixture(scope="module")
def model():
    return read_model("wang2020").data


def test_record_of_a_run_on_the_processor(tmp_path):
    file = tmp_path / "gpu.json"
    size = ["--size", "96x64", "--frames", "2"]
    assert gpu.main(["--models", "wang2020", "--provider", "cpu", "--eager", *size, "--json", str(file)]) == 0
    found = json.loads(file.read_text())["models"]["wang2020"]
    assert [variant["precision"] for variant in found["variants"]] == ["fp32", "fp16"]
    single, half = found["variants"]
    assert single["parity"]["max_px"] < 1e-3
    assert half["parity"]["mean_px"] < gpu.LARGEST_DIFFERENCE
    for variant in found["variants"]:
        assert variant["on_device_ms"]["p50"] > 0
        assert variant["with_copies_ms"]["p99"] >= variant["with_copies_ms"]["p50"]
        assert 0 < variant["share_of_floor"]["arithmetic"]
    assert half["floors_ms"]["traffic"] == single["floors_ms"]["traffic"] / 2
    single, half = (found["torch"][precision] for precision in ("fp32", "fp16"))
    assert single["parity"]["max_px"] < 1e-3 and single["p50"] > 0
    assert ("p50" in half) == (half["parity"]["mean_px"] <= gpu.LARGEST_DIFFERENCE)
    assert found["torch"]["compiled"] is False


def answers_of(name, feed):
    session = ort.InferenceSession(read_model(name).data, providers=["CPUExecutionProvider"])
    return session.run(["disparity", "confidence"], feed)


def test_every_model_that_suits_a_card_has_its_network_in_torch():
    names = gpu.float_models()
    assert {"fast-fp32", "accurate-fp32", "wang2020"} <= set(names)
    feed = gpu.pair_of(*SIZE)
    for name in names:
        found = gpu.measure_torch(name, PROCESSOR, feed, answers_of(name, feed), 1, compiled=False)["fp32"]
        assert found["parity"]["max_px"] < 1e-2 and found["p50"] > 0


def test_torch_is_not_timed_where_it_is_wrong_and_does_not_round_to_tf32():
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = True
    feed = gpu.pair_of(*SIZE)
    wrong = [answer + 1 for answer in answers_of("fast-fp32", feed)]
    found = gpu.measure_torch("fast-fp32", PROCESSOR, feed, wrong, 1, compiled=False)
    for precision in ("fp32", "fp16"):
        assert found[precision]["failed"] == gpu.TOO_FAR and "p50" not in found[precision]
    assert not torch.backends.cuda.matmul.allow_tf32 and not torch.backends.cudnn.allow_tf32


def test_sides_of_the_pictures_are_known_before_a_card_compiles(model):
    assert [bool(side) for side in gpu.named_sides(model)] == [True, False, True, True]


def test_half_precision_leaves_the_softmax_and_its_sum_in_float(model):
    graph = onnx.load_from_string(gpu.half_precision(model)).graph
    makers = {name: node for node in graph.node for name in node.output}
    (softmax,) = (node for node in graph.node if node.op_type == "Softmax")
    before = makers[softmax.input[0]]
    while before.op_type not in ("Cast", "Conv"):  # what leads from the costs to the pictures is exact too
        before = makers[before.input[0]]
    assert before.op_type == "Cast"
    assert next(a.i for a in before.attribute if a.name == "to") == onnx.TensorProto.FLOAT
    weights = [w for w in graph.initializer if len(w.dims) == 4 and w.dims[0] == 32]
    assert weights
    assert {w.data_type for w in weights} == {onnx.TensorProto.FLOAT16}


def test_cost_counts_the_paper_s_layers(model):
    width, height = SIZE
    cell = width * height // 64
    features = 2 * 7 * 9 * 32 * 32 * cell
    down = 2 * 25 * 32 * (3 * 16 + 32 * 4 + 32) * cell
    volume = 9 * (4 * 27 * 32 * 32 + 27 * 32) * cell
    # Exported, the last layer works on blocks of 4 x 4 px under kernels of 6 x 6, mostly zeros.
    refinement = (9 * (4 * 32 + 6 * 32 * 32) + 36 * 32) * width * height
    assert graph_cost(model, width, height).macs == features + down + volume + refinement


def test_a_variant_that_is_wrong_is_not_timed(model):
    feed = gpu.pair_of(*SIZE)
    wrong = [np.full((1, 1, SIZE[1] // 4, SIZE[0] // 4), 50, np.float32)] * 2  # an answer for 4 x 4 pixels
    found = gpu.measure_variant(model, PROCESSOR, {}, feed, wrong, 2)
    assert "too far" in found["failed"]
    assert "on_device_ms" not in found


def test_a_variant_that_cannot_run_says_why():
    found = gpu.measure_variant(b"no model", PROCESSOR, {}, gpu.pair_of(*SIZE), [np.zeros(1, np.float32)] * 2, 2)
    assert found["failed"]


def test_every_combination_of_options_is_swept_on_a_card():
    options = gpu.variants(gpu.Card("cuda", 1, 1, 1))
    assert len(options) == len({tuple(entry.items()) for entry in options}) == 4


def test_models_of_8_bit_integers_are_left_out():
    names = gpu.float_models()
    assert "wang2020" in names
    assert "fast" not in names
