"""Tests of providers that compute: each runs in an environment of its own, which `make test-providers` sets up."""

from __future__ import annotations

import os
from dataclasses import dataclass

import pytest

from tests.c_library.conftest import installed as installed
from tests.c_library.conftest import library as library


@dataclass(frozen=True)
class Accelerator:
    """A provider, and what it needs to run without an accelerator. It sums in another order than the processor."""

    name: str
    options: dict[str, str]
    tolerance_px: float = 1e-3
    software: bool = False  # takes seconds for a frame


ACCELERATORS = {
    "openvino": Accelerator("openvino", {"device_type": "CPU"}),
    "webgpu": Accelerator("webgpu", {"dawnBackendType": "Vulkan"}, software=True),
}


@pytest.fixture(scope="session")
def accelerator() -> Accelerator:
    """The provider of this environment."""
    name = os.environ.get("ENDOSDK_TEST_PROVIDER")
    if name is None:
        pytest.skip("runs in environments of its own: make test-providers")
    return ACCELERATORS[name]
