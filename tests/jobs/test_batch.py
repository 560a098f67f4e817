"""Depth of whole archives: what `predict` gives for every pair, whoever computes it and however often it stops."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk import DepthEstimator, StereoCalibration
from endosdk.commands.cli import main
from endosdk.errors import DatasetInvalid, InvalidArgument, ModelNotFound
from endosdk.io.pictures import read_frame, write_picture
from endosdk.jobs.batch import Settings, find_pairs, run_batch
from endosdk.runtime.limits import Limits
from tests.ray_cluster import a_worker_killed, ray_cluster, ray_quiet

EXAMPLES = Path(__file__).parents[2] / "examples" / "data"
NAMES = [f"frame_{number:03d}_left" for number in range(10)]  # more than a worker is given at a time


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Ten different rectified pairs, cut out of the one that comes with the package."""
    root = tmp_path_factory.mktemp("archive")
    estimator = DepthEstimator("fast", calibration=StereoCalibration.load(EXAMPLES / "rig.json"))
    views = estimator.rectify(*(read_frame(EXAMPLES / "demo" / f"{side}.png") for side in ("left", "right")))
    for side, view in zip(("left", "right"), views, strict=True):
        (root / side).mkdir()
        for number, name in enumerate(NAMES):
            part = view[100 + 20 * number : 340 + 20 * number, 200 + 30 * number : 520 + 30 * number]
            write_picture(root / side / f"{name.replace('left', side)}.png", np.ascontiguousarray(part))
    return root


@pytest.fixture(scope="module")
def settings() -> Settings:
    rig = StereoCalibration.rectified(focal_px=400.0, baseline_mm=10.0, size=(320, 240))
    return Settings("fast", calibration=rig, threads=1)


def contents(out: Path) -> dict[str, bytes]:
    return {str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def many(archive: Path, root: Path, count: int) -> None:
    """Make an archive whose pairs are all the same."""
    for side in ("left", "right"):
        (root / side).mkdir()
        for number in range(count):
            (root / side / f"{number}.png").symlink_to(archive / side / f"frame_000_{side}.png")


@pytest.fixture(scope="module")
def done(archive: Path, settings: Settings, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("done") / "out"
    record = run_batch(find_pairs(archive / "left", archive / "right"), settings, out)
    assert sum(record["status"].values()) == len(NAMES) and record["failed"] == {}
    assert record == json.loads((out / "batch.json").read_text())
    return out


def test_a_batch_gives_what_predict_gives(archive, settings, done):
    estimator = DepthEstimator("fast", calibration=settings.calibration, threads=1)
    for name in NAMES:
        left, right = (read_frame(archive / side / f"{name.replace('left', side)}.png") for side in ("left", "right"))
        result = estimator.predict(left, right)
        folder = done / "pairs" / name
        disparity = cv2.imread(str(folder / "disparity.png"), cv2.IMREAD_UNCHANGED)
        levels = np.where(result.reasons == 0, np.rint(result.disparity * 256), 0)
        np.testing.assert_array_equal(disparity, levels.astype(np.uint16))
        np.testing.assert_array_equal(np.load(folder / "depth.npy"), result.depth)
        np.testing.assert_array_equal(np.load(folder / "sigma.npy"), result.sigma)
        np.testing.assert_array_equal(read_frame(folder / "left_rectified.png"), left)  # of a rectified rig
        described = json.loads((folder / "result.json").read_text())
        assert described["causes"].keys() == {cause.name for cause in result.causes}
        assert (described["size"], described["model"]["name"]) == ([320, 240], "fast")
        assert described["status"] == result.status.name
        assert described["median_depth_mm"] == pytest.approx(np.nanmedian(result.depth), abs=1e-3)
        assert (described["geometry"]["focal_px"], described["geometry"]["baseline_mm"]) == (400.0, 10.0)


def test_several_processes_give_the_same_bytes(archive, settings, done, tmp_path):
    run_batch(find_pairs(archive / "left", archive / "right"), settings, tmp_path / "out", workers=2)
    assert contents(tmp_path / "out") == contents(done)


@pytest.mark.slow
@ray_quiet
def test_a_killed_worker_of_a_ray_cluster_loses_nothing(archive, settings, done, tmp_path):
    many(archive, tmp_path, 80)
    pairs = find_pairs(tmp_path / "left", tmp_path / "right")
    with ray_cluster():
        with pytest.raises(InvalidArgument, match="threads: must be at most 2, the processors of the largest machine"):
            run_batch(pairs, replace(settings, threads=3), tmp_path / "none", workers=2, ray=True)
        with a_worker_killed(tmp_path / "out", "pairs/*"):
            run_batch(pairs, settings, tmp_path / "out", workers=2, ray=True)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [".lock", "batch.json", "pairs"]
    expected = contents(done / "pairs" / NAMES[0])
    expected.pop("result.json")  # it has the names
    for number in range(80):
        found = contents(tmp_path / "out" / "pairs" / str(number))
        assert json.loads(found.pop("result.json"))["left"] == f"{number}.png"
        assert found == expected


def test_the_answer_of_a_pair_depends_on_that_pair_alone(archive, settings, tmp_path):
    """As frames of one sequence, the same pair would be a frozen one from the 25th on."""
    many(archive, tmp_path, 27)
    record = run_batch(find_pairs(tmp_path / "left", tmp_path / "right"), settings, tmp_path / "out")
    assert list(record["status"].values()) == [27]
    described = [json.loads((tmp_path / "out" / "pairs" / name / "result.json").read_text()) for name in ("0", "26")]
    assert described[0]["causes"] == described[1]["causes"]
    assert described[0]["files"] == described[1]["files"]


def test_the_summary_names_the_causes_and_their_remedies(archive, tmp_path, capsys):
    shutil.copytree(archive / "left", tmp_path / "again")
    words = ["batch", str(archive / "left"), str(tmp_path / "again"), "--out", str(tmp_path / "out")]
    assert main(words) == 1
    said = (
        f"SAME_VIEW_TWICE in {len(NAMES)} pairs: one camera is connected to both inputs; connect each camera to its own"
    )
    assert said in capsys.readouterr().out
    assert json.loads((tmp_path / "out" / "batch.json").read_text())["causes"]["SAME_VIEW_TWICE"] == len(NAMES)
    assert main([*words, "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["causes"]["SAME_VIEW_TWICE"] == len(NAMES)


def test_one_word_names_both_folders(archive, done, tmp_path, capsys):
    mixed = tmp_path / "mixed"
    mixed.mkdir()
    for picture in archive.glob("*/*.png"):
        shutil.copy(picture, mixed)
    words = {"folder": str(archive), "two": f"{archive / 'left'},{archive / 'right'}", "one": str(mixed)}
    for name, word in words.items():
        assert main(["batch", word, "--out", str(tmp_path / name), "--threads", "1"]) in (0, 1)
        assert sorted(path.name for path in (tmp_path / name / "pairs").iterdir()) == sorted(NAMES)
    assert main(["batch", str(archive / "left"), "--out", str(tmp_path / "none")]) == 2
    assert "frame_002_left.png and 7 more without a partner" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert main(["batch", str(tmp_path / "empty"), "--out", str(tmp_path / "none")]) == 2
    assert "source: must be LEFT,RIGHT, two folders, or a folder with left and right" in capsys.readouterr().err


def test_a_batch_is_continued_and_not_computed_again(archive, settings, done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done, out)
    shutil.rmtree(out / "pairs" / NAMES[3])
    (out / ".partial-frame_003_left-1").mkdir()  # of a process that was killed
    kept = out / "pairs" / NAMES[4] / "disparity.png"
    begun = kept.stat().st_mtime_ns
    run_batch(find_pairs(archive / "left", archive / "right"), settings, out)
    assert kept.stat().st_mtime_ns == begun
    assert contents(out) == contents(done) and not list(out.glob(".partial-*"))


@pytest.mark.parametrize("workers", ["1", "2"])
def test_an_interrupted_batch_says_how_to_go_on(archive, tmp_path, workers):
    many(archive, tmp_path, 500)
    out = tmp_path / "out"
    # A shell starts what it puts in the background with control-C ignored, which tests begun there would hand on.
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    program = f"{heed}; import sys; from endosdk.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    words = ["batch", str(tmp_path / "left"), str(tmp_path / "right"), "--out", str(out), "--workers", workers]
    run = subprocess.Popen(
        [sys.executable, "-c", program, *words], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    limit = time.monotonic() + 120
    while not list(out.glob("pairs/*")):
        assert run.poll() is None and time.monotonic() < limit
        time.sleep(0.02)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does to all of its processes
    said = run.communicate(timeout=120)[1]
    assert run.returncode == 130 and "Traceback" not in said
    assert said.endswith(f"endosdk batch: stopped; the same command continues {out}\n")
    assert 0 < len(list(out.glob("pairs/*"))) < 500


def test_a_finished_pair_that_was_damaged_is_named(archive, settings, done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done, out)
    (out / "pairs" / NAMES[2] / "result.json").write_text("{}")
    with pytest.raises(DatasetInvalid, match=rf"delete its folder.*{NAMES[2]}"):
        run_batch(find_pairs(archive / "left", archive / "right"), settings, out)


def test_maps_of_other_pictures_of_the_same_names_are_refused(archive, settings, done, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(done, out)
    shutil.copytree(archive, tmp_path / "other")
    shutil.copy(archive / "left" / f"{NAMES[1]}.png", tmp_path / "other" / "left" / f"{NAMES[0]}.png")
    with pytest.raises(DatasetInvalid, match=rf"a finished pair is of other pictures; .*{NAMES[0]}"):
        run_batch(find_pairs(tmp_path / "other" / "left", tmp_path / "other" / "right"), settings, out)
    assert contents(out) == contents(done)


def test_a_picture_that_cannot_be_used_is_told_and_tried_again(archive, done, tmp_path, capsys):
    shutil.copytree(archive, tmp_path / "in")
    broken = tmp_path / "in" / "right" / "frame_001_right.png"
    broken.write_bytes(b"no picture")
    words = ["batch", str(tmp_path / "in" / "left"), str(tmp_path / "in" / "right"), "--out", str(tmp_path / "out")]
    assert main(words) == 1
    printed = capsys.readouterr().out
    assert f"FAILED     {NAMES[1]}: frame: must be a picture (PNG, JPEG, BMP, TIFF, PGM or PPM); got" in printed
    assert not (tmp_path / "out" / "pairs" / NAMES[1]).exists()
    shutil.copy(archive / "right" / broken.name, broken)
    assert main(words) == 0
    assert len(list((tmp_path / "out" / "pairs").iterdir())) == len(NAMES)
    for name in ("depth.*", "sigma.*", "left_rectified.*"):
        assert not list((tmp_path / "out" / "pairs").glob(f"*/{name}")), "no rig, no depth"


def test_pictures_of_16_bits_are_read_as_they_are_said_to_be(archive, tmp_path, capsys):
    for side in ("left", "right"):
        (tmp_path / side).mkdir()
        for name in NAMES[:2]:
            picture = read_frame(archive / side / f"{name.replace('left', side)}.png")
            write_picture(tmp_path / side / f"{name}.png", picture.astype(np.uint16) * 16)
    words = ["batch", str(tmp_path), "--threads", "1"]
    assert main([*words, "--out", str(tmp_path / "refused")]) == 1
    assert "say how many of the 16 are used, 10, 12 or 16, by bits=, or --bits" in capsys.readouterr().out
    assert main([*words, "--out", str(tmp_path / "out"), "--bits", "12"]) == 0
    assert json.loads((tmp_path / "out" / "batch.json").read_text())["settings"]["bits"] == 12
    with pytest.raises(InvalidArgument, match="bits: must be one of 10, 12, 16; got 8"):
        run_batch(find_pairs(tmp_path / "left", tmp_path / "right"), Settings("fast", bits=8), tmp_path / "none")


def test_another_model_does_not_mix_into_a_batch(archive, settings, done):
    pairs = find_pairs(archive / "left", archive / "right")
    for change, seen in (
        ({"model": "fast-fp32"}, 'model.name "fast", not "fast-fp32"'),
        ({"network_size": (160, 120)}, "network_size null, not [160, 120]"),
        ({"limits": Limits(0.8)}, "min_confidence 0.9, not 0.8"),
        ({"bits": 12}, "bits null, not 12"),
    ):
        said = f"out: must be new, or a batch of the same model, rig, size, limits.*, begun with {re.escape(seen)} "
        with pytest.raises(InvalidArgument, match=said):
            run_batch(pairs, replace(settings, **change), done)


@pytest.mark.parametrize(
    ("text", "rule"),
    [
        ("", r"batch\.json must be what this command wrote"),
        ("[]", r"batch\.json must be what this command wrote"),
        ('{"format_version": 0, "settings": {}}', "must be new, or a batch of .* this version"),
    ],
)
def test_a_record_that_is_none_of_ours_is_refused(archive, settings, tmp_path, text, rule):
    (tmp_path / "batch.json").write_text(text)
    with pytest.raises(InvalidArgument, match=f"out: {rule}"):
        run_batch(find_pairs(archive / "left", archive / "right"), settings, tmp_path)


@pytest.mark.parametrize(
    ("changes", "error", "rule"),
    [
        ({"workers": 0}, InvalidArgument, "workers: must be at least 1"),
        ({"settings": Settings("fastest")}, ModelNotFound, "model"),
        ({"settings": Settings("fast", provider="cuda"), "ray": True}, InvalidArgument, "provider: must be cpu"),
    ],
)
def test_bad_settings_leave_nothing_behind(archive, tmp_path, changes, error, rule):
    given = {"settings": Settings("fast"), **changes}
    with pytest.raises(error, match=rule):
        run_batch(find_pairs(archive / "left", archive / "right"), given.pop("settings"), tmp_path / "out", **given)
    assert not (tmp_path / "out").exists()


def test_a_folder_with_other_things_is_left_alone(archive, settings, tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidArgument, match="out: must be an empty or new folder"):
        run_batch(find_pairs(archive / "left", archive / "right"), settings, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [".lock", "thesis.txt"]
