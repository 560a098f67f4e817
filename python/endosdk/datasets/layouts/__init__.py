"""All data sets: ours, and public ones in the layouts in which they are published, read as the same `Sample`."""

from __future__ import annotations

from pathlib import Path

from endosdk.datasets.dataset import RECORD, DatasetReader, EndosdkReader
from endosdk.datasets.layouts.kitti import KittiReader
from endosdk.datasets.layouts.middlebury import MiddleburyReader
from endosdk.datasets.layouts.plain import PlainReader
from endosdk.datasets.layouts.public import PublicReader
from endosdk.datasets.layouts.scared import ScaredReader
from endosdk.datasets.layouts.servct import ServCtReader
from endosdk.errors import InvalidArgument

READERS: dict[str, type[PublicReader]] = {
    "kitti": KittiReader,
    "middlebury": MiddleburyReader,
    "plain": PlainReader,
    "scared": ScaredReader,
    "servct": ServCtReader,
}
LAYOUTS = ("endosdk", *READERS)


def open_dataset(root: str | Path, split: str, layout: str = "endosdk") -> DatasetReader:
    """Open one split of a data set, ours or one in a public layout.

    Raises DatasetInvalid when it is not complete, InvalidArgument for an unknown layout or a split without truth.
    """
    if layout == "endosdk":
        return EndosdkReader(Path(root), split)
    if layout not in READERS:
        raise InvalidArgument("layout", f"must be one of {', '.join(LAYOUTS)}", layout)
    return READERS[layout](Path(root), split)


def layout_of(root: str | Path, layout: str) -> str:
    """Return ``endosdk`` for a folder with ``dataset.json``, whatever ``layout`` the sets beside it have."""
    return "endosdk" if (Path(root) / RECORD).exists() else layout


def default_split(layout: str) -> str:
    """Return the split that is meant for evaluation and has its truth published."""
    return READERS[layout].default_split if layout in READERS else "test"
