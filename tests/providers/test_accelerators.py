"""Providers that compute: where they put the models, that their answers are the processor's, in Python, C and CLI."""

from __future__ import annotations

import ctypes
import hashlib
import json
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import onnx
import pytest

from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, StereoCalibration, _core
from endosdk.commands.cli import main
from endosdk.errors import ProviderUnavailable
from endosdk.io.pictures import read_frame
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.providers import checked_options, provider_name
from endosdk.runtime.session import StereoSession
from endosdk.training.model_file import sealed_bytes, write_model
from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

# Without those of 8-bit integers, for which an accelerator gets the float32 model.
MODELS = [TINY_MODEL.stem, *sorted({read_model(name, integer_units=False).origin for name in shipped_models()})]
SIZES = [(96, 160), (64, 128)]
SAMPLES = ROOT / "examples" / "data"
LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int32, ctypes.c_char_p)


def estimator(accelerator, **options) -> DepthEstimator:
    return DepthEstimator(
        TINY_MODEL, provider=accelerator.name, provider_options=accelerator.options, network_size=(128, 64), **options
    )


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.rpartition("/")[2])
def test_every_model_is_computed_there(accelerator, model):
    """The session itself refuses a placement that is not the provider's; here what it found is looked at once more."""
    file = read_model(TINY_MODEL if model == TINY_MODEL.stem else model)
    reader = StereoSession(file, provider=accelerator.name, provider_options=accelerator.options)
    session = reader.for_size(96, 192)
    assert session is not None
    assert session.for_size(96, 192) is None
    nodes = session.placed_nodes()
    assert nodes[provider_name(accelerator.name)]
    elsewhere = {operation for operation, _ in nodes.get(_core.cpu_provider, [])}
    assert not {name for name in elsewhere if "Conv" in name or "MatMul" in name or name == "Shape"}


def test_the_processor_reads_pictures_and_limits_columns_alone(accelerator):
    """What each of them computed, and how much, is what the runtime's profiler saw in a run."""
    file = read_model("fast-fp32")
    height, width = 64, 96
    reader = StereoSession(file, provider=accelerator.name, provider_options=accelerator.options)
    here, there = computed(reader, file.data, height, width)
    assert there
    names = {name for _, name in reader.for_size(height, width).placed_nodes().get(_core.cpu_provider, [])}
    assert {node.name for node in here} <= names
    for node in here:
        assert "Conv" not in node.operation and "MatMul" not in node.operation
        # Both pictures as floats, and one float for the column of each pixel.
        most = 2 * 3 if node.operation == "Cast" else 1
        assert node.floats <= most * height * width, node


class Computed(NamedTuple):
    """A node that has run, and how many floats it gave."""

    operation: str
    name: str
    floats: int


def computed(reader: StereoSession, data: bytes, height: int, width: int) -> tuple[list[Computed], list[Computed]]:
    """What the processor and the provider compute of a model, as the runtime's profiler saw it."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    options.enable_profiling = True
    for shape in reader.input_shapes.values():
        for side, length in zip(shape, (1, 3, height, width), strict=True):
            if isinstance(side, str):
                options.add_free_dimension_override_by_name(side, length)
    with TemporaryDirectory() as folder:
        options.profile_file_prefix = f"{folder}/profile"
        providers = [(reader.provider, reader.provider_options)]
        session = onnxruntime.InferenceSession(data, options, providers=providers)
        session.run(None, dict.fromkeys(("left", "right"), np.zeros((1, 3, height, width), np.uint8)))
        events = json.loads(Path(session.end_profiling()).read_text())
    nodes: dict[bool, list[Computed]] = {True: [], False: []}
    for event in events:
        if event["cat"] == "Node" and event["name"].endswith("_kernel_time"):
            told = event["args"]
            outputs = [one for output in told["output_type_shape"] for one in output.items()]
            floats = sum(int(np.prod(sides)) for kind, sides in outputs if "float" in kind)
            node = Computed(told["op_name"], event["name"].removesuffix("_kernel_time"), floats)
            nodes[told["provider"] == _core.cpu_provider].append(node)
    return nodes[True], nodes[False]


def test_arithmetic_of_pictures_on_the_processor_is_refused(accelerator):
    """WebGPU has no remainder of floats; its name is that of an operation on shapes, too."""
    if accelerator.name != "webgpu":
        pytest.skip("OpenVINO has every operation")
    model = onnx.load(TINY_MODEL)
    model.graph.initializer.append(onnx.helper.make_tensor("large", onnx.TensorProto.FLOAT, [], [1e6]))
    for node in model.graph.node:
        node.output[:] = ["before" if name == "disparity" else name for name in node.output]
    model.graph.node.append(onnx.helper.make_node("Mod", ["before", "large"], ["disparity"], name="wrap", fmod=1))
    with pytest.raises(
        ProviderUnavailable, match="arithmetic of shapes and indices; got 1 Mod on CPUExecutionProvider"
    ):
        DepthEstimator(sealed_bytes(model), provider=accelerator.name, provider_options=accelerator.options)


def check_answers(accelerator, model, sizes) -> None:
    """Both sessions see the same pair of a plane at 9 px, at each (height, width)."""
    processor = StereoSession(model)
    here = StereoSession(model, provider=accelerator.name, provider_options=accelerator.options)
    for height, width in sizes:
        answers = []
        for session in (processor, here):
            run = NetworkRun(session, height, width)
            for target, view in zip((run.left, run.right), shifted_pair(height, width, 9), strict=True):
                target[:] = view.transpose(2, 0, 1)
            run()
            answers.append((run.disparity.copy(), run.confidence.copy()))
        np.testing.assert_allclose(answers[1][0], answers[0][0], rtol=0, atol=accelerator.tolerance_px)
        np.testing.assert_allclose(answers[1][1], answers[0][1], rtol=0, atol=accelerator.tolerance_px)
        assert np.median(answers[1][0]) == pytest.approx(9, abs=0.5)


def test_answers_are_those_of_the_processor_at_every_size(accelerator):
    check_answers(accelerator, read_model(TINY_MODEL), [*SIZES, SIZES[0]])


@pytest.mark.parametrize("model", MODELS[1:], ids=lambda model: model.rpartition("/")[2])
def test_answers_of_every_shipped_model_are_those_of_the_processor(accelerator, model):
    check_answers(accelerator, read_model(model), SIZES[1:])


def test_answers_on_real_frames_are_those_of_the_processor(accelerator):
    """A pair of a real endoscope's look, at the size at which `fast` sees every frame."""
    rig = StereoCalibration.load(SAMPLES / "rig.json")
    pair = [read_frame(SAMPLES / "demo" / f"{side}.png") for side in ("left", "right")]
    options = {"calibration": rig, "network_size": (480, 360)}
    there = {"provider": accelerator.name, "provider_options": accelerator.options}
    answers = []
    for provider in ({}, there):
        with DepthEstimator("fast-fp32", **options, **provider) as estimator:
            answers.append(estimator.predict(*pair))
    expected, found = answers
    np.testing.assert_allclose(found.disparity, expected.disparity, rtol=0, atol=2 * accelerator.tolerance_px)
    np.testing.assert_allclose(found.confidence, expected.confidence, rtol=0, atol=accelerator.tolerance_px)
    assert np.mean(found.reasons != expected.reasons) < 1e-3
    assert np.mean(expected.reasons == 0) > 0.8


def test_shipped_models_pass_their_self_test(accelerator):
    if accelerator.software:
        pytest.skip("takes minutes on a software driver")
    for model in ("fast-fp32", "accurate-fp32"):
        with DepthEstimator(model, provider=accelerator.name, provider_options=accelerator.options) as estimator:
            estimator.self_test()


@pytest.fixture(scope="module")
def reading_there(tmp_path_factory):
    """A model whose pictures are read by the provider, in memory of its own where it has some, as cards do.

    WebGPU has no conversion of 8-bit integers, and lets the processor read them; it has one with a scale.
    """
    model = onnx.load(TINY_MODEL)
    model.graph.initializer.append(onnx.helper.make_tensor("one", onnx.TensorProto.FLOAT, [], [1.0]))
    readers = [node for node in model.graph.node if set(node.input) & {"left", "right"}]
    assert [node.op_type for node in readers] == ["Cast", "Cast"]
    for node in readers:
        node.op_type = "DequantizeLinear"
        node.input.append("one")
        del node.attribute[:]
    path = tmp_path_factory.mktemp("model") / "reading-there.onnx"
    write_model(model, path)
    return path


def test_a_frame_is_never_answered_as_one_before(accelerator, reading_there, library):
    """Providers with memory of their own copy inputs when they are bound, and see no later change."""
    pairs = [shifted_pair(64, 128, disparity, seed=disparity) for disparity in (9, 5, 7)]
    c_options = c.texts(*(f"{key}={value}" for key, value in accelerator.options.items()))
    sizes = {"network_width": 128, "network_height": 64}
    in_c = c.CEstimator(library, reading_there, provider=accelerator.name.encode(), provider_options=c_options, **sizes)
    options = {"provider": accelerator.name, "provider_options": accelerator.options, "network_size": (128, 64)}
    with DepthEstimator(reading_there, **options) as there, DepthEstimator(TINY_MODEL, network_size=(128, 64)) as here:
        streamed = [result.disparity.copy() for result in there.stream(pairs)]
        for number, pair in enumerate(pairs):
            expected = here.predict(*pair).disparity
            answers = [
                there.predict(*pair).disparity,
                streamed[number],
                in_c.predict(*pair, maps=("disparity",))[1]["disparity"],
            ]
            for found in answers:
                np.testing.assert_allclose(found, expected, rtol=0, atol=5 * accelerator.tolerance_px)
    in_c.close()


def test_frames_through_the_estimator(accelerator):
    left, right = shifted_pair(64, 128, 7)
    with estimator(accelerator) as there, DepthEstimator(TINY_MODEL, network_size=(128, 64)) as here:
        found, expected = there.predict(left, right), here.predict(left, right)
        report = there.diagnostics()
        streamed = [result.disparity.copy() for result in there.stream([(left, right)] * 2)]
    np.testing.assert_allclose(found.disparity, expected.disparity, rtol=0, atol=accelerator.tolerance_px)
    for disparity in streamed:
        np.testing.assert_allclose(disparity, found.disparity, rtol=0, atol=accelerator.tolerance_px)
    assert report["provider"] == provider_name(accelerator.name)
    assert report["provider_options"] == checked_options(accelerator.name, accelerator.options)


def test_a_provider_that_leaves_all_to_the_processor_is_refused(accelerator):
    """OpenVINO makes a session for a device that it does not have, and lets the processor compute it all."""
    if accelerator.name != "openvino":
        pytest.skip("WebGPU takes any option, and starts")
    with pytest.raises(ProviderUnavailable, match=r"must compute this model.*none of its operations there"):
        DepthEstimator(TINY_MODEL, provider="openvino", provider_options={"device_type": "NONSENSE"})


def test_the_c_library_gives_the_same(accelerator, library):
    left, right = shifted_pair(64, 128, 7)
    options = c.texts(*(f"{key}={value}" for key, value in accelerator.options.items()))
    there = c.CEstimator(
        library,
        TINY_MODEL,
        provider=accelerator.name.encode(),
        provider_options=options,
        network_width=128,
        network_height=64,
    )
    _, maps = there.predict(left, right, maps=("disparity",))
    report = json.loads(there.diagnostics())
    there.close()
    expected = DepthEstimator(TINY_MODEL, network_size=(128, 64)).predict(left, right)
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=accelerator.tolerance_px)
    assert report["provider"] == provider_name(accelerator.name)
    assert report["provider_options"] == checked_options(accelerator.name, accelerator.options)


def test_the_c_library_takes_the_float32_model_instead(accelerator, library):
    """Both files are stated, with their hashes; every result says which of them computed it."""
    lines = []
    log = LOG(lambda _, level, line: lines.append((level, line.decode())))
    paths = [shipped_models()[name] for name in ("fast", "fast-fp32")]
    own, other = (hashlib.sha256(path.read_bytes()).hexdigest().encode() for path in paths)
    there = c.CEstimator(
        library,
        paths[0],
        provider=accelerator.name.encode(),
        provider_options=c.texts(*(f"{key}={value}" for key, value in accelerator.options.items())),
        model_sha256=own,
        float32_model=bytes(paths[1]),
        float32_model_sha256=other,
        log=ctypes.cast(log, ctypes.c_void_p),
        network_width=128,
        network_height=64,
    )
    result, maps = there.predict(*shifted_pair(64, 128, 7), maps=("disparity",))
    report = json.loads(there.diagnostics())
    there.close()
    assert np.median(maps["disparity"]) == pytest.approx(7, abs=0.5)
    assert (report["model"]["name"], report["model"]["sha256"]) == ("fast-fp32", other.decode())
    assert (result.identity.model, result.identity.model_sha256) == (b"fast-fp32", other)
    assert (2, "there is no fast 8-bit arithmetic here: float32_model is used") in lines


def test_the_command_line_passes_options_on(accelerator, tmp_path, capsys):
    pair = [str(SAMPLES / "demo" / f"{side}.png") for side in ("left", "right")]
    options = [word for key, value in accelerator.options.items() for word in ("--provider-option", f"{key}={value}")]
    command = ["predict", *pair, "--calibration", str(SAMPLES / "rig.json"), "--model", str(TINY_MODEL), "--json"]
    command += ["--network-size", "128x96", "--provider", accelerator.name, *options, "--out", str(tmp_path)]
    main(command)
    assert json.loads(capsys.readouterr().out)["provider"] == provider_name(accelerator.name)
