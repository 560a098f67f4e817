"""Errors of a network on whole frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from endosdk.dataset import DatasetReader
from endosdk.training.data import has_truth, planar
from endosdk.training.networks.base import StereoNetwork


class Frame(NamedTuple):
    """What a network says about one pair beside the truth; everything at the size of the frame, px."""

    maps: list[NDArray[np.float32]]  # coarse to fine, each [H, W]
    log_scale: NDArray[np.float32]  # [H, W], log of the expected error of the last map
    evidence: Tensor  # [K, H, W]
    truth: NDArray[np.float32]  # [H, W], NaN where there is none or beyond the network's range
    visible: NDArray[np.bool_]  # [H, W], true where both cameras see the point


def pad_to_multiple(image: Tensor, multiple: int) -> Tensor:
    """Repeat the last row and column until height and width of [N, C, H, W] are multiples."""
    height, width = image.shape[-2:]
    return F.pad(image, (0, -width % multiple, 0, -height % multiple), mode="replicate")


def to_input_grid(values: Tensor, stride: int) -> Tensor:
    """Bring a map [N, C, h, w] of a network with this output stride to the size of its input."""
    if stride == 1:
        return values
    return F.interpolate(values, scale_factor=float(stride), mode="bilinear", align_corners=False)


@torch.inference_mode()
def predict_frames(
    network: StereoNetwork, reader: DatasetReader, indices: Sequence[int], *, refined: bool = True, title: str = ""
) -> Iterator[Frame]:
    """Run the network in evaluation mode over whole pairs, with a progress bar when there is a title."""
    device = next(network.parameters()).device
    network.eval()
    for index in tqdm(indices, desc=title, unit="pair", disable=not title, leave=False):
        sample = reader[index]
        height, width = sample.left.shape[:2]
        views = [
            pad_to_multiple(planar(view)[None].to(device, torch.float32), network.input_multiple)
            for view in (sample.left, sample.right)
        ]
        prediction = network(*views, refined=refined)
        log_scale = (
            network.confidence.log_scale(prediction.evidence)
            if refined
            else torch.zeros_like(prediction.disparities[0])
        )
        *maps, log_scale, evidence = (
            to_input_grid(values, network.output_stride)[0, :, :height, :width].cpu()
            for values in (*prediction.disparities, log_scale, prediction.evidence)
        )
        truth = torch.from_numpy(np.array(sample.disparity))
        truth = torch.where(has_truth(truth, network.max_disparity), truth, torch.nan)
        visible = np.ones(truth.shape, dtype=bool) if sample.occlusion is None else ~sample.occlusion
        yield Frame([m[0].numpy() for m in maps], log_scale[0].numpy(), evidence, truth.numpy(), visible)
