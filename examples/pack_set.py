"""Pack the finished test pairs of a rendered set into small files: ``python examples/pack_set.py SET PACKED``.

- Views become JPEG without chroma subsampling.
- The ground truth of the left view and the occlusion mask stay exact.
- The ground truth of the right view is omitted. The rasteriser can make it again.
- Pairs that are packed already do not change. So you can run the script again while the set grows.
- The record of the packed set is written when all pairs are packed.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import cv2
import numpy as np

from endosdk.datasets.dataset import FORMAT_VERSION, read_colours, read_gray, read_sample
from endosdk.datasets.verifier import hash_sample
from endosdk.datasets.writer import encode_disparity

QUALITY = 93
VIEW = [
    *(cv2.IMWRITE_JPEG_QUALITY, QUALITY),
    *(cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444),
    *(cv2.IMWRITE_JPEG_OPTIMIZE, 1),
]


def pack(source: Path, folder: Path) -> None:
    """Write one packed sample; its record says what the packing did."""
    partial = folder.with_name(f".partial-{folder.name}")
    partial.mkdir(parents=True, exist_ok=True)
    sample = read_sample(source)
    noise = []
    for name, picture in (("left", sample.left), ("right", sample.right)):
        cv2.imwrite(str(partial / f"{name}.jpg"), picture[..., ::-1], VIEW)
        noise.append(cv2.PSNR(picture, read_colours(partial / f"{name}.jpg")))
    truth = encode_disparity(sample.disparity)
    cv2.imwrite(str(partial / "disparity.png"), truth, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    mask = read_gray(source / "occlusion.png")
    cv2.imwrite(str(partial / "occlusion.png"), mask, [cv2.IMWRITE_PNG_BILEVEL, 1])
    record = json.loads((source / "sample.json").read_text())
    record["packed"] = {"from_sha256": hash_sample(source), "jpeg_quality": QUALITY, "psnr_db": noise}
    (partial / "sample.json").write_text(json.dumps(record, sort_keys=True) + "\n")
    partial.rename(folder)


def main(source: Path, target: Path) -> None:
    """Pack what is finished; write the packed set's record when nothing is missing."""
    folders = sorted((source / "test").glob("[0-9]*"))
    if not folders:
        raise SystemExit(f"{source} has no finished test pairs; endosdk simulate renders them with --test-pairs")
    recipe = json.loads((source / "recipe.json").read_text())
    for folder in folders:
        if not (target / "test" / folder.name).exists():
            pack(folder, target / "test" / folder.name)
    shutil.copy(source / "recipe.json", target / "recipe.json")
    packed = {folder.name: folder for folder in sorted((target / "test").glob("[0-9]*"))}
    records = [json.loads((folder / "sample.json").read_text()) for folder in packed.values()]
    noise = [value for record in records for value in record["packed"]["psnr_db"]]
    whole = {
        "format_version": FORMAT_VERSION,
        "name": target.resolve().name,
        "version": recipe["generator_version"],
        "generator_version": recipe["generator_version"],
        "renderers": sorted({record["info"]["renderer"] for record in records}),
        "organ": recipe["organ"],
        "rig": recipe["rig"],
        "camera": recipe["camera"],
        "disparity_limits_px": recipe["limits"],
        "seeds": {"test": [min(map(int, packed)), max(map(int, packed))]},
        "packing": {"jpeg_quality": QUALITY, "psnr_db_mean": float(np.mean(noise)), "psnr_db_least": min(noise)},
        "samples": {"train": {}, "test": {name: hash_sample(folder) for name, folder in packed.items()}},
    }
    if len(packed) == recipe["test_pairs"]:
        (target / "dataset.json").write_text(json.dumps(whole, indent=1, sort_keys=True) + "\n")
    size = sum(path.stat().st_size for path in target.rglob("*") if path.is_file())
    print(f"{len(packed)} of {recipe['test_pairs']} pairs, {size / 1e6:.1f} MB, {np.mean(noise):.1f} dB")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
