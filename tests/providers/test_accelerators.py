"""Providers that compute: where they put the models, that their answers are the processor's, in Python, C and CLI."""

from __future__ import annotations

import json

import numpy as np
import onnx
import pytest

from benchmarks.network_run import NetworkRun
from endosdk import DepthEstimator, _core
from endosdk.commands.cli import main
from endosdk.errors import ProviderUnavailable
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.providers import checked_options, provider_name
from endosdk.runtime.session import StereoSession
from endosdk.training.model_file import write_model
from tests.c_library import binding as c
from tests.conftest import ROOT, TINY_MODEL, shifted_pair

# Without those of 8-bit integers, for which an accelerator gets the float32 model.
MODELS = [TINY_MODEL.stem, *sorted({read_model(name, integer_units=False).origin for name in shipped_models()})]
SIZES = [(96, 160), (64, 128)]
SAMPLES = ROOT / "examples" / "data"


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
    placement = session.placement()
    assert placement[provider_name(accelerator.name)]
    elsewhere = set(placement.get(_core.cpu_provider, {}))
    assert not {name for name in elsewhere if "Conv" in name or "MatMul" in name or name == "Shape"}


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
        there.self_test()
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
        there.self_test()
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
    there.self_test()
    _, maps = there.predict(left, right, maps=("disparity",))
    report = json.loads(there.diagnostics())
    there.close()
    expected = DepthEstimator(TINY_MODEL, network_size=(128, 64)).predict(left, right)
    np.testing.assert_allclose(maps["disparity"], expected.disparity, rtol=0, atol=accelerator.tolerance_px)
    assert report["provider"] == provider_name(accelerator.name)
    assert report["provider_options"] == checked_options(accelerator.name, accelerator.options)


def test_the_command_line_passes_options_on(accelerator, tmp_path, capsys):
    pair = [str(SAMPLES / "demo" / f"{side}.png") for side in ("left", "right")]
    options = [word for key, value in accelerator.options.items() for word in ("--provider-option", f"{key}={value}")]
    command = ["predict", *pair, "--calibration", str(SAMPLES / "rig.json"), "--model", str(TINY_MODEL), "--json"]
    command += ["--network-size", "128x96", "--provider", accelerator.name, *options, "--out", str(tmp_path)]
    main(command)
    assert json.loads(capsys.readouterr().out)["provider"] == provider_name(accelerator.name)
