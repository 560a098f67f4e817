"""wang2020 as its equations have it: the last plane is the largest disparity itself.

Ours, which is what ships, ends one plane of 8 px before it. The weights are the same for every range.
"""

from __future__ import annotations

from endosdk.training.networks.wang2020 import CELL, Wang2020


class WholeRange(Wang2020):
    """`Wang2020` with planes 0, 8, ... up to and including ``max_disparity``."""

    name = "wang2020-whole-range"

    def __init__(self, max_disparity: int = 192) -> None:
        """Build with random weights; ``max_disparity`` in input px, a positive multiple of 8."""
        super().__init__(max_disparity)
        self.aggregation.planes = self.max_disparity // CELL + 1

    @property
    def max_candidate_disparity(self) -> int:
        """The largest disparity there is a plane for, input px."""
        return self.max_disparity
