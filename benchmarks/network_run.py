"""One run of a network on memory of its own: the frame path brings its own, so this is for studies and tests."""

from __future__ import annotations

import numpy as np

from endosdk.errors import InvalidArgument
from endosdk.runtime.session import StereoSession


class NetworkRun:
    """Write planar RGB into ``left`` and ``right``, uint8 [3, H, W]; call it; then read the two maps.

    ``disparity``, px of the input, and ``confidence`` are float32 [H / stride, W / stride]. Height and width must be
    multiples of the model's ``input_multiple``.
    """

    def __init__(self, session: StereoSession, height: int, width: int) -> None:
        multiple = session.info.input_multiple
        for name, value in (("height", height), ("width", width)):
            if value <= 0 or value % multiple:
                raise InvalidArgument(name, f"must be a positive multiple of {multiple}", value)
        stride = session.info.output_stride
        self.left = np.zeros((3, height, width), np.uint8)
        self.right = np.zeros((3, height, width), np.uint8)
        self.disparity = np.zeros((height // stride, width // stride), np.float32)
        self.confidence = np.zeros_like(self.disparity)
        runner = session.for_size(height, width) or session
        self.bound = runner.bind(self.left, self.right, self.disparity, self.confidence)

    def __call__(self) -> None:
        """Compute both maps."""
        self.bound.run()
