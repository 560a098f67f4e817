"""The data set on disk: what is written is read, and what is broken is named."""

from __future__ import annotations

import json
import resource
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.datasets.dataset import Sample, find_occlusion, read_disparity, read_sample
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.verifier import verify_dataset
from endosdk.datasets.writer import encode_disparity, write_dataset_record, write_sample
from endosdk.errors import DatasetInvalid, InvalidArgument, StorageFailed


def make_sample(sample_id: str = "000000001") -> Sample:
    rng = np.random.default_rng(int(sample_id))
    disparity = rng.uniform(1.0, 30.0, (24, 32)).astype(np.float32)
    disparity[3:5, 6:9] = np.nan
    return Sample(
        id=sample_id,
        left=rng.integers(0, 256, (24, 32, 3), dtype=np.uint8),
        right=rng.integers(0, 256, (24, 32, 3), dtype=np.uint8),
        disparity=disparity,
        disparity_right=disparity[:, ::-1].copy(),
        occlusion=rng.random((24, 32)) < 0.1,
        focal_px=400.0,
        baseline_mm=9.5,
        doffs=1.25,
        info={"seed": 7},
    )


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A set of two training samples and one test sample."""
    hashes = {
        split: {i: write_sample(tmp_path, split, make_sample(i)) for i in ids}
        for split, ids in (("train", ("000000001", "000000002")), ("test", ("000000003",)))
    }
    write_dataset_record(tmp_path, {"format_version": 1, "name": "small", "samples": hashes})
    return tmp_path


def test_a_sample_with_other_bytes_is_refused_when_first_read(root: Path) -> None:
    reader = open_dataset(root, "train")
    assert reader[0].id == "000000001"
    record = root / "train" / "000000002" / "sample.json"
    whole = record.read_text()
    record.write_text(whole.replace("9.5", "9.25"))
    with pytest.raises(DatasetInvalid, match=r"must have the bytes that dataset.json records.*000000002"):
        reader[1]
    record.write_text(whole)
    assert reader[1].baseline_mm == 9.5


def test_a_sample_survives_the_disk(tmp_path: Path) -> None:
    sample = make_sample()
    write_sample(tmp_path, "train", sample)
    again = read_sample(tmp_path / "train" / sample.id)
    np.testing.assert_array_equal(again.left, sample.left)
    np.testing.assert_array_equal(again.right, sample.right)
    np.testing.assert_array_equal(again.occlusion, sample.occlusion)
    # 16 bits hold steps of 1/256 px, so rounding moves a value by half a step at most; NaN stays NaN.
    np.testing.assert_allclose(again.disparity, sample.disparity, rtol=0, atol=1 / 512 + 1e-6)
    np.testing.assert_allclose(again.disparity_right, sample.disparity_right, rtol=0, atol=1 / 512 + 1e-6)
    assert (again.focal_px, again.baseline_mm, again.doffs) == (400.0, 9.5, 1.25)
    assert again.info == {"seed": 7}


def test_what_is_optional_may_be_absent(tmp_path: Path) -> None:
    sample = replace(make_sample(), disparity_right=None, occlusion=None)
    write_sample(tmp_path, "train", sample)
    again = read_sample(tmp_path / "train" / sample.id)
    assert again.disparity_right is None
    assert again.occlusion is None


def test_disparity_on_disk_follows_kitti(tmp_path: Path) -> None:
    write_sample(tmp_path, "train", replace(make_sample(), disparity=np.full((24, 32), 12.5, np.float32)))
    raw = cv2.imread(str(tmp_path / "train/000000001/disparity.png"), cv2.IMREAD_UNCHANGED)
    assert raw.dtype == np.uint16
    assert (raw == 3200).all()


def test_a_reader_gives_the_samples_in_order(root: Path) -> None:
    reader = open_dataset(root, "train")
    assert reader.name == "small"
    assert reader.ids == ("000000001", "000000002")
    assert [sample.id for sample in reader] == list(reader.ids)
    assert len(open_dataset(root, "test")) == 1


def test_the_hash_of_a_set_follows_its_content(root: Path) -> None:
    before = open_dataset(root, "train").sha256
    record = json.loads((root / "dataset.json").read_text())
    record["samples"]["test"]["000000003"] = "0" * 64
    write_dataset_record(root, record)
    assert open_dataset(root, "train").sha256 != before


def test_verify_passes_a_sound_set(root: Path) -> None:
    assert list(verify_dataset(root)) == [
        ("train/000000001", None),
        ("train/000000002", None),
        ("test/000000003", None),
    ]


def test_verify_finds_what_changed_vanished_or_appeared(root: Path) -> None:
    picture = root / "train/000000001/left.png"
    data = bytearray(picture.read_bytes())
    data[-20] ^= 0x10
    picture.write_bytes(bytes(data))
    shutil.rmtree(root / "train/000000002")
    shutil.copytree(root / "test/000000003", root / "test/000000004")
    faults = dict(verify_dataset(root))
    assert "differ" in str(faults["train/000000001"])
    assert faults["train/000000002"] == "missing"
    assert faults["test/000000004"] == "not in dataset.json"
    assert faults["test/000000003"] is None


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda f: (f / "left.png").unlink(), "left.png must be a file that exists"),
        (lambda f: (f / "right.png").write_bytes(b""), "right.png must be a picture"),
        (
            lambda f: (f / "left.png").write_bytes((f / "left.png").read_bytes()[:30]),
            "left.png must be a whole picture",
        ),
        (lambda f: cv2.imwrite(str(f / "right.png"), np.zeros((9, 9, 3), np.uint8)), "right view must be as large"),
        (
            lambda f: cv2.imwrite(str(f / "disparity_right.png"), np.zeros((24, 31), np.uint16)),
            r"disparity_right\.png must be as large as the left view \(24, 32\); got \(24, 31\)",
        ),
        (
            lambda f: cv2.imwrite(str(f / "occlusion.png"), np.zeros((23, 32), np.uint8)),
            r"occlusion\.png must be as large as the left view \(24, 32\); got \(23, 32\)",
        ),
        (lambda f: cv2.imwrite(str(f / "disparity.png"), np.zeros((24, 32), np.uint8)), "must be 16-bit"),
        (lambda f: (f / "sample.json").write_text("{"), "sample.json must be valid JSON"),
        (lambda f: (f / "sample.json").write_text('{"camera": {"focal_px": 4}}'), "baseline_mm"),
        (
            lambda f: (f / "sample.json").write_text('{"camera": {"focal_px": 0, "baseline_mm": 4}}'),
            "focal length and baseline above 0",
        ),
        (
            lambda f: (f / "sample.json").write_text('{"camera": {"focal_px": 4, "baseline_mm": 4}, "info": 3}'),
            "info must be an object",
        ),
    ],
    ids=[
        "missing",
        "empty",
        "truncated",
        "size",
        "size of the right truth",
        "size of the mask",
        "depth",
        "json",
        "key",
        "camera",
        "info",
    ],
)
def test_a_broken_sample_is_named(root: Path, damage: object, words: str) -> None:
    damage(root / "train/000000001")  # type: ignore[operator]
    reader = open_dataset(root, "train")
    with pytest.raises(DatasetInvalid, match=words):
        reader[0]
    assert reader[1].id == "000000002"


def test_a_folder_in_a_sample_is_named(root: Path) -> None:
    inside = root / "train/000000001/.ipynb_checkpoints"
    inside.mkdir()
    with pytest.raises(DatasetInvalid, match=r"must hold nothing but files that can be read; got .*ipynb_checkpoints"):
        open_dataset(root, "train")[0]
    faults = dict(verify_dataset(root))
    assert str(faults["train/000000001"]).startswith(f"must hold nothing but files that can be read; got {inside} (")
    assert faults["train/000000002"] is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (None, "an unfinished set has none"),
        ("not json", "must be valid JSON"),
        ("[]", "must have the key"),
        ('{"format_version": 1, "name": "x"}', "must have the key samples"),
        ('{"format_version": 99, "name": "x", "samples": {}}', "format_version must be 1"),
        ('{"format_version": 1, "name": "x", "samples": {"train": {}}}', "must map train and test"),
    ],
)
def test_a_broken_record_is_named(root: Path, text: str | None, words: str) -> None:
    (root / "dataset.json").unlink()
    if text is not None:
        (root / "dataset.json").write_text(text)
    with pytest.raises(DatasetInvalid, match=words):
        open_dataset(root, "train")


@pytest.mark.parametrize(("split", "layout", "argument"), [("dev", "endosdk", "split"), ("train", "lmdb", "layout")])
def test_an_unknown_split_or_layout_is_named(root: Path, split: str, layout: str, argument: str) -> None:
    with pytest.raises(InvalidArgument, match=f"^{argument}: "):
        open_dataset(root, split, layout)


@pytest.mark.parametrize("value", [-1.0, 0.0, 300.0])
def test_a_disparity_that_16_bits_cannot_hold_is_refused(value: float) -> None:
    with pytest.raises(InvalidArgument, match=r"^disparity: "):
        encode_disparity(np.array([[5.0, value]], np.float32))


def test_a_sample_that_cannot_be_encoded_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument):
        write_sample(tmp_path, "train", replace(make_sample(), disparity=np.full((24, 32), 400.0, np.float32)))
    assert not (tmp_path / "train").exists()


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageFailed, match=r"^out: "):
        write_sample(tmp_path / "file", "train", make_sample())
    with pytest.raises(StorageFailed, match=r"^out: "):
        write_dataset_record(tmp_path / "file", {})


def test_a_disk_that_fills_up_leaves_nothing_half_written(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))  # no file may grow further: the kernel refuses the write
    try:
        with pytest.raises(StorageFailed, match=r"^out: must be writable"):
            write_sample(tmp_path, "train", make_sample())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []


def test_a_sample_written_again_replaces_the_first(tmp_path: Path) -> None:
    write_sample(tmp_path, "train", make_sample())
    write_sample(tmp_path, "train", replace(make_sample(), baseline_mm=4.0, occlusion=None))
    folder = tmp_path / "train" / "000000001"
    assert read_sample(folder).baseline_mm == 4.0
    assert not (folder / "occlusion.png").exists()


def test_occlusion_of_a_step_is_the_strip_that_the_near_side_hides() -> None:
    # Far (4 px) around a near bar (10 px) in columns 30..39: in the right view the bar covers columns 20..29.
    left = np.full((2, 60), 4.0, np.float32)
    left[:, 30:40] = 10.0
    right = np.full((2, 60), 4.0, np.float32)
    right[:, 20:30] = 10.0
    expected = np.zeros(60, bool)
    expected[:4] = True  # outside the right view
    expected[24:30] = True  # matches at 20..25, which the bar covers; its other columns were hidden from the left
    np.testing.assert_array_equal(find_occlusion(left, right), np.stack([expected, expected]))


def test_truth_that_is_missing_is_hidden() -> None:
    left = np.full((2, 20), 3.0, np.float32)
    left[0, 10] = np.nan
    hidden = find_occlusion(left, np.full((2, 20), 3.0, np.float32))
    assert hidden[0, 10]
    assert not hidden[1, 10]


def test_read_disparity_gives_nan_where_there_is_no_truth(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), np.array([[0, 256]], np.uint16))
    np.testing.assert_array_equal(read_disparity(tmp_path / "d.png"), np.array([[np.nan, 1.0]], np.float32))
