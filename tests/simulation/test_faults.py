"""Spoiled pictures: each fault does what it says, the truth stays exact, and there is none where nothing is seen."""

from __future__ import annotations

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

from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample, find_occlusion
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.simulation.faults import chips, colours, field, lens, rows
from endosdk.simulation.faults.spoil import Faults, draw_faults, spoil
from endosdk.simulation.noise import fractal_tile
from tests.simulation.matched_views import at_match

HEIGHT, WIDTH, SHIFT = 180, 240, 24.0
QUIET = chips.Chip(1.0, (1.0, 1.0, 1.0), 1.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0)
NO_PROCESSOR = chips.Processor(None, 0.0, 0.0, False, 0, False)
NOTHING = Faults("white", None, (), (), None, None, (), (QUIET, QUIET), NO_PROCESSOR)


@pytest.fixture(scope="module")
def sample() -> Sample:
    """A textured wall at 24 px, in front of which the middle third stands at 40 px."""
    rng = np.random.default_rng(5)
    wall, front = (60 + 60 * np.tanh(fractal_tile(rng, (HEIGHT, WIDTH), 24.0, 4, 0.7)) + 40 for _ in range(2))
    columns, lines = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    standing = [(columns + d > 100) & (columns + d < 170) & (lines > 50) & (lines < 130) for d in (0, 40)]
    truth = [np.where(there, 40.0, SHIFT).astype(np.float32) for there in standing]
    picture = [
        np.where(there, np.roll(front, -d1, 1), np.roll(wall, -d0, 1))
        for there, d0, d1 in ((standing[0], 0, 0), (standing[1], int(SHIFT), 40))
    ]
    left, right = (np.stack([p, 0.8 * p, 0.6 * p], -1).clip(0, 255).astype(np.uint8) for p in picture)
    return Sample("one", left, right, truth[0], truth[1], find_occlusion(truth[0], truth[1]), 200.0, 5.0)


def spoilt(sample: Sample, **changes: object) -> Sample:
    return spoil(sample, replace(NOTHING, **changes), (1, 23))  # type: ignore[arg-type]


def inner(occlusion: np.ndarray) -> np.ndarray:
    return cv2.erode((~occlusion).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0


def test_no_fault_changes_nothing_but_the_record(sample: Sample) -> None:
    same = spoilt(sample)
    for name in ("left", "right", "disparity", "disparity_right", "occlusion"):
        np.testing.assert_array_equal(getattr(same, name), getattr(sample, name))
    assert same.info["faults"]["look"] == "white"


def test_faults_are_a_function_of_their_seed(sample: Sample) -> None:
    drawn = [draw_faults((seed, 22), 0.75) for seed in range(200)]
    assert 0 < sum(one is None for one in drawn) < 40
    assert drawn == [draw_faults((seed, 22), 0.75) for seed in range(200)]
    faults = next(one for one in drawn if one is not None)
    first, again = (spoil(sample, faults, (4, 23)) for _ in range(2))
    assert first.left.tobytes() == again.left.tobytes()
    assert first.right.tobytes() == again.right.tobytes()
    assert first.left.tobytes() != spoil(sample, faults, (5, 23)).left.tobytes()
    assert first.info["faults"] == faults.described()


def test_every_fault_comes_and_either_eye_is_the_blurred_one() -> None:
    drawn = [one for one in (draw_faults((seed, 22), 0.75) for seed in range(400)) if one is not None]
    for name in ("smoke", "droplets", "glints", "rows", "fields", "labels"):
        share = np.mean([bool(getattr(one, name)) for one in drawn])
        assert 0.05 < share < 0.65, name
    assert {one.look for one in drawn} == set(colours.LOOKS)
    assert {one.fields[0].shape for one in drawn if one.fields} == set(field.SHAPES)
    blurred = [np.sign(one.chips[0].blur_px - one.chips[1].blur_px) for one in drawn]
    assert 0.08 < np.mean(np.array(blurred) > 0) < 0.4
    assert 0.08 < np.mean(np.array(blurred) < 0) < 0.4
    assert {drop.eye for one in drawn for drop in one.droplets} == {0, 1}
    assert max(chip.noise for one in drawn for chip in one.chips) > 10


@pytest.mark.parametrize("shape", field.SHAPES)
def test_there_is_no_truth_outside_the_field_of_view(sample: Sample, shape: str) -> None:
    down = 0.3 if shape in ("rounded", "bars") else 0.35
    fields = (
        field.Field(shape, 0.5, 0.375, 0.35, down, 6.0, 2.0),
        field.Field(shape, 0.53, 0.37, 0.36, down, 9.0, 2.0),
    )
    seen = spoilt(sample, fields=fields)
    assert seen.disparity_right is not None
    assert seen.occlusion is not None
    for view, truth, one in ((seen.left, seen.disparity, fields[0]), (seen.right, seen.disparity_right, fields[1])):
        outside = np.isnan(truth)
        assert 0.2 < outside.mean() < 0.7
        deep = cv2.erode(outside.astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
        assert abs(view[deep].mean() - one.level) < 1.5
        assert view[deep].std() > 1
    assert np.array_equal(seen.disparity[~np.isnan(seen.disparity)], sample.disparity[~np.isnan(seen.disparity)])
    # What the other eye's field hides is seen by one eye alone.
    matches = np.arange(WIDTH) - np.nan_to_num(seen.disparity).astype(int)
    hidden = np.isnan(np.take_along_axis(seen.disparity_right, np.maximum(matches, 0), 1)) & ~np.isnan(seen.disparity)
    assert hidden.any()
    borders = seen.occlusion[hidden]  # of which one neighbour may be seen
    assert borders.mean() > 0.95


def test_a_label_has_no_truth_and_is_written_where_it_says(sample: Sample) -> None:
    label = field.Label("REC", 0.1, 0.2, 0.05, 250.0, (0,))
    seen = spoilt(sample, labels=(label,))
    box = np.isnan(seen.disparity)
    assert 0.001 < box.mean() < 0.05
    assert seen.left[box].max() > 200
    np.testing.assert_array_equal(seen.left[~box], sample.left[~box])
    np.testing.assert_array_equal(seen.right, sample.right)
    np.testing.assert_array_equal(seen.disparity_right, sample.disparity_right)


def test_rows_move_up_and_down_and_the_truth_along_the_row_stays(sample: Sample) -> None:
    """Sampled at the true column and the moved row, the right view is the left one; half a pixel off, it is not."""
    moved = rows.Rows(shift=4.0, roll=-3.0, scale=2.0)  # stronger than any that is drawn: one to two px here
    seen = spoilt(sample, rows=moved)
    assert seen.occlusion is not None
    np.testing.assert_array_equal(seen.disparity, sample.disparity)
    lines, columns = np.indices(seen.disparity.shape, np.float32)
    place = columns - seen.disparity
    down = cv2.remap(moved.field(seen.disparity.shape), place, lines, cv2.INTER_LINEAR)
    where = inner(seen.occlusion)
    where[:8], where[-8:] = False, False

    def error(aside: float, below: float) -> float:
        matched = cv2.remap(seen.right, place + np.float32(aside), lines + down + np.float32(below), cv2.INTER_LINEAR)
        return float(np.abs(matched.astype(float) - seen.left)[where].mean())

    right_place = error(0, 0)
    assert right_place < 3
    for aside, below in ((0.5, 0), (-0.5, 0), (0, 0.5), (0, -0.5)):
        assert error(aside, below) > 1.3 * right_place
    assert np.abs(down).max() > 1


def test_drawn_rows_stay_within_two_px_of_a_frame_960_wide() -> None:
    largest = [np.abs(rows.draw_rows(np.random.default_rng(seed)).field((72, 96))).max() * 10 for seed in range(200)]
    assert max(largest) <= rows.LARGEST_PX + 1e-3
    assert max(largest) > 0.8 * rows.LARGEST_PX


def test_glare_is_elsewhere_for_the_other_eye(sample: Sample) -> None:
    glint = lens.Glint(0.3, 0.4, (0.05, 0.0), 0.02, 1.0, 0.0, (200.0, 200.0))
    seen = spoilt(sample, glints=(glint,))
    brighter = [a.astype(float).mean(2) - b.mean(2) for a, b in ((seen.left, sample.left), (seen.right, sample.right))]
    (y, x), (v, u) = (np.unravel_index(np.argmax(cv2.GaussianBlur(one, (0, 0), 3)), one.shape) for one in brighter)
    assert abs(x - 0.3 * WIDTH) < 4
    assert abs(y - 0.4 * WIDTH) < 4
    assert abs(u - (0.35 * WIDTH - sample.disparity[y, x])) < 4
    assert abs(int(v) - int(y)) < 4


def test_a_droplet_blurs_one_eye_alone(sample: Sample) -> None:
    drop = lens.Droplet(1, 0.5, 0.4, 0.1, 0.02, 1.0, 1.0)
    seen = spoilt(sample, droplets=(drop,))
    np.testing.assert_array_equal(seen.left, sample.left)
    changed = np.abs(seen.right.astype(int) - sample.right).max(2) > 3
    lines, columns = np.nonzero(changed)
    assert 0.005 < changed.mean() < 0.06
    assert np.hypot(columns - 0.5 * WIDTH, lines - 0.4 * WIDTH).max() < 0.13 * WIDTH


def test_smoke_hides_what_is_far_more_than_what_is_near(sample: Sample) -> None:
    smoke = lens.Smoke(0.6, 0.0, 1.0, 200.0, (1.0, 1.0, 1.0))
    seen = spoilt(sample, smoke=smoke)
    near = sample.disparity == 40
    contrast = [seen.left[there].std() / sample.left[there].std() for there in (near, ~near)]
    assert contrast[0] > contrast[1] + 0.05
    assert contrast[1] == pytest.approx(np.exp(-0.6), abs=0.05)


@pytest.mark.parametrize("look", [name for name in colours.LOOKS if name != "white"])
def test_a_look_changes_every_pixel_by_its_own_colour(sample: Sample, look: str) -> None:
    seen = spoilt(sample, look=look)
    assert np.abs(seen.left.astype(int) - sample.left).mean() > 3
    gap = np.abs(at_match(seen.right, seen.disparity).astype(float) - seen.left)[inner(sample.occlusion)]
    assert gap.mean() < 1


def test_a_dim_frame_has_the_mean_that_was_drawn_and_noise_the_strength(sample: Sample) -> None:
    processor = replace(NO_PROCESSOR, level=40.0)
    noisy = replace(QUIET, noise=6.0)
    seen = spoilt(sample, processor=processor, chips=(noisy, QUIET))
    assert seen.left.mean() == pytest.approx(40, abs=1)
    assert seen.right.mean() == pytest.approx(40, abs=5)
    dim = spoilt(sample, processor=processor)
    assert (seen.left.astype(float) - dim.left).std() == pytest.approx(6, abs=0.5)
    np.testing.assert_array_equal(seen.right, dim.right)


def test_the_processor_does_what_it_says(sample: Sample) -> None:
    def fine(view: np.ndarray) -> float:
        return float(np.abs(view.astype(float) - cv2.GaussianBlur(view, (0, 0), 2)).mean())

    assert fine(spoilt(sample, processor=replace(NO_PROCESSOR, sharpen=1.5)).left) > 1.3 * fine(sample.left)
    grainy = (replace(QUIET, noise=5.0), QUIET)
    smeared = spoilt(sample, processor=replace(NO_PROCESSOR, smear_px=4.0), chips=grainy)
    assert fine(smeared.left) < 0.93 * fine(spoilt(sample, chips=grainy).left)
    packed = spoilt(sample, processor=replace(NO_PROCESSOR, jpeg_quality=40)).left
    assert 0.5 < np.abs(packed.astype(int) - sample.left).mean() < 8
    laced = spoilt(sample, processor=replace(NO_PROCESSOR, interlaced=True)).left
    np.testing.assert_array_equal(laced[::2], sample.left[::2])
    assert np.abs(laced[1::2].astype(int) - sample.left[1::2]).mean() > 0.3


def write_clean(root: Path, sample: Sample, pairs: int, **described: object) -> None:
    """Write a set of test pairs that differ by their names alone."""
    names = [f"{number:03d}" for number in range(pairs)]
    hashes = {name: write_sample(root, "test", replace(sample, id=name)) for name in names}
    record = {"format_version": 1, "name": root.name, **described, "samples": {"train": {}, "test": hashes}}
    write_dataset_record(root, record)


def test_a_set_on_disk_is_spoiled_by_the_command(
    sample: Sample, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean, out, again = (tmp_path / name for name in ("clean", "out", "again"))
    limits = {"smallest": 2.0, "largest": 69.5}
    write_clean(clean, sample, 4, disparity_limits_px=limits)
    assert main(["simulate", "--spoil", str(clean), "--out", str(out), "--seed", "3"]) == 0
    assert main(["simulate", "--check", str(out)]) == 0
    assert main(["simulate", "--spoil", str(clean), "--out", str(again), "--seed", "3"]) == 0
    spoiled = [open_dataset(root, "test") for root in (out, again)]
    assert spoiled[0].sha256 == spoiled[1].sha256 != open_dataset(clean, "test").sha256
    assert spoiled[0].record["spoiled_from"]["sha256"] == open_dataset(clean, "test").sha256
    assert spoiled[0].record["disparity_limits_px"] == limits, "what the set says of its scenes stays"
    assert all("faults" in pair.info for pair in spoiled[0])
    assert len({pair.left.tobytes() for pair in spoiled[0]}) == 4
    capsys.readouterr()
    assert main(["simulate", "--spoil", str(clean), "--out", str(out)]) == 2
    rule = "out: must be new, or hold a set begun with the same pairs and seed; got "
    assert f"{rule}{out}, begun with seed 3, not 1" in capsys.readouterr().err
    assert main(["simulate", "--spoil", str(clean), "--out", str(tmp_path)]) == 2
    assert "out: must be an empty or new folder" in capsys.readouterr().err
    assert not (tmp_path / ".lock").exists()
    assert main(["simulate", "--spoil", str(clean), "--out", str(tmp_path / "x"), "--width", "64"]) == 2
    assert (
        "spoil: takes the pairs as they are, so leave out the rest but --seed; got --width" in capsys.readouterr().err
    )


def written(root: Path) -> dict[str, bytes]:
    """Return the bytes of all files of a set but those of the run itself."""
    files = [path for path in root.rglob("*") if path.is_file() and path.name not in (".lock", "dataset.json")]
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in files}


def test_a_set_that_was_interrupted_is_continued_with_the_same_bytes(sample: Sample, tmp_path: Path) -> None:
    clean, whole, out = (tmp_path / name for name in ("clean", "whole", "out"))
    write_clean(clean, sample, 24)
    assert main(["simulate", "--spoil", str(clean), "--out", str(whole)]) == 0
    program = "import sys; from endosdk.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    words = ["simulate", "--spoil", str(clean), "--out", str(out)]
    with subprocess.Popen([sys.executable, "-c", program, *words], stderr=subprocess.DEVNULL) as run:
        limit = time.monotonic() + 120
        while not list(out.glob("test/*")) and time.monotonic() < limit:
            time.sleep(0.002)
        run.kill()
    assert not (out / "dataset.json").exists()
    finished = {path.name: path.stat().st_mtime_ns for path in out.glob("test/*")}
    assert 1 <= len(finished) < 24
    left_over = out / ".partial-test-023-1"
    left_over.mkdir()
    (left_over / "left.png").write_bytes(b"half")
    assert main(words) == 0
    assert {name: (out / "test" / name).stat().st_mtime_ns for name in finished} == finished
    assert written(out) == written(whole)
    assert open_dataset(out, "test").sha256 == open_dataset(whole, "test").sha256


def test_a_finished_set_stays_and_what_was_deleted_comes_back(
    sample: Sample, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    clean, out = tmp_path / "clean", tmp_path / "out"
    write_clean(clean, sample, 3)
    words = ["simulate", "--spoil", str(clean), "--out", str(out)]
    assert main(words) == 0
    before, record = written(out), (out / "dataset.json").read_bytes()
    shutil.rmtree(out / "test" / "001")
    assert main(words) == 0
    assert written(out) == before
    assert (out / "dataset.json").read_bytes() == record
    (out / "test" / "002" / "left.png").write_bytes(b"changed")
    assert main(words) == 2
    assert "a finished sample was changed; delete its folder" in capsys.readouterr().err
    assert (out / "dataset.json").read_bytes() == record


def test_an_interrupted_spoiling_says_how_to_go_on(sample: Sample, tmp_path: Path) -> None:
    clean, out = tmp_path / "clean", tmp_path / "out"
    write_clean(clean, sample, 24)
    # A shell starts what it puts in the background with control-C ignored, which tests begun there would hand on.
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    program = f"{heed}; import sys; from endosdk.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    words = [sys.executable, "-c", program, "simulate", "--spoil", str(clean), "--out", str(out)]
    with subprocess.Popen(words, stderr=subprocess.PIPE, text=True) as run:
        limit = time.monotonic() + 120
        while not list(out.glob("test/*")) and time.monotonic() < limit:
            time.sleep(0.002)
        run.send_signal(signal.SIGINT)
        said = run.communicate(timeout=120)[1]
    assert run.returncode == 130
    assert said.endswith(f"endosdk simulate: stopped; the same command continues {out}\n")


@pytest.mark.parametrize("kind", ["raw views", "single pairs"])
def test_sets_that_would_lose_what_they_are_cannot_be_spoiled(
    sample: Sample, tmp_path: Path, capsys: pytest.CaptureFixture[str], kind: str
) -> None:
    name = "5-0001" if kind == "single pairs" else "5"
    extras = {"rig.json": lambda path: path.write_text("{}")} if kind == "raw views" else None
    hashes = {name: write_sample(tmp_path / "set", "train", replace(sample, id=name), extras)}
    record = {"format_version": 1, "name": "set", "samples": {"train": hashes, "test": {}}}
    write_dataset_record(tmp_path / "set", record)
    assert main(["simulate", "--spoil", str(tmp_path / "set"), "--out", str(tmp_path / "out")]) == 2
    assert kind in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (("--seed", "-1"), "seed: must be within 0..9999; got -1"),
        (("--workers", "2"), "workers: is for rendering; leave it out with --spoil; got 2"),
        (("--ray",), "ray: is for rendering"),
        (("--cycles-python", "python3"), "cycles_python: is for rendering"),
        ((), "spoil: must be a set without image faults; this sample has some; got"),
    ],
)
def test_what_cannot_be_spoiled_is_refused_before_anything_is_written(
    sample: Sample, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], rule: str
) -> None:
    source = tmp_path / "set"
    faulty = replace(sample, info={} if words else {"faults": None})  # one that was drawn to stay clean
    hashes = {"one": write_sample(source, "train", faulty)}
    write_dataset_record(source, {"format_version": 1, "name": "set", "samples": {"train": hashes, "test": {}}})
    assert main(["simulate", "--spoil", str(source), "--out", str(tmp_path / "out"), *words]) == 2
    assert rule in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_mask_without_truth_of_the_right_view_is_kept_and_grows(sample: Sample) -> None:
    assert sample.occlusion is not None
    alone = replace(sample, disparity_right=None)
    np.testing.assert_array_equal(spoilt(alone).occlusion, sample.occlusion)
    faults = {
        "fields": tuple(field.Field("circle", x, 0.375, 0.4, 0.35, 6.0, 2.0) for x in (0.5, 0.53)),
        "labels": (field.Label("REC", 0.4, 0.3, 0.05, 250.0, (1,)),),
        "rows": rows.Rows(4.0, -3.0, 2.0),
    }
    with_mask, with_truth = spoilt(alone, **faults).occlusion, spoilt(sample, **faults).occlusion
    assert with_mask is not None and with_truth is not None
    assert with_mask[sample.occlusion].all()
    assert with_mask.mean() > sample.occlusion.mean() + 0.2
    assert (with_mask == with_truth).mean() > 0.98


def test_a_pair_without_truth_for_the_right_view_can_be_spoiled(sample: Sample) -> None:
    alone = replace(sample, disparity_right=None, occlusion=None)
    smoke = lens.Smoke(0.6, 0.5, 1.0, 200.0, (1.0, 1.0, 1.0))
    seen = spoilt(alone, smoke=smoke, rows=rows.Rows(1.0, 0.5, 0.2))
    assert seen.disparity_right is None
    assert seen.occlusion is None
    np.testing.assert_array_equal(seen.disparity, sample.disparity)
