"""Sizes of rendered polyps and instruments: the intervals hold the truth as often as they say."""

from __future__ import annotations

from collections import defaultdict

import numpy as np
import pytest

from benchmarks.accuracy.measuring import measurements, objects, pieces, score, with_true_depth
from endosdk import DepthEstimator, StereoCalibration
from endosdk.errors import DependencyMissing, RendererUnavailable
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.sample import DisparityLimits, render_sample

CAMERA = StereoCamera(width=960, height=720, focal_px=400.0, baseline_mm=10.0)
# Of the test set endosim-gi: the first that show a polyp, and instruments.
SEEDS = (2020500001, 2020500004, 2020500005, 2020500006, 2020500011, 2020500013, 2020500014, 2020500027)


@pytest.mark.slow
def test_intervals_hold_the_sizes_of_polyps_and_instruments() -> None:
    try:
        renderer = Rasteriser()
    except (DependencyMissing, RendererUnavailable) as error:
        pytest.skip(f"no renderer (Debian: apt-get install libegl1 libgl1-mesa-dri): {error}")
    rig = StereoCalibration.rectified(focal_px=CAMERA.focal_px, baseline_mm=CAMERA.baseline_mm, size=(960, 720))
    estimator = DepthEstimator("fast", calibration=rig)
    rng = np.random.default_rng(0)
    held = defaultdict(list)
    kinds = []
    for seed in SEEDS:
        sample = render_sample(renderer, seed, "gi", CAMERA, DisparityLimits())
        result = estimator.predict(sample.left, sample.right)
        truth = with_true_depth(result, sample.disparity)
        for kind, mask in objects(renderer, sample):
            for piece in pieces(mask):
                kinds.append(kind)
                for name, found, true in measurements(result, truth, piece, rng):
                    held[name].append(score(found, true)[:2])
    renderer.close()
    assert {"polyp", "instrument"} <= set(kinds)
    shares = {name: float(np.mean([holds for holds, _ in values])) for name, values in held.items()}
    sizes = {name: float(np.sqrt(np.mean([off**2 for _, off in values]))) for name, values in held.items()}
    print(len(kinds), "objects;", shares, sizes)
    assert shares["depth"] >= 0.88
    assert shares["distance"] >= 0.88
    assert shares["area"] >= 0.85
    # Eight objects are too few for one miss in twenty. But intervals that are far too wide would hold all as well.
    assert sizes["depth"] >= 0.3  # standard errors
    assert sizes["distance"] >= 0.3
