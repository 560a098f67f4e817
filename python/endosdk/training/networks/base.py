"""What every network offers to training, calibration and export."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument
from endosdk.training.networks.blocks import enlarged, fold_batch_norm, fold_residuals
from endosdk.training.networks.confidence import ConfidenceHead


class Window(NamedTuple):
    """Part of the input, in input pixels; every number is a multiple of the network's ``input_multiple``."""

    top: int
    left: int
    height: int
    width: int

    def of(self, values: Tensor, stride: int = 1) -> Tensor:
        """Cut this part out of a map [N, C, H/stride, W/stride]."""
        rows = slice(self.top // stride, (self.top + self.height) // stride)
        columns = slice(self.left // stride, (self.left + self.width) // stride)
        return values[..., rows, columns]

    def grown(self, margin: int, height: int, width: int) -> Window:
        """Return this part with what lies around it, up to ``margin`` and the border of an input of this size, px."""
        top, left = max(0, self.top - margin), max(0, self.left - margin)
        bottom = min(height, self.top + self.height + margin)
        right = min(width, self.left + self.width + margin)
        return Window(top, left, bottom - top, right - left)

    def within(self, outer: Window) -> Window:
        """Return this part as seen from the corner of a larger one that holds it."""
        return self._replace(top=self.top - outer.top, left=self.left - outer.left)


class Coarse(NamedTuple):
    """Result of the matching stage, on the grid on which the refinement works: 1/``coarse_stride`` of the input."""

    disparity: Tensor  # [N, 1, h, w], px at the input width
    evidence: Tensor  # [N, K, h, w], what tells how far to trust it; no gradient flows through it
    context: Tensor  # [N, C, h, w], what the refinement knows of the left view
    hints: Tensor | None = None  # [N, C, h, w], what else it may know
    step: Tensor | None = None  # [N, C, h, w], px, what it may add to the answer as it is
    cost: Tensor | None = None  # of the candidates of the whole input, as `Prediction.cost`


class Prediction(NamedTuple):
    """Disparity maps from coarse to fine, and what tells how far the finest can be trusted."""

    disparities: list[Tensor]  # each [N, 1, H/s, W/s], px at the input width; a windowed one has the window's size
    evidence: Tensor  # [N, K, h, w] of the last map, on the coarse grid; no gradient flows through it
    # [N, D, r^2, h/r, w/r] of the D candidates, where the network searches planes on a grid r times coarser than that
    # of the coarse map; the cells of the coarse map are channels, as `pixel_shuffle` takes them
    cost: Tensor | None = None
    clues: Tensor | None = None  # [N, C, h, w], what else the confidence may know; no gradient flows through it


class StereoNetwork(nn.Module, ABC):
    """A network from a rectified pair to disparity; sub-classes set the attributes and the two stages."""

    name: str
    max_disparity: int
    input_multiple: int
    coarse_stride: int  # input pixels per cell of the grid on which the refinement works
    output_stride: int  # input pixels per cell of the network's own map
    refine_margin: int  # how far the refinement looks, in input pixels, up to a multiple of ``input_multiple``
    reads_bytes: bool = False  # the exported form takes the views as uint8, as they are in memory
    stage_weights: tuple[float, ...] | None = None  # of the loss of each map, coarse to fine; None: as the run says
    candidates: tuple[int, ...] = ()  # disparities of the planes that `Prediction.cost` is about, input px
    plane_step: int | None = None  # input px from a disparity plane to the next; None: no last one
    inference_width: int | None = None  # width at which frames are to be seen, px; None: any
    # Height and width of a training crop, px: wide, so that the band without a match on the left stays small.
    default_crop: tuple[int, int] = (256, 512)
    confidence: ConfidenceHead
    given_parts: tuple[str, ...] = ()  # beginnings of the names of weights that never learn here
    _deployed_stride: int | None = None  # where `deploy_at` asked for another one than the network's own

    @property
    def deployed_stride(self) -> int:
        """Output stride of the deployed form: its map is the mean over whole cells of the network's own."""
        return self._deployed_stride or self.output_stride

    @property
    def max_candidate_disparity(self) -> int | None:
        """The largest disparity there is a plane for, input px: answers for nearer surfaces pile up there."""
        return None if self.plane_step is None else self.max_disparity - self.plane_step

    def adapted(self, weights: dict[str, Tensor], max_disparity: int, dense_disparity: int | None) -> dict[str, Tensor]:
        """Return the weights of a network of this kind, with planes of its own, as this one can take them."""
        return weights

    def deploy_at(self, output_stride: int | None) -> None:
        """Let the deployed form have this output stride; None: the network's own.

        Raises InvalidArgument where its cells would not hold whole ones of the network, or the input whole ones of its.
        """
        stride = self.output_stride if output_stride is None else output_stride
        if stride < 1 or stride % self.output_stride or self.input_multiple % stride:
            rule = f"must be a multiple of {self.output_stride} that divides {self.input_multiple}, for {self.name}"
            raise InvalidArgument("output_stride", rule, stride)
        self._deployed_stride = stride

    def as_deployed(self, values: Tensor) -> Tensor:
        """Bring a map [N, C, H/s, W/s] of the network to the output stride of the deployed form."""
        cell = self.deployed_stride // self.output_stride
        return values if cell == 1 else F.avg_pool2d(values, cell)

    @abstractmethod
    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        """Match the views, float [N, 3, H, W], 0..255."""

    @abstractmethod
    def refine(self, coarse: Coarse) -> Prediction:
        """Sharpen the coarse map with the left view; its map becomes the first of the prediction."""

    def forward(self, left: Tensor, right: Tensor, refined: bool = True, window: Window | None = None) -> Prediction:
        """Predict from float views [N, 3, H, W], 0..255; H and W are multiples of ``input_multiple``.

        Without ``refined`` only the coarse map is computed. A window limits the refinement, which is local and by far
        the dearest part of training: the first map is then that of the whole input, the second that of the window, as
        it is in the whole picture.
        """
        coarse = self.coarse(left, right)
        if not refined:
            return Prediction([self.on_answer_grid(coarse.disparity)], coarse.evidence, coarse.cost)
        if window is None:
            return self.refine(coarse)._replace(cost=coarse.cost)
        seen = window.grown(self.refine_margin, *left.shape[-2:])
        parts = (None if part is None else seen.of(part, self.coarse_stride) for part in coarse[:-1])
        prediction = self.refine(Coarse(*parts))  # type: ignore[arg-type]
        asked = window.within(seen)
        fine = [asked.of(disparity, self.output_stride) for disparity in prediction.disparities[1:]]
        evidence = asked.of(prediction.evidence, self.coarse_stride)
        clues = None if prediction.clues is None else asked.of(prediction.clues, self.coarse_stride)
        return Prediction([self.on_answer_grid(coarse.disparity), *fine], evidence, coarse.cost, clues)

    def on_answer_grid(self, values: Tensor) -> Tensor:
        """Bring values of the coarse grid to the grid of the answer."""
        return enlarged(values, self.coarse_stride // self.output_stride)

    def trust(self, prediction: Prediction) -> Tensor:
        """Return the probability [N, 1, H/s, W/s] that the last map is wrong by at most one pixel."""
        return self.confidence.enlarged(self.log_scale(prediction), self.coarse_stride // self.output_stride)

    def log_scale(self, prediction: Prediction) -> Tensor:
        """Return the logarithm of the scale [N, 1, h, w] of the errors of the last map, px, on the coarse grid."""
        return self.confidence.log_scale(prediction.evidence, prediction.clues)

    def export_form(self) -> StereoNetwork:
        """Return a copy in evaluation mode that computes the same with layers that suit the deployed runtime.

        Batch norm and additions of a layer's own input are folded into the weights.
        """
        form = copy.deepcopy(self).eval()
        fold_batch_norm(form)
        fold_residuals(form)
        return form


class Deployed(nn.Module):
    """The whole function of a model file: uint8 views in, disparity and confidence out."""

    def __init__(self, network: StereoNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, left: Tensor, right: Tensor) -> tuple[Tensor, Tensor]:
        """Map uint8 [N, 3, H, W] to disparity and confidence, float32 [N, 1, H/s, W/s]."""
        network = self.network
        views = (left, right) if network.reads_bytes else (left.to(torch.float32), right.to(torch.float32))
        prediction = network(*views)
        return network.as_deployed(prediction.disparities[-1]), network.as_deployed(network.trust(prediction))


def check_max_disparity(value: int, cell: int) -> int:
    """Return the value if it is a positive multiple of the cell of the disparity planes, px."""
    if value <= 0 or value % cell:
        raise InvalidArgument("max_disparity", f"must be a positive multiple of {cell}", value)
    return value
