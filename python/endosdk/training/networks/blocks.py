"""Small layers that the networks share."""

from __future__ import annotations

from torch import Tensor, nn


class ConvNorm(nn.Module):
    """Convolution, batch norm, leaky rectifier; ``residual`` adds the input before the rectifier.

    Padding keeps the size (divided by the stride). The addition comes before the rectifier because runtimes fuse
    convolution, addition and rectifier in that order.
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        *,
        kernel: int = 3,
        stride: int = 1,
        dilation: int = 1,
        dims: int = 2,
        slope: float = 0.2,
        residual: bool = False,
    ) -> None:
        super().__init__()
        conv, norm = (nn.Conv2d, nn.BatchNorm2d) if dims == 2 else (nn.Conv3d, nn.BatchNorm3d)
        padding = dilation * (kernel - 1) // 2
        self.conv = conv(inputs, outputs, kernel, stride, padding, dilation, bias=False)
        self.norm: nn.Module = norm(outputs)
        self.activation = nn.LeakyReLU(slope)
        self.residual = residual
        nn.init.kaiming_normal_(self.conv.weight, a=slope)

    def forward(self, x: Tensor) -> Tensor:
        """Apply the layer to [N, inputs, ...]."""
        y: Tensor = self.norm(self.conv(x))
        if self.residual:
            y = y + x
        out: Tensor = self.activation(y)
        return out


def fold_batch_norm(network: nn.Module) -> None:
    """Fold every batch norm of a network in evaluation mode into its convolution, in place."""
    for module in network.modules():
        if isinstance(module, ConvNorm) and not isinstance(module.norm, nn.Identity):
            module.conv = nn.utils.fusion.fuse_conv_bn_eval(module.conv, module.norm)  # type: ignore[type-var]
            module.norm = nn.Identity()
