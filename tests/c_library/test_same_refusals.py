"""Bad input is refused by both faces with the same code and the same words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

import endosdk
from endosdk import _core
from endosdk.runtime.models import shipped_models
from tests.c_library import binding as c
from tests.c_library.test_errors import WEIGHTS_OUTSIDE, claim, drop_metadata, edited_model, rename_input
from tests.conftest import TINY_MODEL, shifted_pair
from tests.runtime.test_session import IDLE_PROVIDER

WIDTH, HEIGHT = 160, 96
LEFT, RIGHT = shifted_pair(HEIGHT, WIDTH, 9)


@dataclass(frozen=True)
class Case:
    """What is done wrong, in the words of each face."""

    name: str
    python: dict[str, Any] = field(default_factory=dict)
    c: dict[str, Any] = field(default_factory=dict)
    right: np.ndarray | None = None  # instead of the right view that fits
    model: Callable[[], Any] = lambda: TINY_MODEL
    rig_size: tuple[int, int] | None = None
    depth: bool = False


def damaged_model(seed: int) -> bytes:
    """A shipped model with one bit turned over, somewhere before its seal."""
    data = bytearray(shipped_models()["fast"].read_bytes())
    rng = np.random.default_rng(seed)
    data[rng.integers(0, data.index(_core.seal_mark))] ^= 1 << rng.integers(0, 8)
    return bytes(data)


def same(name: str, **settings: Any) -> Case:
    """A setting that both faces call by one name."""
    return Case(name, python=settings, c=settings)


NAN, INF = float("nan"), float("inf")
SMALLER = RIGHT[: HEIGHT - 8].copy()
CASES = [
    same("too many threads", threads=257),
    same("fewer threads than none", threads=-1),
    same("confidence above one", min_confidence=1.5),
    same("confidence below zero", min_confidence=-0.1),
    same("confidence that is no number", min_confidence=NAN),
    same("deadline in the past", deadline_ms=-1.0),
    same("deadline that never comes", deadline_ms=INF),
    Case("a network without width", {"network_size": (0, 10)}, {"network_width": 0, "network_height": 10}),
    Case("a network too wide", {"network_size": (32768, 10)}, {"network_width": 32768, "network_height": 10}),
    Case("a network of negative height", {"network_size": (9, -3)}, {"network_width": 9, "network_height": -3}),
    Case("a range the wrong way", {"depth_range_mm": (50.0, 20.0)}, {"min_depth_mm": 50.0, "max_depth_mm": 20.0}),
    Case("a range behind the camera", {"depth_range_mm": (-1.0, 20.0)}, {"min_depth_mm": -1.0, "max_depth_mm": 20.0}),
    Case("a range that is no number", {"depth_range_mm": (NAN, 20.0)}, {"min_depth_mm": NAN, "max_depth_mm": 20.0}),
    Case("an unknown provider", {"provider": "warp-drive"}, {"provider": b"warp-drive"}),
    Case("a missing provider by its short name", {"provider": "cuda"}, {"provider": b"cuda"}),
    Case(
        "a missing provider by its full name",
        {"provider": "dmlexecutionprovider"},
        {"provider": b"DmlExecutionProvider"},
    ),
    Case("no provider", {"provider": ""}, {"provider": b""}),
    Case("a provider that computes nothing", {"provider": IDLE_PROVIDER}, {"provider": IDLE_PROVIDER.encode()}),
    Case("options of the processor", {"provider_options": {"a": 1}}, {"provider_options": c.texts("a=1")}),
    Case("an option without a key", {"provider_options": {"": "1"}}, {"provider_options": c.texts("=1")}),
    *(Case(f"damage {seed}", model=lambda seed=seed: damaged_model(seed)) for seed in range(20)),
    Case("views of two sizes", right=SMALLER),
    Case("views of two kinds", right=RIGHT[..., 0].copy()),
    Case("a rig of another size", rig_size=(320, 192)),
    Case("depth without a rig", depth=True),
    *(
        Case(change.__name__, model=lambda change=change: edited_model(change))
        for change in (
            drop_metadata,
            rename_input,
            claim("format_version", "2"),
            claim("channel_order", "bgr"),
            claim("training", "{not json"),
            claim("training", "[]"),
            claim("input_multiple", "0"),
            claim("output_stride", "-4"),
            claim("max_disparity", "many"),
            claim("max_disparity", "9999999999"),
            claim("max_candidate_disparity", "33"),
            claim("name", ""),
            claim("name", "../outside"),
            *WEIGHTS_OUTSIDE,
        )
    ),
]


def right_view(case: Case) -> np.ndarray:
    return RIGHT if case.right is None else case.right


def refused_by_python(case: Case) -> str:
    with pytest.raises(endosdk.EndoError) as caught:
        rig = None if case.rig_size is None else endosdk.StereoCalibration.rectified(200.0, 5.0, case.rig_size)
        result = endosdk.DepthEstimator(case.model(), calibration=rig, **case.python).predict(LEFT, right_view(case))
        assert case.depth
        _ = result.depth
    return str(caught.value)


def refused_by_c(library: Any, case: Case) -> str:
    with pytest.raises(c.CError) as caught:
        rig = None if case.rig_size is None else endosdk.StereoCalibration.rectified(200.0, 5.0, case.rig_size)
        estimator = c.CEstimator(library, case.model(), rig, **case.c)
        try:
            estimator.predict(LEFT, right_view(case), maps=("depth",) if case.depth else ("disparity",))
        finally:
            estimator.close()
    return str(caught.value)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_both_faces_say_the_same(library, case):
    pytest.importorskip("onnx", reason="no onnx: pip install 'endosdk[train]'")
    said = refused_by_python(case)
    assert said.endswith("]") and "; got " in said
    assert refused_by_c(library, case) == said
