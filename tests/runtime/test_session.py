import subprocess
import sys
from collections import Counter

import numpy as np
import onnx
import pytest

from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, _core, errors
from endosdk.runtime.models import ModelFile, read_model
from endosdk.runtime.providers import checked_options
from endosdk.runtime.session import StereoSession, load_runtime
from endosdk.training.model_file import sealed_bytes
from tests.conftest import TINY_MODEL, shifted_pair


def tiny() -> StereoSession:
    return StereoSession(read_model(TINY_MODEL), threads=1)


def test_finds_a_known_shift():
    session = tiny()
    run = NetworkRun(session, 64, 160)
    left, right = shifted_pair(64, 160, 12)
    run.left[:] = left.transpose(2, 0, 1)
    run.right[:] = right.transpose(2, 0, 1)
    run()
    stride = session.info.output_stride
    inner = np.s_[4:-4, 40 // stride : -4]
    assert np.median(np.abs(run.disparity[inner] - 12)) < 0.1
    assert np.median(run.confidence[inner]) > 0.5


def test_two_buffers_do_not_mix():
    session = tiny()
    first, second = NetworkRun(session, 32, 64), NetworkRun(session, 32, 64)
    pairs = shifted_pair(32, 64, 8), shifted_pair(32, 64, 16)
    for run, (left, right) in zip((first, second), pairs, strict=True):
        run.left[:], run.right[:] = left.transpose(2, 0, 1), right.transpose(2, 0, 1)
    first()
    alone = first.disparity.copy()
    second()
    np.testing.assert_array_equal(first.disparity, alone)
    assert not np.array_equal(second.disparity, alone)


@pytest.mark.parametrize("size", [(33, 64), (32, 0), (32, -8)])
def test_size_off_the_multiple_is_refused_and_the_session_lives(size):
    session = tiny()
    with pytest.raises(errors.InvalidArgument, match="multiple of 8"):
        NetworkRun(session, *size)
    NetworkRun(session, 32, 64)()


@pytest.mark.parametrize("content", [b"", b"not a model", TINY_MODEL.read_bytes()[:1000]], ids=["empty", "text", "cut"])
def test_broken_file_is_refused(content):
    with pytest.raises(errors.ModelUnreadable, match="model"):
        StereoSession(read_model(content))


def test_foreign_onnx_is_refused_with_the_missing_key():
    model = onnx.load(TINY_MODEL)
    del model.metadata_props[:]
    with pytest.raises(errors.ModelMetadata, match=r"endosdk\.format_version"):
        StereoSession(read_model(model.SerializeToString()))


@pytest.mark.parametrize("smallest", [0, 1000], ids=["all", "large"])
@pytest.mark.parametrize("location", ["beside", "elsewhere", "upwards"])
def test_weights_in_another_file_are_refused(tmp_path, monkeypatch, location, smallest):
    """The hash would not cover them."""
    model = onnx.load(TINY_MODEL)
    onnx.external_data_helper.convert_model_to_external_data(model, location="weights.bin", size_threshold=smallest)
    onnx.save_model(model, tmp_path / "model.onnx")
    monkeypatch.chdir(tmp_path)
    model = onnx.load("model.onnx", load_external_data=False)
    outside = [tensor for tensor in model.graph.initializer if tensor.data_location == onnx.TensorProto.EXTERNAL]
    assert outside
    path = str(tmp_path / "weights.bin")
    named = {"beside": "weights.bin", "elsewhere": path, "upwards": "../" * 20 + path[1:]}[location]
    for tensor in outside:
        next(entry for entry in tensor.external_data if entry.key == "location").value = named
    with pytest.raises(errors.ModelMetadata, match="hold its weights itself"):
        StereoSession(read_model(sealed_bytes(model)))


def test_wrong_interface_is_refused():
    model = onnx.load(TINY_MODEL)
    for node in model.graph.node:
        node.input[:] = ["links" if name == "left" else name for name in node.input]
    model.graph.input[0].name = "links"
    with pytest.raises(errors.ModelMetadata, match="left and right"):
        StereoSession(read_model(sealed_bytes(model)))


@pytest.mark.parametrize("provider", ["warp-drive", "cuda"])
def test_missing_provider_is_an_error_that_says_what_is_installed(provider):
    with pytest.raises(errors.ProviderUnavailable, match=r"installed: .*CPUExecutionProvider"):
        StereoSession(read_model(TINY_MODEL), provider=provider)


def test_a_missing_provider_says_nothing_of_models(caplog):
    with pytest.raises(errors.ProviderUnavailable):
        DepthEstimator("fast", provider="cuda")
    assert caplog.messages == []


def _fake_distribution(folder, name):
    info = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")


@pytest.mark.parametrize("other", ["onnxruntime-gpu", "onnxruntime-openvino"])
def test_two_runtime_packages_in_one_folder_are_refused(tmp_path, monkeypatch, other):
    for name in ("onnxruntime", other):
        _fake_distribution(tmp_path, name)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(errors.RuntimeConflict, match=f"onnxruntime and {other}"):
        load_runtime()


def test_a_runtime_package_in_a_folder_of_its_own_is_taken(tmp_path, monkeypatch):
    _fake_distribution(tmp_path, "onnxruntime-openvino")
    monkeypatch.syspath_prepend(tmp_path)
    assert load_runtime().__version__


# Of the package for processors, this one computes no operation of any of our models.
IDLE_PROVIDER = "AzureExecutionProvider"


def test_a_provider_that_computes_nothing_is_refused():
    with pytest.raises(errors.ProviderUnavailable, match=r"must compute this model.*none of its operations there"):
        NetworkRun(StereoSession(read_model(TINY_MODEL), provider=IDLE_PROVIDER), 32, 64)
    with pytest.raises(errors.ProviderUnavailable, match="must compute this model"):
        DepthEstimator(TINY_MODEL, provider=IDLE_PROVIDER)


def test_a_session_that_only_reads_a_model_runs_nothing():
    reader = StereoSession(read_model(TINY_MODEL), provider=IDLE_PROVIDER)
    views, maps = np.zeros((2, 3, 32, 64), np.uint8), np.zeros((2, 32, 64), np.float32)
    with pytest.raises(errors.InternalError, match="session: must be one for a size"):
        reader.bind(*views, *maps)


GPU, CPU = "CUDAExecutionProvider", _core.cpu_provider


def check_placement(provider: str, counts: dict[str, dict[str, int]], model: bytes = b"") -> None:
    """Check a placement of nodes without names: they are told by their operations."""
    nodes = {name: [(operation, "") for operation in Counter(kinds).elements()] for name, kinds in counts.items()}
    _core.check_placement(provider, nodes, model, "the model")


@pytest.mark.parametrize("elsewhere", [{}, {"Shape": 3, "Gather": 2, "Cast": 1, "Concat": 4}], ids=["none", "shapes"])
def test_shapes_may_stay_on_the_processor(elsewhere):
    check_placement(GPU, {GPU: {"Conv": 22, "Add": 3}, CPU: elsewhere})


@pytest.mark.parametrize(
    ("elsewhere", "said"),
    [
        ({"Conv": 2, "Shape": 1}, "got 2 Conv on CPUExecutionProvider"),
        ({"QuantizeLinear": 49, "FusedConv": 1}, "got 1 FusedConv, 49 QuantizeLinear on CPUExecutionProvider"),
        ({"Resize": 1}, "got 1 Resize on CPUExecutionProvider"),
    ],
)
def test_all_other_operations_may_not(elsewhere, said):
    with pytest.raises(errors.ProviderUnavailable, match=said):
        check_placement(GPU, {GPU: {"Conv": 20}, CPU: elsewhere})


def test_a_library_for_the_processor_may_leave_it_all_but_the_heavy_operations():
    xnnpack = _core.full_provider_name("xnnpack")
    check_placement(xnnpack, {xnnpack: {"Conv": 20}, CPU: {"Resize": 1, "Exp": 3}})
    with pytest.raises(errors.ProviderUnavailable, match="1 MatMul"):
        check_placement(xnnpack, {xnnpack: {"Conv": 20}, CPU: {"Resize": 1, "MatMul": 1}})
    with pytest.raises(errors.ProviderUnavailable, match="none of its operations"):
        check_placement(xnnpack, {CPU: {"Resize": 1}})


# A model that shifts the left picture by its right neighbour's value, and adds a column number.
ARITHMETIC = """
<ir_version: 10, opset_import: ["" : 18]>
example (uint8[1, 3, H, W] left, uint8[1, 3, H, W] right) => (float[1, 3, H, W] disparity)
<float half = {0.5}, float least = {0.0}, int64 one = {1}>
{
    [read] floats = Cast<to = 1>(left)
    [scale] scaled = Mul(floats, half)
    [clip] clipped = Max(scaled, least)
    [index] column = Cast<to = 7>(clipped)
    [next] beside = Add(column, one)
    [shown] gathered = GatherElements<axis = 3>(floats, beside)
    [sides] shape = Shape(left)
    [rows] row = Cast<to = 1>(shape)
    [middle] centre = Mul(row, half)
    [above] larger = Greater(scaled, least)
    [chosen] kept = Where(larger, gathered, scaled)
    [sum] disparity = Add(kept, scaled)
}
"""


def arithmetic() -> tuple[bytes, dict[str, tuple[str, str]]]:
    """The model's bytes, and operation and name of each node."""
    model = onnx.parser.parse_model(ARITHMETIC)
    return model.SerializeToString(), {node.name: (node.op_type, node.name) for node in model.graph.node}


@pytest.mark.parametrize(
    "names",
    [
        ("read",),
        ("clip", "index", "next"),
        ("sides", "rows", "middle"),
        ("above",),
    ],
    ids="+".join,
)
def test_reading_indices_and_shapes_may_stay_on_the_processor(names):
    model, nodes = arithmetic()
    _core.check_placement(GPU, {GPU: [("Conv", "c")], CPU: [nodes[name] for name in names]}, model, "the model")


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("scale",), "got 1 Mul on CPU"),
        (("read", "scale", "index", "next"), "got 1 Mul on CPU"),
        (("sum", "chosen"), "got 1 Add, 1 Where on CPU"),
    ],
    ids=["alone", "before an index", "output"],
)
def test_floats_of_pictures_may_not(names, said):
    model, nodes = arithmetic()
    with pytest.raises(errors.ProviderUnavailable, match=said):
        _core.check_placement(GPU, {GPU: [("Conv", "c")], CPU: [nodes[name] for name in names]}, model, "the model")


def test_a_file_that_is_no_model_has_no_placement():
    with pytest.raises(errors.ModelUnreadable, match="the model must be an ONNX file"):
        _core.check_placement(GPU, {GPU: [("Conv", "c")], CPU: [("Add", "a")]}, b"\x0b", "the model")


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        ([("device_id", "0")], "must map keys to texts"),
        ({"device_id": 0.5}, "texts or whole numbers"),
        ({1: "0"}, "texts or whole numbers"),
        ({"": "0"}, "must have a key"),
        ({"device_id": 0}, "must be empty for the processor"),
    ],
)
def test_provider_options_are_checked(options, rule):
    with pytest.raises(errors.InvalidArgument, match=rule):
        DepthEstimator(TINY_MODEL, provider_options=options)


def test_provider_options_as_text():
    read = _core.parse_provider_options(["device_id=1", "cache=a=b", "empty="])
    assert read == [("device_id", "1"), ("cache", "a=b"), ("empty", "")]
    with pytest.raises(errors.InvalidArgument, match="key=value"):
        _core.parse_provider_options(["device_id"])
    with pytest.raises(errors.InvalidArgument, match="a key once"):
        _core.checked_provider_options("cuda", [("device_id", "0"), ("device_id", "1")])


def test_a_provider_rounds_floats_only_where_asked_to():
    """Rounded to 10 bits, what a convolution multiplies moves disparities where two planes are nearly equal."""
    assert checked_options("cuda", {"device_id": 1}) == {"device_id": "1", "use_tf32": "0"}
    assert checked_options("CUDAExecutionProvider", None) == {"use_tf32": "0"}
    assert checked_options("cuda", {"use_tf32": 1}) == {"use_tf32": "1"}
    assert checked_options("openvino", {"device_type": "GPU"}) == {"device_type": "GPU", "precision": "ACCURACY"}
    for chosen in ({"precision": "FP16"}, {"device_type": "GPU_FP16"}):
        assert checked_options("openvino", chosen) == chosen
    assert checked_options("webgpu", None) == {}
    assert checked_options("cpu", None) == {}


@pytest.mark.parametrize("key", ["enable_cuda_graph", "trt_cuda_graph_enable", "enableGraphCapture"])
def test_recorded_graphs_are_refused(key):
    """They would answer every frame as the one that was recorded."""
    _core.checked_provider_options("cuda", [(key, "0")])
    with pytest.raises(errors.InvalidArgument, match=f"must not record graphs.*'{key}=1'"):
        _core.checked_provider_options("cuda", [(key, "1")])


def test_missing_runtime_names_the_extra():
    code = (
        "import sys; sys.modules['onnxruntime'] = None\n"
        "from endosdk.runtime.session import load_runtime\n"
        "try: load_runtime()\n"
        "except ImportError as error: print(error.code.name, error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "RUNTIME_MISSING" in done.stdout
    assert "pip install 'onnxruntime>=" in done.stdout


def test_host_that_imported_the_runtime_first_is_warned():
    code = (
        "import os; os.environ.pop('ORT_DISABLE_TELEMETRY', None); os.environ['CI'] = '1'\n"  # CI keeps it silent here
        "import onnxruntime, warnings, endosdk\n"
        "from endosdk.runtime.session import load_runtime\n"
        "warnings.simplefilter('error')\n"
        "try: load_runtime()\n"
        "except RuntimeWarning as warning: print(warning)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "telemetry on" in done.stdout


def test_failure_inside_the_runtime_has_a_code():
    session = tiny()
    run = NetworkRun(session, 32, 64)
    # Shapes that contradict the graph make the runtime itself fail.
    run.bound.binding.bind_input("left", "cpu", 0, np.uint8, (1, 3, 8, 8), run.left.ctypes.data)
    with pytest.raises(errors.InferenceFailed):
        run()


def test_origin_is_in_the_message():
    with pytest.raises(errors.ModelUnreadable, match="elsewhere"):
        StereoSession(ModelFile(b"x", "elsewhere", ""))
