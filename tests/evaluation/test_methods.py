import hashlib
import json
import os

import numpy as np
import pytest

from endosdk import errors
from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.evaluation.methods import Answer, estimator_method, evaluate, sgbm_method, write_worst
from endosdk.io.pictures import read_frame
from tests.conftest import TINY_MODEL, shifted_pair
from tests.datasets.test_layouts import as_16bit, save, save_pfm, write_kitti, write_middlebury

SHIFTS = (6, 12, 18)


@pytest.fixture(scope="module")
def planes(tmp_path_factory):
    """A data set of three planes whose truth is their shift; what the right view does not see is occluded."""
    root = tmp_path_factory.mktemp("planes")
    hashes = {}
    for shift in SHIFTS:
        left, right = shifted_pair(96, 256, shift, seed=shift)
        occlusion = np.zeros((96, 256), bool)
        occlusion[:, :shift] = True
        truth = np.full((96, 256), shift, np.float32)
        sample = Sample(f"{shift:03d}", left, right, truth, None, occlusion, focal_px=200.0, baseline_mm=5.0)
        hashes[sample.id] = write_sample(root, "test", sample)
    record = {"format_version": 1, "name": "planes", "samples": {"train": {}, "test": hashes}}
    write_dataset_record(root, record)
    return root


def off_by_one(sample):
    return Answer(sample.disparity + 1, milliseconds=5.0)


def test_measures_of_a_method_that_is_one_pixel_off(planes):
    scores = evaluate(off_by_one, open_dataset(planes, "test"))
    assert scores["pairs"] == 3
    assert scores["all"]["epe_px"] == pytest.approx(1.0)
    assert scores["all"]["pixels"] == 3 * 96 * 256
    assert scores["non_occluded"]["pixels"] == 3 * 96 * 256 - 96 * sum(SHIFTS)
    expected = np.mean([1000 / s - 1000 / (s + 1) for s in SHIFTS])
    assert scores["all"]["depth_mae_mm"] == pytest.approx(expected, rel=1e-6)
    assert scores["ms_median"] == 5.0


def test_worst_pairs_come_first(planes):
    scores = evaluate(lambda s: Answer(s.disparity + s.disparity / 10), open_dataset(planes, "test"))
    assert [entry["id"] for entry in scores["worst"]] == ["018", "012", "006"]


def test_a_model_and_block_matching_on_the_same_planes(planes):
    reader = open_dataset(planes, "test")
    ours = evaluate(estimator_method(str(TINY_MODEL)), reader)
    sgbm = evaluate(sgbm_method(filled=True), reader)
    sparse = evaluate(sgbm_method(filled=False), reader, pairs=2)
    assert ours["non_occluded"]["epe_px"] < 1.0
    assert ours["all"]["coverage"] == sgbm["all"]["coverage"] == 1.0
    assert sgbm["non_occluded"]["epe_px"] < 1.0
    assert sparse["pairs"] == 2
    assert sparse["all"]["coverage"] < 1.0


def test_no_pair_is_refused(planes, capsys):
    with pytest.raises(errors.InvalidArgument, match="pairs: must be at least 1; got 0"):
        evaluate(sgbm_method(filled=True), open_dataset(planes, "test"), pairs=0)
    assert main(["evaluate", "--model", "sgbm", "--data", str(planes), "--split", "train"]) == 2
    assert "data: must have pairs in its split train; got none in planes" in capsys.readouterr().err


def flat_set(root, disparity, occluded):
    """Write a set of one pair with this truth everywhere, seen by the left camera alone or by both."""
    left, right = shifted_pair(96, 256, 8)
    truth, occlusion = np.full((96, 256), disparity, np.float32), np.full((96, 256), occluded)
    sample = Sample("000", left, right, truth, None, occlusion, focal_px=200.0, baseline_mm=5.0)
    samples = {"train": {}, "test": {"000": write_sample(root, "test", sample)}}
    write_dataset_record(root, {"format_version": 1, "name": "flat", "samples": samples})


def test_a_set_without_truth_is_named(tmp_path, capsys):
    flat_set(tmp_path, np.nan, False)
    assert main(["evaluate", "--model", "sgbm", "--data", str(tmp_path)]) == 2
    assert (
        "dataset: must have truth in its split test; got none in 1 pairs [DATASET_INVALID]" in capsys.readouterr().err
    )


def test_a_region_in_which_no_pixel_counts_is_told(tmp_path, capsys):
    flat_set(tmp_path, 8.0, True)
    assert main(["evaluate", "--model", "sgbm", "--data", str(tmp_path)]) == 0
    printed = capsys.readouterr().out
    assert "non_occluded  no pixel counted: 0 with truth" in printed
    assert "all           EPE" in printed


def test_command_prints_and_writes(planes, tmp_path, capsys):
    out = tmp_path / "new" / "scores"
    assert main(["evaluate", "--model", str(TINY_MODEL), "--data", str(planes), "--out", str(out)]) == 0
    printed = capsys.readouterr()
    assert "EPE" in printed.out
    assert printed.err == ""  # no terminal, no progress bar
    record = json.loads((out / "scores.json").read_text())
    assert record["scores"]["pairs"] == 3
    assert record["data"]["sha256"] == open_dataset(planes, "test").sha256
    assert {"cpu", "versions", "commit", "date"} <= set(record["machine"])
    worst = record["scores"]["worst"]
    assert [entry["epe_px"] for entry in worst] == sorted((entry["epe_px"] for entry in worst), reverse=True)
    pictures = sorted((out / "worst").iterdir())
    assert [path.name for path in pictures] == [f"{rank:02d}_{entry['id']}.png" for rank, entry in enumerate(worst, 1)]
    sample = open_dataset(planes, "test")[worst[0]["index"]]
    shown = read_frame(pictures[0])
    height, width = sample.left.shape[:2]
    assert shown.shape[0] > 2 * height and shown.shape[1] > 2 * width
    assert np.array_equal(shown[34 : 34 + height, 12 : 12 + width], sample.left)


def test_worst_pairs_of_an_earlier_evaluation_go_and_nothing_else(planes, tmp_path):
    folder = tmp_path / "worst"
    folder.mkdir()
    for name in ("07_of-another-set.png", "notes.png", "07_of-another-set.txt", "123_figure.png"):
        (folder / name).write_text("")
    reader = open_dataset(planes, "test")
    written = write_worst(off_by_one, reader, evaluate(off_by_one, reader), folder)
    assert len(written) == len(SHIFTS)
    kept = {"notes.png", "07_of-another-set.txt", "123_figure.png"}
    assert {path.name for path in folder.iterdir()} == {path.name for path in written} | kept


def test_record_repeats_the_run_and_names_the_model(planes, tmp_path):
    options = ["--pairs", "1", "--network-size", "128x96", "--provider", "cpu", "--threads", "1"]
    given = ["evaluate", "--model", str(TINY_MODEL), "--data", str(planes), *options]
    assert main([*given, "--out", str(tmp_path)]) == 0
    record = json.loads((tmp_path / "scores.json").read_text())
    wanted = ["endosdk", "evaluate", "--model", TINY_MODEL.name, "--data", planes.name]
    assert record["command"].split() == [*wanted, "--layout", "endosdk", "--split", "test", *options]
    assert record["model"]["sha256"] == hashlib.sha256(TINY_MODEL.read_bytes()).hexdigest()
    assert set(record["model"]) == {"name", "version", "sha256"}


def test_the_range_of_block_matching_is_set_and_recorded(planes, tmp_path, capsys):
    given = ["evaluate", "--data", str(planes), "--model"]
    for options, found in (([], 80), (["--sgbm-range", "16"], 16)):
        assert main([*given, "sgbm", *options, "--out", str(tmp_path)]) == 0
        record = json.loads((tmp_path / "scores.json").read_text())
        assert record["model"] == {"name": "sgbm", "max_disparity": found}
        assert record["command"].endswith(" ".join(options))
        assert record["scores"]["in_range"]["share"] == pytest.approx(2 / 3 if options else 1)
    for model, value, rule in (
        ("sgbm", "40", "evaluate: sgbm_range: must be a multiple of 16, at least 16; got 40"),
        (str(TINY_MODEL), "16", "sgbm_range: is for --model sgbm; got 16"),
    ):
        assert main([*given, model, "--sgbm-range", value]) == 2
        assert rule in capsys.readouterr().err


def write_maps(folder, planes):
    """Maps that are one pixel off, each in another format."""
    folder.mkdir()
    for sample, name in zip(open_dataset(planes, "test"), (".png", ".pfm", ".npy"), strict=True):
        found = sample.disparity + 1
        found[:, :64] = np.nan
        if name == ".png":
            save(folder / f"{sample.id}.png", as_16bit(found))
        elif name == ".pfm":
            save_pfm(folder / f"{sample.id}.pfm", found)
        else:
            np.save(folder / f"{sample.id}.npy", found)


def test_maps_of_any_program_are_scored(planes, tmp_path, capsys):
    write_maps(tmp_path / "maps", planes)
    given = ["evaluate", "--maps", str(tmp_path / "maps"), "--data", str(planes)]
    assert main([*given, "--out", str(tmp_path / "out")]) == 0
    assert "ms per pair" not in capsys.readouterr().out
    record = json.loads((tmp_path / "out/scores.json").read_text())
    assert record["scores"]["all"]["epe_px"] == pytest.approx(1.0)
    assert record["scores"]["all"]["coverage"] == pytest.approx(0.75)
    assert record["command"].startswith("endosdk evaluate --maps maps --data")
    assert record["model"]["name"] == "maps" and len(record["model"]["sha256"]) == 64
    assert main([*given, "--model", "sgbm"]) == 2
    assert "model: is for what computes maps; leave it out with --maps; got sgbm" in capsys.readouterr().err
    np.save(tmp_path / "maps/012.npy", np.zeros((96, 256), np.float32))
    assert main(given) == 2
    assert "here 012 with one of .png, .pfm, .npy; got 012.pfm, 012.npy" in capsys.readouterr().err
    (tmp_path / "maps/012.pfm").unlink()
    for wrong, said in (
        (np.zeros((96, 255), np.float32), "as large as the left view (96, 256); 012.npy is not; got (96, 255)"),
        (np.zeros((96, 256), np.int32), "must be float arrays [H, W] in .npy files; got int32"),
        (np.array([None]), "must be readable .npy files"),
    ):
        np.save(tmp_path / "maps/012.npy", wrong, allow_pickle=True)
        assert main(given) == 2
        assert said in capsys.readouterr().err
    header = {"descr": "<f4", "fortran_order": False, "shape": (10_000_000, 10_000_000)}
    with (tmp_path / "maps/012.npy").open("wb") as stream:
        np.lib.format.write_array_header_1_0(stream, header)
    assert main(given) == 2
    assert "must be readable .npy files" in capsys.readouterr().err
    header = b"{'descr': ('<f4'"
    (tmp_path / "maps/012.npy").write_bytes(b"\x93NUMPY\x01\x00" + bytes([len(header), 0]) + header)
    assert main(given) == 2
    assert "must be readable .npy files" in capsys.readouterr().err
    (tmp_path / "maps/012.npy").unlink()
    os.mkfifo(tmp_path / "maps/012.npy")  # nobody writes to it
    assert main(given) == 2
    assert "012.npy must be a regular file" in capsys.readouterr().err
    (tmp_path / "maps/006.png").unlink()
    assert main(given) == 2
    assert "maps: must hold one file for each pair, here 006" in capsys.readouterr().err


def test_a_method_must_return_an_answer(planes):
    with pytest.raises(errors.InvalidArgument, match=r"method: must return an Answer.*; got ndarray"):
        evaluate(lambda sample: sample.disparity, open_dataset(planes, "test"))


def test_the_table_tells_answered_from_valid(planes, capsys):
    assert main(["evaluate", "--model", "sgbm", "--data", str(planes)]) == 0
    assert "% answered" in (printed := capsys.readouterr().out) and "% valid" not in printed


@pytest.mark.parametrize(("option", "value"), [("--network-size", "64x64"), ("--provider", "cuda"), ("--threads", "1")])
def test_what_block_matching_has_no_use_for_is_refused(option, value, planes, capsys):
    assert main(["evaluate", "--model", "sgbm", "--data", str(planes), option, value]) == 2
    name = option[2:].replace("-", "_")
    assert f"{name}: is for models; leave it out with sgbm; got {value}" in capsys.readouterr().err


def test_wrong_options_are_told_before_data_is_read(capsys):
    assert main(["evaluate", "--model", str(TINY_MODEL), "--data", "nowhere", "--threads", "0"]) == 2
    assert "threads" in capsys.readouterr().err


def test_command_reads_a_public_layout_and_its_own_split(tmp_path, capsys):
    write_middlebury(tmp_path / "set/artroom1", "2021")
    given = ["--layout", "middlebury", "--data", str(tmp_path / "set")]
    assert main(["evaluate", "--model", str(TINY_MODEL), *given]) == 0
    assert "pixels with truth" in capsys.readouterr().out
    assert main(["evaluate", "--model", "sgbm", *given]) == 2
    assert "must be wider than 80 px" in capsys.readouterr().err
    assert main(["evaluate", "--model", "sgbm", "--layout", "kitti", "--data", str(tmp_path / "set")]) == 2
    assert "must hold samples in the layout kitti, split train" in capsys.readouterr().err


def test_an_estimator_takes_the_camera_of_kitti(tmp_path):
    """The cameras of the car stand half a metre apart."""
    write_kitti(tmp_path, "2015")
    base, name, shift = tmp_path / "training", "000003_10.png", 20
    left, right = shifted_pair(375, 1242, shift)
    save(base / "image_2" / name, left)
    save(base / "image_3" / name, right)
    for truth in ("disp_occ_0", "disp_noc_0"):
        save(base / truth / name, as_16bit(np.full((375, 1242), shift, np.float32)))
    reader = open_dataset(tmp_path, "train", layout="kitti")
    assert (reader[0].focal_px, reader[0].baseline_mm) == (721.5, pytest.approx(532.71, abs=0.01))
    scores = evaluate(estimator_method(str(TINY_MODEL)), reader)
    assert scores["all"]["coverage"] == 1.0
    assert scores["all"]["depth_mae_mm"] > 0


def test_perfect_pair_ranks_last_and_silent_pair_first(planes):
    reader = open_dataset(planes, "test")

    def method(sample):
        silent = sample.id == reader.ids[1]
        return Answer(sample.disparity + (np.nan if silent else sample.id == reader.ids[2]))

    worst = evaluate(method, reader)["worst"]
    assert [(entry["id"], entry["epe_px"]) for entry in worst] == [
        (reader.ids[1], None),
        (reader.ids[2], 1.0),
        (reader.ids[0], 0.0),
    ]


def test_parts_in_range_and_valid_are_those_of_the_estimator(planes):
    scores = evaluate(estimator_method(str(TINY_MODEL), network_size=(64, 24)), open_dataset(planes, "test"))
    assert scores["in_range"]["share"] == 1.0  # the tiny model ends at 31 px of the network
    halved = evaluate(estimator_method(str(TINY_MODEL), network_size=(512, 192)), open_dataset(planes, "test"))
    assert halved["in_range"]["share"] == pytest.approx(
        2 / 3
    )  # 15.25 px of the frame: 6 and 12 are in range, 18 is not
    assert 0.2 < scores["valid"]["share"] < 1.0
    assert scores["valid"]["kpe_3"] <= scores["all"]["kpe_3"]
    assert scores["edges"]["pixels"] == 0
    filled = evaluate(sgbm_method(filled=True), open_dataset(planes, "test"))
    sparse = evaluate(sgbm_method(filled=False), open_dataset(planes, "test"))
    assert filled["valid"]["share"] == sparse["all"]["coverage"] < filled["all"]["coverage"]
    assert filled["in_range"]["share"] == 1.0


def test_pairs_without_a_camera_are_scored_in_pixels(tmp_path, capsys):
    left, right = shifted_pair(96, 256, 8)
    save(tmp_path / "one/left.png", left)
    save(tmp_path / "one/right.png", right)
    truth = np.full((96, 256), 8.0, np.float32)
    truth[:, 128:] = 40.0
    save(tmp_path / "one/disparity.png", as_16bit(truth))
    assert main(["evaluate", "--model", str(TINY_MODEL), "--data", str(tmp_path), "--layout", "plain"]) == 0
    printed = capsys.readouterr().out
    assert "depth error" not in printed
    assert "% flying pixels" in printed
    assert "in_range      EPE" in printed and "(50.0 % of all)" in printed
