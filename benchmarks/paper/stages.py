"""The error of every stage of a network that can be stopped early, on whole frames."""

from __future__ import annotations

import numpy as np
import torch

from benchmarks.methods.published import PublishedNetwork
from endosdk.datasets.dataset import DatasetReader
from endosdk.io.progress import progress
from endosdk.training.data import planar
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.validation import pad_to_multiple


@torch.inference_mode()
def stage_errors(network: StereoNetwork, reader: DatasetReader, pairs: int) -> list[float]:
    """Return the mean error, px, of each map from coarse to fine, over all truth of the first pairs."""
    if not isinstance(network, PublishedNetwork):
        return []
    network.eval()
    sums, pixels = np.zeros(len(network.stage_weights)), 0
    for index in progress(range(pairs), title="stages", stays=False):
        sample = reader[index]
        views = [
            pad_to_multiple(planar(view)[None].float(), network.input_multiple) for view in (sample.left, sample.right)
        ]
        height, width = sample.disparity.shape
        known = np.isfinite(sample.disparity)
        pixels += int(known.sum())
        maps = network.stages(views[0], views[1]).maps
        sums += [float(np.abs(found[0, 0, :height, :width].numpy() - sample.disparity)[known].sum()) for found in maps]
    return [float(total) / max(pixels, 1) for total in sums]
