"""A rendered sample: the same for the same seed, within its limits, and the two views agree with the truth."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from endosdk.datasets.dataset import Sample
from endosdk.errors import InvalidArgument
from endosdk.simulation.camera import StereoCamera, rectified_pair
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.sample import (
    DisparityLimits,
    draw_light,
    draw_truth,
    load_scene,
    place_camera,
    render_sample,
)
from endosdk.simulation.scene import ORGANS, draw_scene
from tests.simulation.conftest import SMALL
from tests.simulation.matched_views import at_match

LIMITS = DisparityLimits(0.5, 17.5)


@pytest.fixture(scope="module")
def samples(renderer: Rasteriser) -> dict[str, Sample]:
    return {organ: render_sample(renderer, 11, organ, SMALL, LIMITS) for organ in ORGANS}


@pytest.mark.parametrize("organ", ORGANS)
def test_a_sample_keeps_its_limits_and_has_truth_nearly_everywhere(samples: dict[str, Sample], organ: str) -> None:
    sample = samples[organ]
    assert sample.left.shape == sample.right.shape == (180, 240, 3)
    assert sample.left.dtype == np.uint8
    assert sample.disparity_right is not None
    for disparity in (sample.disparity, sample.disparity_right):
        assert np.nanmax(disparity) <= LIMITS.largest
        assert (disparity[np.isfinite(disparity)] < LIMITS.smallest).mean() < 0.01
        assert np.isnan(disparity).mean() < 0.01
    assert np.nanmax(sample.disparity) > 0.3 * LIMITS.largest
    assert 15 < sample.left.mean() < 240


@pytest.mark.parametrize("organ", ORGANS)
def test_left_and_right_truth_agree_where_both_see(samples: dict[str, Sample], organ: str) -> None:
    sample = samples[organ]
    assert sample.occlusion is not None
    assert sample.disparity_right is not None
    assert sample.occlusion.mean() < 0.25
    gap = np.abs(at_match(sample.disparity_right, sample.disparity) - sample.disparity)
    error = np.where(np.isfinite(gap), gap, np.inf)  # a neighbour without truth is no agreement
    # Where branches meet a duct, single pixels may have no truth; the comparison has none beside them.
    known = np.isfinite(error)
    assert known[~sample.occlusion].mean() > 0.995
    # The comparison interpolates between two pixels, which is exact where the surface is straight along the row.
    bend = np.abs(sample.disparity[:, :-2] - 2 * sample.disparity[:, 1:-1] + sample.disparity[:, 2:])
    bent = cv2.dilate(np.pad(bend, ((0, 0), (1, 1)), constant_values=9.0), np.ones((5, 5))) > 0.05
    plain = known & ~bent & (cv2.erode((~sample.occlusion).astype(np.uint8), np.ones((5, 5))) > 0)
    assert plain.mean() > 0.5
    assert np.quantile(error[plain], 0.99) < 0.01
    # Elsewhere, too, most pixels agree: what is called visible has its match.
    assert np.quantile(error[known & ~sample.occlusion], 0.95) < 0.05


@pytest.mark.parametrize("organ", ["intestine", "abdomen"])
def test_views_match_best_at_the_true_disparity(renderer: Rasteriser, organ: str) -> None:
    camera = StereoCamera(480, 360, 200.0, 10.0)
    scene = draw_scene(12, organ)
    load_scene(renderer, scene, camera)
    pair = rectified_pair(camera)
    placed, truth = draw_truth(
        renderer, place_camera(renderer, scene, camera, DisparityLimits(1, 35)), pair, DisparityLimits(1, 35)
    )
    light = [
        draw_light(renderer, v, placed, pair, d, (placed.pose,))
        for v, d in zip((pair.left, pair.right), truth, strict=True)
    ]
    # Highlights move with the eye, so the darker tones alone are compared.
    left, right = (np.minimum(view[..., 1], np.quantile(view[..., 1], 0.9)) for view in light)
    error = {
        shift: float(np.median(np.abs(at_match(right, truth[0], shift) - left))) for shift in (-1, -0.5, 0, 0.5, 1)
    }
    assert min(error, key=lambda shift: error[shift]) == 0
    assert error[0] < 0.8 * min(error[-0.5], error[0.5])


@pytest.mark.parametrize("seed", [2020000127, 2020500031])
def test_a_tool_that_would_lie_at_a_lens_is_left_out(renderer: Rasteriser, seed: int) -> None:
    scene = draw_scene(seed, "gi")
    assert scene.instrument is not None
    load_scene(renderer, scene, SMALL, painted=False)
    placed = place_camera(renderer, scene, SMALL, DisparityLimits(2 / 4, 69.5 / 4))
    assert placed.scene.instrument is None
    assert placed.scale < 30


def test_the_same_seed_gives_the_same_bits(renderer: Rasteriser, samples: dict[str, Sample]) -> None:
    again = render_sample(renderer, 11, "stomach", SMALL, LIMITS)
    other = render_sample(renderer, 12, "stomach", SMALL, LIMITS)
    first = samples["stomach"]
    for name in ("left", "right", "disparity", "disparity_right", "occlusion"):
        assert getattr(again, name).tobytes() == getattr(first, name).tobytes()
    assert again.info == first.info
    assert other.left.tobytes() != first.left.tobytes()


@pytest.mark.parametrize(("smallest", "largest"), [(0.0, 60.0), (30.0, 20.0), (2.0, 300.0), (10.0, 30.0)])
def test_impossible_limits_are_refused(smallest: float, largest: float) -> None:
    with pytest.raises(InvalidArgument, match=r"^limits: "):
        DisparityLimits(smallest, largest)


@pytest.mark.parametrize(
    ("name", "values"),
    [("width", (8, 100, 90.0, 8.0)), ("focal_px", (160, 120, 0.0, 8.0)), ("baseline_mm", (160, 120, 90.0, -1.0))],
)
def test_an_impossible_camera_is_refused(name: str, values: tuple[int, int, float, float]) -> None:
    with pytest.raises(InvalidArgument, match=f"^{name}: "):
        StereoCamera(*values)
