"""Feed your own PyTorch network: ``python examples/torch_dataset.py SET [SPLIT]`` shows one batch of a data set.

SET is a set that ``endosdk simulate`` rendered, for example ``datasets/endosim-gi-cycles test``. To read a public set,
give ``open_dataset`` its layout. It needs the extra ``train``.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TypedDict

import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset

from endosdk.datasets.layouts import open_dataset


class Pair(TypedDict):
    """One pair. Views are float32 [3,H,W] in 0..1, maps [H,W]."""

    left: torch.Tensor
    right: torch.Tensor
    disparity: torch.Tensor  # float32, px; 0 where `known` is false
    known: torch.Tensor  # bool: there is ground truth
    occluded: torch.Tensor  # bool: the right camera does not see the point


class StereoPairs(Dataset[Pair]):
    """The pairs of a split, cut to one size at a random place. Smaller pairs stay as they are.

    Both views are cut at the same columns. So the disparity stays as it is.
    """

    def __init__(
        self, root: str | Path, split: str = "train", crop: tuple[int, int] = (256, 512), layout: str = "endosdk"
    ):
        self.reader = open_dataset(root, split, layout)
        self.crop = crop

    def __len__(self) -> int:
        return len(self.reader)

    def __getitem__(self, index: int) -> Pair:
        sample = self.reader[index]
        height, width = (min(wanted, side) for wanted, side in zip(self.crop, sample.disparity.shape, strict=True))
        top, first = (
            int(torch.randint(side - wanted + 1, ()))
            for side, wanted in zip(sample.disparity.shape, (height, width), strict=True)
        )
        window = np.s_[top : top + height, first : first + width]
        known = np.isfinite(sample.disparity[window])
        occlusion = np.zeros_like(known) if sample.occlusion is None else sample.occlusion[window]
        return {
            "left": as_planes(sample.left[window]),
            "right": as_planes(sample.right[window]),
            "disparity": torch.from_numpy(np.where(known, sample.disparity[window], np.float32(0))),
            "known": torch.from_numpy(known),
            "occluded": torch.from_numpy(occlusion.copy()),
        }


def as_planes(view: np.ndarray) -> torch.Tensor:
    """Turn a view, uint8 [H,W,3], into float32 [3,H,W] in 0..1."""
    return torch.from_numpy(np.ascontiguousarray(view.transpose(2, 0, 1))).float() / 255


def stacked(pairs: list[dict[str, torch.Tensor]]) -> dict[str, torch.Tensor]:
    """Make one batch. All pairs are cut to the smallest of them: a set may have frames of several sizes."""
    height, width = (min(pair["known"].shape[axis] for pair in pairs) for axis in (0, 1))
    maps = {name: [pair[name][..., :height, :width] for pair in pairs] for name in pairs[0]}
    return {name: torch.stack(each) for name, each in maps.items()}


def main() -> None:
    root, split = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "train"
    loader = DataLoader(StereoPairs(root, split), batch_size=4, shuffle=True, num_workers=2, collate_fn=stacked)
    batch = next(iter(loader))
    for name, tensor in batch.items():
        print(f"{name:10} {str(tensor.dtype).removeprefix('torch.'):8} {list(tensor.shape)}")
    print(f"mean disparity {batch['disparity'][batch['known']].mean():.1f} px")


if __name__ == "__main__":
    main()
