"""Write a set of the layout that `dataset` reads, so that no half a sample is ever left behind."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.dataset import RECORD, Sample
from endosdk.datasets.sample_hash import hash_sample
from endosdk.errors import InvalidArgument
from endosdk.io.names import RULE, is_plain_name
from endosdk.io.pictures import DISPARITY_STEPS, LARGEST_DISPARITY
from endosdk.io.whole_files import whole_folder, write_text

PNG_EFFORT = 4  # of 9; more takes several times longer and saves a few per cent

Extras = Mapping[str, Callable[[Path], object]]


def encode_disparity(disparity: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return round(256 d) as uint16 [H,W]; NaN becomes 0. Raises InvalidArgument for what 16 bits cannot hold."""
    known = np.isfinite(disparity)
    scaled = np.round(np.where(known, disparity, 0.0).astype(np.float64) * DISPARITY_STEPS)
    if known.any() and (scaled[known].min() < 1 or scaled[known].max() > LARGEST_DISPARITY * DISPARITY_STEPS):
        seen = (float(disparity[known].min()), float(disparity[known].max()))
        raise InvalidArgument("disparity", f"must lie within 1/256 and {LARGEST_DISPARITY:.3f} px, or be NaN", seen)
    return scaled.astype(np.uint16)


def write_sample(root: Path, split: str, sample: Sample, extras: Extras | None = None) -> str:
    """Write a sample so that its folder appears complete or not at all; return its sha256.

    ``extras`` maps the names of further files to functions that write them at a path.
    """
    if not is_plain_name(sample.id):
        raise InvalidArgument("sample", f"its id {RULE}", repr(sample.id))
    final = root / split / sample.id
    with whole_folder(final, root) as folder:
        for name, image in _pictures(sample).items():
            write_picture(folder / name, image)
        for name, save in (extras or {}).items():
            save(folder / name)
        (folder / "sample.json").write_text(json.dumps(_description(sample), indent=1, sort_keys=True) + "\n")
    return hash_sample(final)


def _description(sample: Sample) -> dict[str, Any]:
    height, width = sample.left.shape[:2]
    camera = {"focal_px": sample.focal_px, "baseline_mm": sample.baseline_mm, "doffs": sample.doffs}
    return {"id": sample.id, "camera": {"width": width, "height": height, **camera}, "info": sample.info}


def _pictures(sample: Sample) -> dict[str, NDArray[Any]]:
    pictures: dict[str, NDArray[Any]] = {
        "left.png": sample.left,
        "right.png": sample.right,
        "disparity.png": encode_disparity(sample.disparity),
    }
    if sample.disparity_right is not None:
        pictures["disparity_right.png"] = encode_disparity(sample.disparity_right)
    if sample.occlusion is not None:
        pictures["occlusion.png"] = sample.occlusion.astype(np.uint8) * np.uint8(255)
    return pictures


def write_picture(path: Path, image: NDArray[Any]) -> None:
    """Write a PNG: RGB uint8 [H,W,3], or one channel [H,W] of 8 or 16 bits."""
    import cv2

    stored = image[..., ::-1] if image.ndim == 3 else image
    done, data = cv2.imencode(".png", np.ascontiguousarray(stored), [cv2.IMWRITE_PNG_COMPRESSION, PNG_EFFORT])
    if not done:
        raise InvalidArgument("sample", f"{path.name} must be a picture PNG can hold", f"{image.dtype} {image.shape}")
    path.write_bytes(data.tobytes())


def write_dataset_record(root: Path, record: dict[str, Any]) -> None:
    """Write ``dataset.json``, which declares the set complete."""
    write_text(root / RECORD, json.dumps(record, indent=1, sort_keys=True) + "\n", "out")
