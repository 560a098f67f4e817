"""What the C library refuses, it refuses as the Python package does, and by the same numbers."""

from __future__ import annotations

import ctypes
import hashlib
import re
import shutil
import subprocess

import pytest

import endosdk
from endosdk._core import seal_mark
from endosdk.errors import ErrorCode
from tests.c_library import binding as c
from tests.conftest import TINY_MODEL


def edited_model(change) -> bytes:
    onnx = pytest.importorskip("onnx", reason="no onnx: pip install 'endosdk[train]'")
    from endosdk.training.model_file import sealed_bytes

    model = onnx.load(TINY_MODEL)
    change(onnx, model)
    return sealed_bytes(model)


def drop_metadata(onnx, model):
    del model.metadata_props[:]


def claim(key, value):
    def change(onnx, model):
        next(p for p in model.metadata_props if p.key == f"endosdk.{key}").value = value

    return change


def rename_input(onnx, model):
    for node in model.graph.node:
        node.input[:] = ["links" if name == "left" else name for name in node.input]
    next(i for i in model.graph.input if i.name == "left").name = "links"


def double_disparity(onnx, model):
    replace_output(model, "disparity", onnx.helper.make_node("Add", ["before", "before"], ["disparity"]))


def no_confidence(onnx, model):
    """The logarithm of a negative number is none."""
    replace_output(model, "confidence", onnx.helper.make_node("Neg", ["before"], ["negative"]))
    model.graph.node.append(onnx.helper.make_node("Log", ["negative"], ["confidence"]))


def replace_output(model, output, node):
    """Let a node make an output of what it was before."""
    for earlier in model.graph.node:
        earlier.output[:] = ["before" if name == output else name for name in earlier.output]
        earlier.input[:] = ["before" if name == output else name for name in earlier.input]
    model.graph.node.append(node)


@pytest.mark.parametrize(
    "change",
    [
        drop_metadata,
        claim("format_version", "2"),
        claim("channel_order", "bgr"),
        claim("training", "{not json"),
        claim("input_multiple", "0"),
        claim("output_stride", "-4"),
        claim("max_disparity", "many"),
        claim("max_candidate_disparity", "33"),
        claim("name", ""),
        rename_input,
    ],
    ids=lambda change: change.__name__,
)
def test_bad_models_are_refused_as_in_python(library, change):
    model = edited_model(change)
    with pytest.raises(endosdk.EndoError) as python:
        endosdk.DepthEstimator(model)
    with pytest.raises(c.CError) as seen:
        c.CEstimator(library, model)
    assert seen.value.name == python.value.code.name == "MODEL_METADATA"


def outside(tensor) -> None:
    """Say that the numbers of a tensor are kept in another file."""
    tensor.ClearField("raw_data")
    tensor.data_location = tensor.EXTERNAL
    tensor.external_data.add(key="location", value="weights.bin")


def initializer_outside(onnx, model):
    outside(model.graph.initializer[0])


def sparse_initializer_outside(onnx, model):
    outside(model.graph.sparse_initializer.add().values)


def constant_outside(onnx, model):
    outside(constant(onnx, model.graph))


def branch_outside(onnx, model):
    node = model.graph.node.add(op_type="If")
    branch = onnx.helper.make_graph([], "branch", [], [])
    outside(constant(onnx, branch))
    node.attribute.append(onnx.helper.make_attribute("then_branch", branch))


def function_outside(onnx, model):
    outside(constant(onnx, model.functions.add(name="f")))


def constant(onnx, graph):
    """A constant added to a graph or function."""
    tensor = onnx.helper.make_tensor("numbers", onnx.TensorProto.FLOAT, [1], [1.0])
    graph.node.append(onnx.helper.make_node("Constant", [], ["c"], value=tensor))
    return graph.node[-1].attribute[0].t


WEIGHTS_OUTSIDE = [initializer_outside, sparse_initializer_outside, constant_outside, branch_outside, function_outside]


@pytest.mark.parametrize("change", WEIGHTS_OUTSIDE, ids=lambda change: change.__name__)
def test_a_model_that_keeps_weights_elsewhere_is_refused(library, change):
    """Its hash would not cover them."""
    with pytest.raises(c.CError, match="must hold its weights itself") as seen:
        c.CEstimator(library, edited_model(change))
    assert seen.value.name == "MODEL_METADATA"


def test_one_flipped_byte_is_refused_when_the_model_is_pinned(library):
    data = TINY_MODEL.read_bytes()
    digest = hashlib.sha256(data).hexdigest().upper().encode()
    c.CEstimator(library, data, model_sha256=digest).close()
    flipped = bytearray(data)
    flipped[len(data) // 2] ^= 1
    with pytest.raises(c.CError, match="SHA-256") as seen:
        c.CEstimator(library, bytes(flipped), model_sha256=digest)
    assert seen.value.name == "MODEL_HASH_MISMATCH"


def test_a_flipped_weight_of_a_sealed_model_is_refused_without_a_pin(library, tmp_path):
    data = TINY_MODEL.read_bytes()
    for at in range(0, data.index(seal_mark), 97):
        flipped = data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]
        (tmp_path / "model.onnx").write_bytes(flipped)
        for model in (flipped, tmp_path / "model.onnx"):
            with pytest.raises(c.CError, match="must hold the bytes that were sealed") as seen:
                c.CEstimator(library, model)
            assert seen.value.name == "MODEL_HASH_MISMATCH"


def test_a_model_without_a_seal_is_taken_with_a_warning(library):
    onnx = pytest.importorskip("onnx", reason="no onnx: pip install 'endosdk[train]'")
    model = onnx.load(TINY_MODEL)
    del model.metadata_props[-1]
    data, lines = model.SerializeToString(), []
    log = LOG(lambda _, level, line: lines.append((level, line.decode())))
    function = ctypes.cast(log, ctypes.c_void_p)
    c.CEstimator(library, data, log=function).close()
    assert [(level, line) for level, line in lines if "carries no seal" in line] == lines[:1]
    lines.clear()
    c.CEstimator(library, data, log=function, model_sha256=hashlib.sha256(data).hexdigest().encode()).close()
    assert not [line for _, line in lines if "seal" in line]


LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int32, ctypes.c_char_p)
OLD_RUNTIME = """
#include <stdint.h>
static const void *api(uint32_t version) { return version > 20 ? 0 : ""; }
static const char *name(void) { return "1.20.1"; }
static const struct { const void *(*api)(uint32_t); const char *(*name)(void); } base = {api, name};
const void *OrtGetApiBase(void) { return &base; }
"""


def test_a_runtime_that_is_too_old_is_refused_by_its_version(library, tmp_path):
    if shutil.which("cc") is None:
        pytest.skip("no C compiler (Debian: apt-get install gcc)")
    (tmp_path / "old.c").write_text(OLD_RUNTIME)
    runtime = tmp_path / "libonnxruntime.so.1.20.1"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", runtime, tmp_path / "old.c"], check=True)
    with pytest.raises(c.CError, match=r"1\.21 or later .* got .*, 1\.20\.1") as seen:
        c.CEstimator(library, TINY_MODEL, runtime_library=bytes(runtime))
    assert seen.value.name == "RUNTIME_MISSING"


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (double_disparity, "self test: disparity: a plane must be right to a pixel, at least 80 %"),
        (no_confidence, "self test: (disparity|depth): a plane must"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_self_test_finds_a_wrong_answer(library, change, rule):
    estimator = c.CEstimator(library, edited_model(change))
    with pytest.raises(c.CError, match=rule) as seen:
        estimator.self_test()
    estimator.close()
    assert seen.value.name == "SELF_TEST_FAILED"


def test_status_numbers_are_pythons():
    numbers = dict(re.findall(r"^    ENDO_([A-Z_]+) = (\d+)[,\s]", c.HEADER.read_text().split("endo_status;")[0], re.M))
    assert len(numbers) == 19
    assert {name: int(number) for name, number in numbers.items()}.items() <= ErrorCode.__members__.items()
