"""Upsampling of an answer as the SDK does it, in torch: what a network is trained and judged through."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor

from endosdk import _core
from endosdk.training.networks.base import Prediction, StereoNetwork
from endosdk.training.networks.confidence import log_scale_of

REACH = _core.upsampling_reach  # cells, along each axis, from which on a cell counts for nothing
UNLIKE = _core.upsampling_unlike  # sum of the differences of three channels from which a cell looks quite different
# A cell that looks quite different counts so much: where no cell around is alike, all count as they lie.
LEAST_LIKENESS = _core.upsampling_least_likeness
LEAST_TRUST, MOST_TRUST = 1e-6, 13.8  # what the logarithm of a confidence in 32-bit floats can tell


def to_input_grid(values: Tensor, stride: int) -> Tensor:
    """Bring a map [N, C, h, w] of a network with this output stride to the size of its input, bilinearly."""
    if stride == 1:
        return values
    return F.interpolate(values, scale_factor=float(stride), mode="bilinear", align_corners=False)


def on_input_grid(
    network: StereoNetwork, prediction: Prediction, left: Tensor, *, refined: bool = True
) -> list[Tensor]:
    """Bring the maps of a prediction to the grid of the left view [N, 3, H, W], 0..255, that the last one covers.

    The last map is taken in the cells of the deployed form. Where those are larger than pixels, joint bilateral
    upsampling follows. Coarser maps are upsampled bilinearly: they are never shown.
    """
    stride = network.output_stride
    maps = [found.float() for found in prediction.disparities]
    if network.deployed_stride == 1 or not refined:
        return [to_input_grid(found, stride) for found in maps]
    with torch.no_grad():
        clues = None if prediction.clues is None else prediction.clues.float()
        known = prediction._replace(evidence=prediction.evidence.float(), clues=clues)
        log_scale = log_scale_of(network.as_deployed(network.trust(known)))
    upsampled = joint_bilateral_upsampling(network.as_deployed(maps[-1]), log_scale, left)
    return [*(to_input_grid(found, stride) for found in maps[:-1]), upsampled]


def joint_bilateral_upsampling(disparity: Tensor, log_scale: Tensor, view: Tensor) -> Tensor:
    """Bring disparity [N, 1, h, w] to the grid of the left view [N, 3, H, W], 0..255, of H / h pixels a cell.

    A pixel takes the mean of the cells around it, weighted by how near they lie, how much their mean colour is like
    the pixel's, and one over the scale of their Laplace law, of which ``log_scale`` [N, 1, h, w] is the logarithm: what
    the compiled core does (``cpp/src/maps/joint_bilateral.cpp``). Gradients reach the disparity alone.
    """
    factor = view.shape[-1] // disparity.shape[-1]
    with torch.no_grad():
        trust = _framed(torch.exp(-log_scale.float()).clamp(LEAST_TRUST, MOST_TRUST))
        colours = torch.split(_framed(F.avg_pool2d(view, factor)), 1, dim=1)
    cells = _framed(disparity)
    phases = [
        _one_phase(cells, colours, trust, view, (row, column), factor)
        for row in range(factor)
        for column in range(factor)
    ]
    return F.pixel_shuffle(torch.cat(phases, dim=1), factor)


def _framed(cells: Tensor) -> Tensor:
    """Let the border stand in for the cells beyond it."""
    return F.pad(cells, (REACH,) * 4, mode="replicate")


def _one_phase(
    cells: Tensor, colours: Sequence[Tensor], trust: Tensor, view: Tensor, phase: tuple[int, int], factor: int
) -> Tensor:
    """Give the answer [N, 1, h, w] for the pixels that lie alike within their cells; the cells are framed."""
    pixels = [
        channel[..., phase[0] :: factor, phase[1] :: factor].contiguous() for channel in torch.split(view, 1, dim=1)
    ]
    height, width = pixels[0].shape[-2:]
    weight: Tensor | float = 0.0
    value: Tensor | float = 0.0
    for down, share_down in _taps(phase[0], factor):
        for along, share_along in _taps(phase[1], factor):
            window = (..., slice(down, down + height), slice(along, along + width))
            # In place and channel by channel, within the cache: a third of the time of the same in larger steps.
            with torch.no_grad():
                counts = torch.ones_like(pixels[0])
                for colour, channel in zip(colours, pixels, strict=True):
                    counts.sub_((colour[window] - channel).abs_(), alpha=1.0 / UNLIKE)
                counts.clamp_min_(0.0).square_().square_().add_(LEAST_LIKENESS)
                counts.mul_(trust[window]).mul_(share_down * share_along)
                weight = weight + counts
            value = value + counts * cells[window]
    assert isinstance(value, Tensor)
    return value / weight


def _taps(phase: int, factor: int) -> list[tuple[int, float]]:
    """Where each of the framed cells around such a pixel lies, relative to its own, and how much that counts."""
    offset = (phase + 0.5) / factor - 0.5
    first = math.floor(offset) - (REACH - 1)
    around = range(first, first + 2 * REACH)
    return [(cell + REACH, max(0.0, 1.0 - abs(offset - cell) / REACH)) for cell in around]
