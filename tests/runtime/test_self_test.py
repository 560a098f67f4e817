"""What the self test finds: flipped bits in memory, which no hash of a file tells of."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.studies.flipped_bits import Flip, Flipped, RealPair, frame_path, self_test_passes
from endosdk import DepthEstimator
from endosdk.errors import SelfTestFailed
from endosdk.runtime.models import read_model, shipped_models
from endosdk.runtime.session import StereoSession
from tests.conftest import ROOT
from tests.runtime.golden_answers import FILE

# Harmful bits of `fast`. The rule for models that are not shipped finds none of them.
HARMFUL = [
    Flip("network.features.0.first.conv.bias_quantized", 46, 0),
    Flip("network.refinement.refinement.layers.0.conv.bias_quantized_zero_point", 107, 4),
    Flip("network.refinement.refinement.layers.6.conv.bias_quantized_zero_point", 77, 7),
    Flip("network.aggregation.layers.1.bias_quantized_scale", 119, 6),
    Flip("network.volume.left.bias_quantized", 110, 2),
]


def answers_in_the_core() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Disparity and confidence of the cells, by the hash of the model."""
    found = {}
    for text in re.split(r"^    // ", FILE.read_text(), flags=re.MULTILINE)[1:]:
        numbers = np.array(re.findall(r"(\d+\.\d+)f", text), float)
        found[re.search(r'"([0-9a-f]{64})"', text)[1]] = np.split(numbers, 2)
    return found


@pytest.fixture(scope="module")
def compiled_in():
    return answers_in_the_core()


def test_every_shipped_file_has_an_answer_in_the_core(compiled_in):
    manifest = tomllib.loads((ROOT / "models" / "models.toml").read_text())
    assert list(compiled_in) == [entry["sha256"] for entry in manifest.values()]


@pytest.mark.parametrize("name", shipped_models())
def test_the_answers_in_the_core_are_those_of_the_files(name, compiled_in):
    """To half of what the self test allows: another processor rounds elsewhere."""
    session = StereoSession(read_model(name))
    disparity, confidence = frame_path(session).cells_of_answer()
    assert disparity.shape == confidence.shape == (9, 12)
    kept = compiled_in[session.sha256]
    np.testing.assert_allclose(disparity.ravel(), kept[0], rtol=0, atol=0.1)
    np.testing.assert_allclose(confidence.ravel(), kept[1], rtol=0, atol=0.015)


@pytest.mark.parametrize("size", [(64, 48), (480, 360)])
@pytest.mark.parametrize("name", ["fast", "fast-fp32", "wang2020"])
def test_shipped_models_pass_at_any_size(name, size):
    with DepthEstimator(shipped_models()[name], network_size=size) as estimator:
        estimator.self_test()


@pytest.fixture(scope="module")
def fast() -> Flipped:
    return Flipped(read_model("fast"))


@pytest.mark.parametrize("flip", HARMFUL, ids=lambda flip: flip.tensor)
def test_a_bit_that_harms_real_frames_is_noticed(flip, fast):
    session = fast.session(flip)
    assert RealPair(fast.session(None)).is_changed(session)
    assert not self_test_passes(session)
    assert self_test_passes(StereoSession(replace(session._model, sha256="0" * 64)))


def test_the_error_names_the_cell(fast):
    rule = r"must be what this model answered when it was released, \S+ to 0\.2 in cell \d+, \d+; got"
    with pytest.raises(SelfTestFailed, match=f"self test: disparity: {rule}"):
        frame_path(fast.session(HARMFUL[-1])).self_test()
