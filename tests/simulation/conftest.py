"""The renderer that the tests of the simulation share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from endosdk.errors import DependencyMissing, RendererUnavailable
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.rasteriser import Rasteriser

SMALL = StereoCamera(width=240, height=180, focal_px=100.0, baseline_mm=10.0)


@pytest.fixture(scope="session")
def renderer() -> Iterator[Rasteriser]:
    try:
        one = Rasteriser()
    except (DependencyMissing, RendererUnavailable) as error:
        pytest.skip(f"no renderer (Debian: apt-get install libegl1 libgl1-mesa-dri): {error}")
    yield one
    one.close()
