"""PSMNet: Chang, Chen: "Pyramid Stereo Matching Network", CVPR 2018, with the stacked hourglass.

The network as published: spatial pyramid pooling over features at 1/4, concatenation volume, three hourglasses with
skips between them, three supervised outputs. Two things are ours, and change no weight: pooling windows are cut at the
border instead of being dropped there, so that any size may enter, and the answer is the last output alone.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.methods.published import PublishedNetwork, Stages, enlarge, he_normal
from endosdk.training.networks.base import check_max_disparity
from endosdk.training.networks.blocks import scaled_colours
from endosdk.training.networks.cost_volume import match_evidence, soft_argmin

CELL = 4
POOLS = (64, 32, 16, 8)


def _conv(inputs: int, outputs: int, kernel: int = 3, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    padding = dilation * (kernel // 2)
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, kernel, stride, padding, dilation, bias=False), nn.BatchNorm2d(outputs)
    )


def _conv3d(inputs: int, outputs: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(nn.Conv3d(inputs, outputs, 3, stride, 1, bias=False), nn.BatchNorm3d(outputs))


def _up3d(inputs: int, outputs: int) -> nn.Sequential:
    up = nn.ConvTranspose3d(inputs, outputs, 3, stride=2, padding=1, output_padding=1, bias=False)
    return nn.Sequential(up, nn.BatchNorm3d(outputs))


class _Residual(nn.Module):
    """Two convolutions around which the input is added; there is no rectifier after the sum."""

    def __init__(self, inputs: int, outputs: int, stride: int, dilation: int) -> None:
        super().__init__()
        self.first = nn.Sequential(_conv(inputs, outputs, stride=stride, dilation=dilation), nn.ReLU())
        self.second = _conv(outputs, outputs, dilation=dilation)
        same = stride == 1 and inputs == outputs
        self.skip: nn.Module = nn.Identity() if same else _conv(inputs, outputs, kernel=1, stride=stride)

    def forward(self, x: Tensor) -> Tensor:
        out: Tensor = self.second(self.first(x)) + self.skip(x)
        return out


def _residuals(inputs: int, outputs: int, count: int, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    first = _Residual(inputs, outputs, stride, dilation)
    return nn.Sequential(first, *(_Residual(outputs, outputs, 1, dilation) for _ in range(count - 1)))


class _Features(nn.Module):
    """Features [N, 32, H/4, W/4] that know their surroundings."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Sequential(_conv(3, 32, stride=2), nn.ReLU(), _conv(32, 32), nn.ReLU(), _conv(32, 32), nn.ReLU())
        self.one = _residuals(32, 32, 3)
        self.two = _residuals(32, 64, 16, stride=2)
        self.three = _residuals(64, 128, 3, dilation=2)
        self.four = _residuals(128, 128, 3, dilation=4)
        self.pyramid = nn.ModuleList(
            nn.Sequential(
                nn.AvgPool2d(size, size, ceil_mode=True, count_include_pad=False), _conv(128, 32, kernel=1), nn.ReLU()
            )
            for size in POOLS
        )
        self.fusion = nn.Sequential(_conv(320, 128), nn.ReLU(), nn.Conv2d(128, 32, 1, bias=False))

    def forward(self, colours: Tensor) -> Tensor:
        skip = self.two(self.one(self.stem(colours)))
        deep = self.four(self.three(skip))
        levels = [enlarge(branch(deep), deep) for branch in self.pyramid]
        out: Tensor = self.fusion(torch.cat([skip, deep, *reversed(levels)], dim=1))
        return out


class _Hourglass(nn.Module):
    """Down twice and up again, with sums from the hourglass before."""

    def __init__(self) -> None:
        super().__init__()
        self.down1, self.same1 = nn.Sequential(_conv3d(32, 64, 2), nn.ReLU()), _conv3d(64, 64)
        self.down2 = nn.Sequential(_conv3d(64, 64, 2), nn.ReLU(), _conv3d(64, 64), nn.ReLU())
        self.up1, self.up2 = _up3d(64, 64), _up3d(64, 32)

    def forward(self, x: Tensor, before: Tensor | None, after: Tensor | None) -> tuple[Tensor, Tensor, Tensor]:
        """Return the output and the sums at half size before and after the waist."""
        pre = self.same1(self.down1(x))
        pre = torch.relu(pre if after is None else pre + after)
        post = self.up1(self.down2(pre))
        post = torch.relu(post + (pre if before is None else before))
        return self.up2(post), pre, post


class PSMNet(PublishedNetwork):
    """The stacked hourglass."""

    name = "psmnet"
    input_multiple = 16
    stage_weights = (0.5, 0.7, 1.0)

    def __init__(self, max_disparity: int = 192) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 16."""
        super().__init__()
        self.max_disparity = check_max_disparity(max_disparity, 4 * CELL)
        self.features = _Features()
        self.entry = nn.Sequential(_conv3d(64, 32), nn.ReLU(), _conv3d(32, 32), nn.ReLU())
        self.entry_residual = nn.Sequential(_conv3d(32, 32), nn.ReLU(), _conv3d(32, 32))
        self.hourglasses = nn.ModuleList(_Hourglass() for _ in range(3))
        self.heads = nn.ModuleList(
            nn.Sequential(_conv3d(32, 32), nn.ReLU(), nn.Conv3d(32, 1, 3, padding=1, bias=False)) for _ in range(3)
        )
        he_normal(self)

    def stages(self, left: Tensor, right: Tensor, late: bool = True) -> Stages:
        """Match; the outputs of the first two hourglasses are computed only where they are trained or asked for."""
        pairs = left.shape[0]
        views = self.features(scaled_colours(torch.cat([left, right])))
        volume = self.entry(_concatenation_volume(views[:pairs], views[pairs:], self.max_disparity // CELL))
        volume = volume + self.entry_residual(volume)
        out, before, after = self.hourglasses[0](volume, None, None)
        scores = [self.heads[0](out + volume)]
        for hourglass, head in zip(self.hourglasses[1:], self.heads[1:], strict=True):
            out, _, after = hourglass(out + volume, before, after)
            scores.append(scores[-1] + head(out + volume))
        chosen = scores if self.training else [scores[0], scores[-1]]
        found = [soft_argmin(self._at_full_size(-score, left)) for score in chosen]
        return Stages([f.disparity for f in found], match_evidence(found[-1], 1))

    def _at_full_size(self, score: Tensor, like: Tensor) -> Tensor:
        """Enlarge scores [N, 1, D/4, H/4, W/4] to [N, H, W, D]."""
        size = (self.max_disparity, like.shape[-2], like.shape[-1])
        whole = F.interpolate(score, size=size, mode="trilinear", align_corners=False)
        return whole.squeeze(1).permute(0, 2, 3, 1)


def _concatenation_volume(left: Tensor, right: Tensor, planes: int) -> Tensor:
    """Join left features and right ones shifted by 0..planes-1 cells, [N, 2 C, D, h, w]; zero where one is missing."""
    width = left.shape[-1]
    padded = F.pad(right, (planes - 1, 0))
    there = F.pad(torch.ones_like(left[:1, :1]), (planes - 1, 0))
    cuts = [slice(planes - 1 - plane, planes - 1 - plane + width) for plane in range(planes)]
    joined = [torch.cat([left * there[..., cut], padded[..., cut]], dim=1) for cut in cuts]
    return torch.stack(joined, dim=2)
