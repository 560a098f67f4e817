"""Errors of a network on whole frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

from endosdk.datasets.dataset import DatasetReader, Sample
from endosdk.errors import DatasetInvalid, InferenceFailed
from endosdk.evaluation.scores import ScoreBoard
from endosdk.io.progress import progress
from endosdk.training.frame_size import seen_size, seen_views
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.upsampling import on_input_grid, to_input_grid


class SeenFrame(NamedTuple):
    """What a network says about one pair, at the size of the frame."""

    sample: Sample
    maps: list[NDArray[np.float32]]  # coarse to fine, each [H, W], px of the frame
    columns: Tensor  # [K, H, W], what the confidence is linear in
    reduction: float  # pixels of the frame per pixel that the network saw


def pad_to_multiple(image: Tensor, multiple: int) -> Tensor:
    """Repeat the last row and column until height and width of [N, C, H, W] are multiples."""
    height, width = image.shape[-2:]
    return F.pad(image, (0, -width % multiple, 0, -height % multiple), mode="replicate")


@torch.inference_mode()
def predict_frames(
    network: StereoNetwork, reader: DatasetReader, indices: Sequence[int], *, refined: bool = True, title: str = ""
) -> Iterator[SeenFrame]:
    """Run the network in evaluation mode over whole pairs, with a progress bar when there is a title."""
    device = next(network.parameters()).device
    network.eval()
    for index in progress(indices, title=title, shown=bool(title), stays=False):
        sample = reader[index]
        size = seen_size(sample.left.shape[1], sample.left.shape[0], network.inference_width)
        factor = sample.left.shape[1] / size[0]
        views = seen_views(sample.left, sample.right, size, network.input_multiple)
        left, right = (torch.from_numpy(view)[None].to(device, torch.float32) for view in views)
        prediction = network(left, right, refined=refined)
        maps = [
            factor * _to_frame(found, size, sample)[0].numpy()
            for found in on_input_grid(network, prediction, left, refined=refined)
        ]
        columns = network.confidence.columns(prediction.evidence, prediction.clues)
        columns = to_input_grid(network.on_answer_grid(columns), network.output_stride)
        yield SeenFrame(sample, maps, _to_frame(columns, size, sample), factor)


def _to_frame(values: Tensor, size: tuple[int, int], sample: Sample) -> Tensor:
    """Cut [1, C, h, w] to the ``size`` (width, height) that is no padding, and enlarge it to the frame [C, H, W]."""
    inside = values[..., : size[1], : size[0]]
    height, width = sample.left.shape[:2]
    if (width, height) != size:
        inside = F.interpolate(inside, size=(height, width), mode="bilinear", align_corners=False)
    return inside[0].cpu()


def mean_errors(
    network: StereoNetwork, reader: DatasetReader, indices: Sequence[int], *, refined: bool
) -> dict[str, float]:
    """Error of each map, px, and the share of pixels of the last that are off by more than 1 px.

    Raises DatasetInvalid where no pixel has truth, InferenceFailed where none gets a number for an answer.
    """
    names = ("epe_coarse", "epe_refined")[: 2 if refined else 1]
    boards = {name: ScoreBoard() for name in names}
    for frame in predict_frames(network, reader, indices, refined=refined, title="validation"):
        for name, found in zip(names, frame.maps, strict=True):
            boards[name].add(found, frame.sample.disparity)
    results = {name: board.result()["all"] for name, board in boards.items()}
    if not results[names[0]]["pixels"]:
        raise DatasetInvalid("dataset", "must have truth in the held-out pairs", f"none in {reader.name}")
    if not all(result["valid"] for result in results.values()):
        rule = "must answer with numbers; a run whose weights have become none needs a smaller rate"
        raise InferenceFailed("network", rule, "NaN in every pixel")
    return {**{name: result["epe_px"] for name, result in results.items()}, "over_1px": results[names[-1]]["kpe_1"]}


def full_scores(network: StereoNetwork, reader: DatasetReader) -> dict[str, Any]:
    """Measures of `ScoreBoard` over a split, confidence and expected depth error included.

    Those parts are left out that need the picture or the frame path: glare, low texture, instruments, range, validity.
    """
    board = ScoreBoard()
    for frame in predict_frames(network, reader, range(len(reader)), title="test split"):
        sample, disparity = frame.sample, frame.maps[-1]
        scale = torch.exp(network.confidence.scale_of(frame.columns[None]))[0, 0].numpy()
        # As the frame path states it: the scale of the Laplace law, in px of the frame, brought to mm.
        reach = np.maximum(disparity + sample.doffs, 0.5)
        sigma = sample.focal_px * sample.baseline_mm / reach**2 * scale * frame.reduction
        board.add(
            disparity,
            sample.disparity,
            occlusion=sample.occlusion,
            focal_px=sample.focal_px,
            baseline_mm=sample.baseline_mm,
            doffs=sample.doffs,
            sigma=sigma,
            confidence=1.0 - np.exp(-1.0 / scale),
        )
    return board.result()
