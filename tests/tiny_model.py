"""A network without training that really matches, small enough to live in the repository.

It compares blocks of the two views at every shift, so the tests of the runtime can check real disparity on a shifted
textured pair. ``python tests/tiny_model.py`` writes models/tiny-for-tests.onnx anew; the bytes depend on the version of
torch alone.
"""

from __future__ import annotations

from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks.base import Coarse, Prediction, StereoNetwork
from endosdk.training.networks.confidence import ConfidenceHead
from endosdk.training.networks.cost_volume import soft_argmin

FILE = Path(__file__).parents[1] / "models" / "tiny-for-tests.onnx"
INFO = ModelDescription(
    name="tiny-for-tests",
    version="1",
    intended_use="Tests of this package. Block matching without any training: not for images.",
    training={"recipe": "none, weights are set by hand"},
)


class BlockMatching(StereoNetwork):
    """Mean absolute difference of 8x8 blocks, every pixel of shift from 0 to 31, answers at 1/4 of the size."""

    name = "tiny-for-tests"
    max_disparity = 32
    input_multiple = 8
    coarse_stride = output_stride = 4
    plane_step = 1

    def __init__(self) -> None:
        super().__init__()
        # The grey view shifted by every disparity at once: a convolution whose kernels hold a single one.
        shifts = torch.eye(self.max_disparity).flip(1).reshape(self.max_disparity, 1, 1, self.max_disparity)
        self.register_buffer("shifts", shifts)
        self.register_buffer("grey", torch.tensor([0.299, 0.587, 0.114]).reshape(1, 3, 1, 1))
        self.confidence = ConfidenceHead(channels=1)

    def coarse(self, left: Tensor, right: Tensor) -> Coarse:
        left_detail, right_detail = self._detail(left), self._detail(right)
        shifted = F.conv2d(F.pad(right_detail, (self.max_disparity - 1, 0)), self.shifts)
        difference = F.avg_pool2d((left_detail - shifted).abs(), 8, stride=4, padding=2)
        found = soft_argmin(difference.permute(0, 2, 3, 1))
        return Coarse(found.disparity, torch.log(found.excess + 1e-3), left_detail)

    def refine(self, coarse: Coarse) -> Prediction:
        return Prediction([coarse.disparity], coarse.evidence)

    def _detail(self, image: Tensor) -> Tensor:
        """Grey without its local mean, so that a change of brightness does not matter."""
        grey = (image * self.grey).sum(dim=1, keepdim=True)
        return grey - F.avg_pool2d(grey, 9, stride=1, padding=4, count_include_pad=False)


if __name__ == "__main__":
    export_model(BlockMatching().eval(), FILE, INFO)
    print(f"{FILE.name}: {FILE.stat().st_size} bytes")
