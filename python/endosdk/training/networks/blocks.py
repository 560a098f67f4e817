"""Small layers that the networks share."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from endosdk.errors import InvalidArgument


class Numbers:
    """What a block computes with: exact numbers, or what a subclass makes of them."""

    def convolved(self, conv: nn.Module, x: Tensor) -> Tensor:
        """Return ``conv`` of ``x``."""
        out: Tensor = conv(x)
        return out

    def value(self, name: str, x: Tensor) -> Tensor:
        """Return the activations ``x``; ``name`` says which of the block's."""
        return x


EXACT = Numbers()


def enlarged(values: Tensor, factor: int) -> Tensor:
    """Bring maps [N, C, h, w] to a grid that is ``factor`` times as fine."""
    if factor == 1:
        return values
    return F.interpolate(values, scale_factor=float(factor), mode="bilinear", align_corners=False)


class ConvNorm(nn.Module):
    """Convolution, batch norm, leaky rectifier; ``residual`` adds the input before the rectifier.

    The addition comes before the rectifier because runtimes fuse convolution, addition and rectifier in that order.
    ``padding`` is zeros (before, after) each spatial axis; by default what keeps the size, divided by the stride.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        *,
        kernel: int = 3,
        stride: int = 1,
        dilation: int = 1,
        padding: tuple[int, int] | None = None,
        dims: int = 2,
        slope: float = 0.2,
        residual: bool = False,
    ) -> None:
        super().__init__()
        conv, norm = (nn.Conv2d, nn.BatchNorm2d) if dims == 2 else (nn.Conv3d, nn.BatchNorm3d)
        before, after = padding or (dilation * (kernel - 1) // 2,) * 2
        self.uneven = () if before == after else (before, after) * dims
        self.conv = conv(inputs, outputs, kernel, stride, 0 if self.uneven else before, dilation, bias=False)
        self.norm: nn.Module = norm(outputs)
        self.activation: nn.Module = nn.LeakyReLU(slope) if slope else nn.ReLU()
        self.residual = residual
        self.numbers = EXACT
        nn.init.kaiming_normal_(self.conv.weight, a=slope)

    def forward(self, x: Tensor, added: Tensor | None = None) -> Tensor:
        """Apply the layer to [N, inputs, ...]; ``added`` joins before the rectifier."""
        numbers = self.numbers
        y: Tensor = self.norm(numbers.convolved(self.conv, F.pad(x, self.uneven) if self.uneven else x))
        if self.residual:
            y = y + x
        if added is not None:
            y = numbers.value("product", y) + numbers.value("added", added)
        return numbers.value("out", self.activation(y))


class ResidualPair(nn.Module):
    """Two convolutions around which the input is added."""

    def __init__(self, channels: int, slope: float) -> None:
        super().__init__()
        self.first = ConvNorm(channels, channels, slope=slope)
        self.second = ConvNorm(channels, channels, slope=slope)

    def forward(self, x: Tensor) -> Tensor:
        """Apply both to [N, channels, h, w]."""
        out: Tensor = self.second(self.first(x), added=x)
        return out


def fold_batch_norm(network: nn.Module) -> None:
    """Fold every batch norm of a network in evaluation mode into its convolution, in place."""
    for module in network.modules():
        if isinstance(module, ConvNorm) and isinstance(module.norm, nn.BatchNorm2d | nn.BatchNorm3d):
            if module.training:
                raise InvalidArgument("network", "must be in evaluation mode before batch norm is folded", "training")
            module.conv = nn.utils.fusion.fuse_conv_bn_eval(module.conv, module.norm)
            module.norm = nn.Identity()


def freeze_norm(network: nn.Module) -> None:
    """Let every batch norm of a network keep its statistics, until the network is set to train again."""
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
            module.eval()


def fold_residuals(network: nn.Module) -> None:
    """Turn every convolution that adds its own input into one whose middle weights do, in place.

    The same function without the addition, which runtimes would compute apart and in another memory layout: a third of
    the time of a large layer. Batch norm must have been folded.
    """
    for module in network.modules():
        if isinstance(module, ConvNorm) and module.residual:
            weight = module.conv.weight
            middle = tuple(side // 2 for side in weight.shape[2:])
            with torch.no_grad():
                for channel in range(weight.shape[0]):
                    weight[(channel, channel, *middle)] += 1.0
            module.residual = False


COLOUR_GAIN, COLOUR_OFFSET = 1.0 / 64.0, -2.0  # bring 0..255 to -2..2, about the spread that initial weights expect


def scaled_colours(image: Tensor) -> Tensor:
    """Bring 0..255 to -2..2."""
    return image * COLOUR_GAIN + COLOUR_OFFSET


def fold_colour_scaling(conv: nn.Module) -> None:
    """Move `scaled_colours` into the convolution that follows it, in place; it must not pad its input."""
    if not isinstance(conv, nn.Conv2d) or conv.padding != (0, 0) or conv.bias is None:
        raise InvalidArgument("conv", "must be a 2-D convolution with a bias and no padding", conv)
    with torch.no_grad():
        conv.bias.add_(conv.weight.sum(dim=(1, 2, 3)) * COLOUR_OFFSET)
        conv.weight.mul_(COLOUR_GAIN)
