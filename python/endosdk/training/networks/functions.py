"""Parts of a deployed network that become functions of the model file.

A runtime takes a dozen small operations over whole maps for what one loop does in a tenth of the time. ONNX lets a file
give such a part a name: a function, whose body is made of standard operators. Every runtime can run the body. Ours
knows some functions by name and computes them itself (cpp/src/functions).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

MARKS = "endosdk.marks"  # domain of the operators that `endosdk.training.outline` turns into functions


def as_function(part: nn.Module) -> Function:
    """Let a module become the function of the name of its class; numbers in its ``attributes`` describe it."""
    return Function(part)


class Function(nn.Module):
    """A module whose operations become one function when the network that holds it is exported."""

    def __init__(self, part: nn.Module) -> None:
        super().__init__()
        self.part = part

    def forward(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Return what the part makes of the inputs."""
        if not torch.compiler.is_exporting():
            return tuple(self.part(*inputs))
        return self._marked("End", tuple(self.part(*self._marked("Begin", inputs))))

    def _marked(self, mark: str, values: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
        settings: dict[str, int | float] = getattr(self.part, "attributes", {}) if mark == "End" else {}
        marked = torch.onnx.ops.symbolic_multi_out(
            f"{MARKS}::{mark}",
            values,
            {"name": type(self.part).__name__, **settings},
            dtypes=[value.dtype for value in values],
            shapes=[value.shape for value in values],
            version=1,
        )
        return tuple(marked)
