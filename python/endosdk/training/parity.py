"""Proof that the exported file computes what the trained network does."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
import torch
from numpy.typing import NDArray

from endosdk.errors import InferenceFailed
from endosdk.training.data import planar
from endosdk.training.networks.base import Deployed, StereoNetwork
from endosdk.training.upsampling import to_input_grid
from endosdk.training.validation import pad_to_multiple

LARGEST_DIFFERENCE_PX = 1e-3
LARGEST_DIFFERENCE_OF_CONFIDENCE = 1e-2

View = NDArray[np.uint8]


def check_parity(network: StereoNetwork, path: Path, pairs: Sequence[tuple[View, View]]) -> dict[str, Any]:
    """Compare torch with the file on pairs [H, W, 3] of any size, padded and cropped as the runtime does.

    Returns the largest differences per pair. Raises InferenceFailed when a disparity differs by more than 1e-3 px,
    or a confidence by more than 1e-2.
    """
    session = ort.InferenceSession(path.read_bytes(), providers=["CPUExecutionProvider"])
    deployed = Deployed(network).eval()
    report = []
    for left, right in pairs:
        height, width = left.shape[:2]
        inputs = [_padded(view, network.input_multiple) for view in (left, right)]
        with torch.inference_mode():
            expected = deployed(*inputs)
        found = session.run(["disparity", "confidence"], {"left": inputs[0].numpy(), "right": inputs[1].numpy()})
        cropped = [
            to_input_grid(values, network.deployed_stride)[..., :height, :width]
            for values in (*expected, *(torch.from_numpy(array) for array in found))
        ]
        differences = [float((cropped[i + 2] - cropped[i]).abs().max()) for i in (0, 1)]
        report.append({"height": height, "width": width, "disparity_px": differences[0], "confidence": differences[1]})
    # NumPy's maximum is NaN where one of them is.
    worst, doubt = (float(np.max([entry[key] for entry in report])) for key in ("disparity_px", "confidence"))
    if not (worst <= LARGEST_DIFFERENCE_PX and doubt <= LARGEST_DIFFERENCE_OF_CONFIDENCE):
        limits = f"{LARGEST_DIFFERENCE_PX} px and {LARGEST_DIFFERENCE_OF_CONFIDENCE} of confidence"
        raise InferenceFailed("model", f"must agree with torch within {limits}", f"{worst:.2e} px, {doubt:.2e}")
    return {"onnxruntime": ort.__version__, "torch": torch.__version__, "largest_px": worst, "sizes": report}


def parity_pairs(left: View, right: View) -> list[tuple[View, View]]:
    """Cut three sizes out of a pair: all of it, the middle half, and one that is no multiple of anything."""
    height, width = left.shape[:2]
    sizes = ((height, width), (height // 2, width // 2), (height // 2 - 3, width // 2 - 5))
    corners = [((height - h) // 2, (width - w) // 2, h, w) for h, w in sizes]
    return [(left[y : y + h, x : x + w], right[y : y + h, x : x + w]) for y, x, h, w in corners]


def _padded(view: View, multiple: int) -> torch.Tensor:
    return pad_to_multiple(planar(view)[None].float(), multiple).to(torch.uint8)
