import numpy as np
import pytest
import torch

from endosdk.datasets.dataset import Sample
from endosdk.training.data import Crops
from endosdk.training.frame_size import reduced_truth, reduced_view, reduction
from endosdk.training.networks import build_network
from endosdk.training.validation import predict_frames


@pytest.mark.parametrize(("width", "factor"), [(320, 1), (480, 1), (700, 1), (960, 2), (1280, 3), (1920, 4)])
def test_frames_are_reduced_by_the_nearest_whole_factor(width, factor):
    assert reduction(width, 480) == factor
    assert reduction(width, None) == 1


def test_a_view_becomes_the_mean_of_its_blocks():
    rng = np.random.default_rng(0)
    view = rng.integers(0, 256, (7, 9, 3), dtype=np.uint8)
    blocks = view[:6, :8].reshape(3, 2, 4, 2, 3).mean(axis=(1, 3))
    np.testing.assert_allclose(reduced_view(view, 2), blocks, atol=0.51)
    assert reduced_view(view, 1) is view


def test_disparity_shrinks_with_its_map_and_keeps_edges_and_holes():
    truth = np.full((4, 6), 10.0, np.float32)
    truth[0, 1] = 10.5  # one surface: the mean counts
    truth[:, 3:] = 30.0  # an edge through the middle blocks
    truth[2, 4] = np.nan
    found = reduced_truth(truth, 2)
    np.testing.assert_allclose(found[0], [10.125 / 2, 30.0 / 2, 30.0 / 2])
    # The block with a hole is no one surface: its middle pixel decides.
    np.testing.assert_allclose(found[1], [10.0 / 2, 30.0 / 2, 30.0 / 2])


class OneFrame:
    name, sha256 = "one", "0" * 64

    def __init__(self, height, width):
        rng = np.random.default_rng(1)
        left, right = rng.integers(0, 256, (2, height, width, 3), dtype=np.uint8)
        self.sample = Sample("0", left, right, np.full((height, width), 20.0, np.float32), None, None, 400.0, 10.0)

    def __len__(self):
        return 1

    def __getitem__(self, index):
        return self.sample


def test_crops_come_at_the_width_the_network_is_made_for():
    crops = Crops(OneFrame(128, 960), [0], (64, 480), seed=0, augment=False, inference_width=480)
    left, _, truth = crops[0]
    assert left.shape == (3, 64, 480)
    assert truth.unique().tolist() == [10.0]


def test_maps_come_back_at_the_size_of_the_frame():
    network = build_network("fast", 48).eval()
    reader = OneFrame(101, 963)
    (frame,) = predict_frames(network, reader, [0])
    assert all(found.shape == (101, 963) for found in frame.maps)
    assert frame.evidence.shape == (5, 101, 963)
    # What the network answers at half the width is half of what the frame's pixels say.
    half = torch.from_numpy(np.ascontiguousarray(reduced_view(reader.sample.left, 2).transpose(2, 0, 1)))[None].float()
    other = torch.from_numpy(np.ascontiguousarray(reduced_view(reader.sample.right, 2).transpose(2, 0, 1)))[
        None
    ].float()
    pad = (0, -half.shape[3] % 8, 0, -half.shape[2] % 8)
    with torch.inference_mode():
        direct = network(*(torch.nn.functional.pad(v, pad, mode="replicate") for v in (half, other))).disparities[-1]
    np.testing.assert_allclose(frame.maps[-1][50, 480], 2 * direct[0, 0, 12:13, 119:121].mean(), rtol=0.05, atol=0.3)
