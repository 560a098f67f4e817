"""Stereo data sets on disk: their layout, one kind of sample, and a reader.

A set is a folder: ``dataset.json`` and ``<train|test>/<id>/`` with ``left.png``, ``right.png`` (or ``.jpg``, in a set
packed to be kept), ``disparity.png``, optionally ``disparity_right.png`` and ``occlusion.png``, and ``sample.json``.
Disparities are 16-bit pictures of round(256 d), 0 where there is no truth, so they are exact to 1/512 px.
"""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endosdk.datasets.sample_hash import hash_sample
from endosdk.errors import DatasetInvalid, InvalidArgument
from endosdk.io.bounded_read import Refused, read_bounded
from endosdk.io.documents import parse_json
from endosdk.io.names import RULE, is_plain_name
from endosdk.io.picture_bytes import read_picture
from endosdk.io.pictures import DISPARITY_STEPS

FORMAT_VERSION = 1
SPLITS = ("train", "test")
RECORD = "dataset.json"  # written last: it declares a set complete
LARGEST_TEXT = 64 * 1024 * 1024  # bytes: dataset.json of half a million samples
MATCH_TOLERANCE_PX = 1.0


@dataclass(frozen=True)
class Sample:
    """One rectified pair with truth: pictures uint8 [H,W,3] RGB, disparities float32 [H,W] in px, NaN = no truth."""

    id: str
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    disparity: NDArray[np.float32]
    disparity_right: NDArray[np.float32] | None
    occlusion: NDArray[np.bool_] | None  # true where the right view does not see the point
    focal_px: float  # NaN, as the baseline, where the camera is not known
    baseline_mm: float
    doffs: float = 0.0
    info: dict[str, Any] = field(default_factory=dict)

    @property
    def has_camera(self) -> bool:
        """Tell whether depth in mm can be said."""
        return bool(np.isfinite(self.focal_px) and np.isfinite(self.baseline_mm))


def find_occlusion(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where [H,W] the right view does not see what the left one does, from both true disparities.

    A point is seen when one of the two right pixels that its match lies between has its disparity, within 1 px. A right
    pixel without truth sees nothing.
    """
    inside, gap = _gap_at_match(left, right)
    return np.asarray(~(inside & (gap <= MATCH_TOLERANCE_PX)))


def unknown_match(left: NDArray[np.float32], right: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return where [H,W] a left point's match has no truth in the right view: nobody knows whether it is seen there."""
    inside, gap = _gap_at_match(left, right)
    return np.asarray(inside & np.isnan(gap))


def _gap_at_match(
    left: NDArray[np.float32], right: NDArray[np.float32]
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """Return where a left point's match lies inside the right view, and how far the disparity there is from its own.

    Of the two right pixels that the match lies between the better one counts; NaN where neither has truth.
    """
    width = left.shape[1]
    column = np.arange(width, dtype=np.float32)[None, :] - left
    inside = (column >= 0) & np.isfinite(left)
    first = np.clip(np.floor(np.where(inside, column, 0)).astype(np.int64), 0, width - 1)
    second = np.minimum(first + 1, width - 1)
    gaps = [np.abs(np.take_along_axis(right, index, 1) - left) for index in (first, second)]
    return inside, np.fmin(gaps[0], gaps[1])


def film_of(sample_id: str) -> str:
    """Name the film of which a sample is a frame: its id up to a dash and the number of the frame, else its id."""
    name, _, frame = sample_id.rpartition("-")
    return name if name and frame.isdecimal() else sample_id


class DatasetReader(ABC):
    """The samples of one split, read from disk when asked for: those of ``ids``, in their order."""

    name: str  # of the set
    split: str
    ids: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.ids)

    def __iter__(self) -> Iterator[Sample]:
        return (self[i] for i in range(len(self)))

    @abstractmethod
    def __getitem__(self, index: int) -> Sample:
        """Read sample ``index``. Raises DatasetInvalid."""

    def film(self, index: int) -> str:
        """Name the film of which a sample is a frame: the samples of one film resemble each other."""
        return film_of(self.ids[index])

    @property
    @abstractmethod
    def sha256(self) -> str:
        """Hash of the set, which stands in records and model files."""

    @property
    @abstractmethod
    def split_sha256(self) -> str:
        """Hash of the samples of this split alone: equal where two splits hold the same ones."""


class EndosdkReader(DatasetReader):
    """One split of a set in our own layout.

    A sample must have the bytes that ``dataset.json`` records, which is checked when it is first read.
    """

    def __init__(self, root: Path, split: str) -> None:
        """Read ``dataset.json`` of the set at ``root``."""
        if split not in SPLITS:
            raise InvalidArgument("split", f"must be one of {', '.join(SPLITS)}", split)
        self.root = root
        self.split = split
        record = read_record(root)
        self.name = record["name"]
        self.record = record
        self._hashes: dict[str, str] = record["samples"][split]
        self.ids = tuple(sorted(self._hashes))
        self._verified: set[str] = set()

    def __getitem__(self, index: int) -> Sample:
        sample_id = self.ids[index]
        folder = self.root / self.split / sample_id
        if sample_id not in self._verified:
            sample = read_sample(folder)  # says which file is missing or wrong
            if hash_sample(folder) != self._hashes[sample_id]:
                rule = "must have the bytes that dataset.json records; endosdk simulate --check DIR lists what differs"
                raise DatasetInvalid("sample", rule, folder)
            self._verified.add(sample_id)
            return sample
        return read_sample(folder)

    def film(self, index: int) -> str:
        """Name the film of which a sample is a frame, or the organ that it looks at with other samples."""
        share, sample_id = self.record.get("pairs_per_organ", 1), self.ids[index]
        if share == 1 or not sample_id.isdecimal():
            return film_of(sample_id)
        return f"organ-{int(sample_id) // share}"

    @property
    def sha256(self) -> str:
        """Hash of the whole set: of the recorded hashes of all its samples."""
        lines = [f"{s}/{i}:{h}" for s in SPLITS for i, h in sorted(self.record["samples"][s].items())]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()

    @property
    def split_sha256(self) -> str:
        """Hash of the recorded hashes of the samples of this split."""
        lines = [f"{i}:{h}" for i, h in sorted(self._hashes.items())]
        return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def read_record(root: Path, file: str = RECORD) -> dict[str, Any]:
    """Return the contents of ``dataset.json``, or of a ``file`` like it, checked for the keys every set has."""
    path = root / file
    if not path.exists():
        if not root.is_dir():
            raise DatasetInvalid("dataset", "must be a folder that is there", root)
        rule = "must hold dataset.json; an unfinished set has none, and other formats need --layout"
        raise DatasetInvalid("dataset", rule, root)
    record: dict[str, Any] = read_json(path, "dataset")
    for key in ("format_version", "name", "samples"):
        if not isinstance(record, dict) or key not in record:
            raise DatasetInvalid("dataset", f"dataset.json must have the key {key}", path)
    if record["format_version"] != FORMAT_VERSION:
        raise DatasetInvalid("dataset", f"format_version must be {FORMAT_VERSION}", record["format_version"])
    _check_samples(record["samples"], path)
    share = record.get("pairs_per_organ", 1)
    if type(share) is not int or share < 1:
        raise DatasetInvalid("dataset", "pairs_per_organ must be a whole number from 1", repr(share))
    if not isinstance(record["name"], str):
        raise DatasetInvalid("dataset", "name must be text", repr(record["name"]))
    return record


def _check_samples(samples: Any, path: Path) -> None:
    if not isinstance(samples, dict) or any(not isinstance(samples.get(split), dict) for split in SPLITS):
        raise DatasetInvalid("dataset", "samples must map train and test to ids and hashes", path)
    for split in SPLITS:
        for sample_id, sha256 in samples[split].items():
            if not is_plain_name(sample_id):
                raise DatasetInvalid("dataset", f"an id {RULE}", repr(sample_id))
            if not isinstance(sha256, str):
                raise DatasetInvalid("dataset", f"the hash of {split}/{sample_id} must be text", repr(sha256))


def read_json(path: Path, argument: str) -> Any:
    """Return the value of a JSON file of a data set. Raises DatasetInvalid."""
    try:
        return parse_json(read_text(path, argument))
    except Refused as error:
        raise DatasetInvalid(argument, f"{path.name} {error.rule}", f"{error.value} in {path}") from error


def read_text(path: Path, argument: str) -> str:
    """Return the text of a file of a data set. Raises DatasetInvalid."""
    try:
        return read_bounded(path, LARGEST_TEXT).decode()
    except Refused as error:
        raise DatasetInvalid(argument, f"{path.name} {error.rule}", f"{error.value} in {path}") from error
    except UnicodeDecodeError as error:
        raise DatasetInvalid(argument, f"{path.name} must be text in UTF-8", path) from error


def read_sample(folder: Path) -> Sample:
    """Read one sample folder. Raises DatasetInvalid naming the file that is missing or wrong."""
    record = read_sample_record(folder)
    left, right = read_colours(view_file(folder, "left")), read_colours(view_file(folder, "right"))
    disparity = read_disparity(folder / "disparity.png")
    other = read_disparity(folder / "disparity_right.png") if (folder / "disparity_right.png").exists() else None
    occlusion = read_gray(folder / "occlusion.png") > 0 if (folder / "occlusion.png").exists() else None
    for name, array in (
        ("right view", right),
        ("disparity.png", disparity),
        ("disparity_right.png", other),
        ("occlusion.png", occlusion),
    ):
        if array is not None and array.shape[:2] != left.shape[:2]:
            raise DatasetInvalid(
                "sample", f"{name} must be as large as the left view {left.shape[:2]}", array.shape[:2]
            )
    require_within_frame(folder / "disparity.png", disparity)
    camera = record["camera"]
    return Sample(
        id=folder.name,
        left=left,
        right=right,
        disparity=disparity,
        disparity_right=other,
        occlusion=occlusion,
        focal_px=float(camera["focal_px"]),
        baseline_mm=float(camera["baseline_mm"]),
        doffs=float(camera.get("doffs", 0.0)),
        info=record.get("info", {}),
    )


def view_file(folder: Path, view: str) -> Path:
    """Return the file of a sample's ``left`` or ``right`` view: a PNG, or the JPEG of a packed set."""
    packed = folder / f"{view}.jpg"
    return packed if packed.exists() else folder / f"{view}.png"


def read_sample_record(folder: Path) -> dict[str, Any]:
    """Return the contents of a sample's ``sample.json``. Raises DatasetInvalid."""
    path = folder / "sample.json"
    try:
        record = read_json(path, "sample")
        camera = record["camera"]
        numbers = [float(camera[key]) for key in ("focal_px", "baseline_mm")] + [float(camera.get("doffs", 0.0))]
        if not np.isfinite(numbers).all() or min(numbers[:2]) <= 0:
            raise ValueError("they must be finite, focal length and baseline above 0")
        if not isinstance(record.get("info", {}), dict):
            raise TypeError("info must be an object")
        return dict(record)
    except DatasetInvalid:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        rule = "sample.json must be JSON with camera.focal_px and camera.baseline_mm, and perhaps an object info"
        raise DatasetInvalid("sample", rule, f"{path}: {error!r}") from error


def require_within_frame(path: Path, truth: NDArray[np.float32]) -> None:
    """Raise DatasetInvalid where the truth of a file leads further than the frame is wide."""
    largest = float(np.max(truth, initial=0.0, where=np.isfinite(truth)))
    if largest > truth.shape[1]:
        raise DatasetInvalid("sample", f"{path} must hold at most the frame's width, {truth.shape[1]} px", largest)


def _decode(path: Path, mode: str) -> NDArray[Any]:
    try:
        return read_picture(path, mode)
    except Refused as error:
        raise DatasetInvalid("sample", f"{path.name} {error.rule}", f"{error.value} in {path}") from error


def _decode_bytes(path: Path, mode: str) -> NDArray[np.uint8]:
    # As deep as it is stored: OpenCV would otherwise cut 16 bits to 8, and leave a 12-bit picture black.
    picture = _decode(path, f"{mode}|IMREAD_ANYDEPTH")
    if picture.dtype != np.uint8:
        raise DatasetInvalid("sample", f"{path.name} must have 8 bits per channel", f"{picture.dtype} in {path}")
    return picture


def read_colours(path: Path) -> NDArray[np.uint8]:
    """Read a picture as RGB [H,W,3]; a gray one has three equal channels.

    Raises DatasetInvalid when it is none of 8 bits.
    """
    return np.ascontiguousarray(_decode_bytes(path, "IMREAD_COLOR")[..., ::-1])


def read_gray(path: Path) -> NDArray[np.uint8]:
    """Read a picture as one channel [H,W]. Raises DatasetInvalid when it is none of 8 bits."""
    return _decode_bytes(path, "IMREAD_GRAYSCALE")


def read_disparity(path: Path) -> NDArray[np.float32]:
    """Read a 16-bit disparity picture, px; NaN where it holds 0. Raises DatasetInvalid when it is none."""
    raw = _decode(path, "IMREAD_UNCHANGED")
    if raw.dtype != np.uint16 or raw.ndim != 2:
        raise DatasetInvalid("sample", f"{path.name} must be 16-bit with one channel", f"{raw.dtype} {raw.shape}")
    known = raw.astype(np.float32) / np.float32(DISPARITY_STEPS)
    return np.where(raw > 0, known, np.float32(np.nan)).astype(np.float32)
