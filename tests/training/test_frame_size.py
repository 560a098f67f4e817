import cv2
import numpy as np
import pytest
import torch

from endosdk import DepthEstimator
from endosdk.datasets.dataset import Sample
from endosdk.training import checkpoint
from endosdk.training.data import Crops
from endosdk.training.frame_size import seen_size, seen_truth, seen_views
from endosdk.training.networks import build_network
from endosdk.training.validation import predict_frames
from tests.training.warped_scenes import warped_pair


@pytest.mark.parametrize(
    ("frame", "seen"),
    [
        ((320, 240), (480, 360)),
        ((480, 270), (480, 270)),
        ((640, 480), (480, 360)),
        ((1280, 720), (480, 270)),
        ((1920, 1080), (480, 270)),
    ],
)
def test_frames_are_seen_at_the_inference_width(frame, seen):
    assert seen_size(*frame, 480) == seen


def test_a_view_at_half_the_width_is_the_mean_of_its_blocks():
    rng = np.random.default_rng(0)
    left, right = rng.integers(0, 256, (2, 12, 16, 3), dtype=np.uint8)
    for view, found in zip((left, right), seen_views(left, right, (8, 6)), strict=True):
        blocks = view.reshape(6, 2, 8, 2, 3).mean(axis=(1, 3))
        np.testing.assert_allclose(found.transpose(1, 2, 0), blocks, atol=1.0)
    padded = seen_views(left, right, (8, 6), 4)[0]
    assert padded.shape == (3, 8, 8)
    np.testing.assert_array_equal(padded[:, 6:], np.repeat(padded[:, 5:6], 2, axis=1))


def test_disparity_shrinks_with_its_map_and_keeps_edges_and_holes():
    truth = np.full((4, 6), 10.0, np.float32)
    truth[0, 1] = 10.5  # one surface: the mean counts
    truth[:, 3:] = 30.0  # an edge through the middle blocks
    truth[2:, 4:] = np.nan
    found = seen_truth(truth, (3, 2))
    np.testing.assert_allclose(found[0], [10.125 / 2, 30.0 / 2, 30.0 / 2])
    np.testing.assert_allclose(found[1], [10.0 / 2, 30.0 / 2, np.nan])
    assert seen_truth(truth, (6, 4)) is truth


@pytest.mark.parametrize("width", [640, 720, 960])
def test_disparity_at_any_width_is_that_of_a_plane(width):
    x = np.arange(width, dtype=np.float32)
    truth = np.tile(20.0 + 0.01 * x, (width * 3 // 4, 1)).astype(np.float32)
    size = (480, 360)
    found = seen_truth(truth, size)
    centres = (np.arange(480) + 0.5) * width / 480 - 0.5
    np.testing.assert_allclose(found[10, 2:-2], (20.0 + 0.01 * centres[2:-2]) * 480 / width, atol=0.01)


@pytest.mark.parametrize("width", [320, 600, 640, 720, 960, 1280])
def test_no_pixel_of_an_edge_has_a_surface_between(width):
    for edge in range(width // 2, width // 2 + 12):
        truth = np.full((width * 3 // 4, width), 10.0, np.float32)
        truth[:, edge:] = 40.0
        truth[width // 3 :] += 60.0
        found = np.unique(seen_truth(truth, (480, 360)) * (width / 480))
        assert np.abs(found[:, None] - [10.0, 40.0, 70.0, 100.0]).min(axis=1).max() < 1e-3


class Pairs:
    name, sha256 = "one", "0" * 64

    def __init__(self, left, right, disparity):
        self.sample = Sample("0", left, right, disparity, None, None, 400.0, 10.0)

    def __len__(self):
        return 1

    def __getitem__(self, index):
        return self.sample


def noise(height, width):
    rng = np.random.default_rng(1)
    return Pairs(
        *rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8), np.full((height, width), 20.0, np.float32)
    )


def test_crops_come_at_the_width_the_network_is_made_for():
    crops = Crops(noise(128, 960), [0], (64, 480), seed=0, augment=False, inference_width=480)
    left, _, truth = crops[0]
    assert left.shape == (3, 64, 480)
    assert truth.unique().tolist() == [10.0]


def test_maps_come_back_at_the_size_of_the_frame():
    network = build_network("fast", 48).eval()
    reader = noise(101, 963)
    (frame,) = predict_frames(network, reader, [0])
    assert all(found.shape == (101, 963) for found in frame.maps)
    assert frame.columns.shape == (7, 101, 963)
    # What the network answers at the width that it sees is less than what the frame's pixels say, by the reduction.
    size = seen_size(963, 101, 480)
    assert frame.reduction == 963 / 480
    views = [torch.from_numpy(v)[None].float() for v in seen_views(reader.sample.left, reader.sample.right, size, 8)]
    with torch.inference_mode():
        direct = network(*views).disparities[-1]
    near = direct[0, 0, 12:14, 119:121].mean() * 963 / 480
    np.testing.assert_allclose(frame.maps[-1][51, 481], near, rtol=0.05, atol=0.3)


@pytest.mark.parametrize("width", [640, 720, 960, 1280, 1920])
def test_training_sees_and_scores_a_frame_as_the_deployed_model_does(width):
    """The shipped weights, by torch here and by the runtime: the same pictures, and the same error."""
    small = warped_pair(11, (270, 480), (6.0, 30.0))
    size = (width, round(width * 0.5625))
    left, right, disparity = (cv2.resize(part, size, interpolation=cv2.INTER_CUBIC) for part in small)
    disparity = disparity * (width / 480)
    network = checkpoint.load(checkpoint.starting_point("fast")).build()
    (frame,) = predict_frames(network, Pairs(left, right, disparity), [0])
    deployed = DepthEstimator("fast-fp32", min_confidence=0.0).predict(left, right)
    known = np.isfinite(deployed.disparity)
    assert known.mean() > 0.9
    errors = [np.abs(found - disparity)[known].mean() for found in (frame.maps[-1], deployed.disparity)]
    assert errors[0] == pytest.approx(errors[1], rel=0.08)
    assert np.median(np.abs(frame.maps[-1] - deployed.disparity)[known]) < 0.05 * width / 480
