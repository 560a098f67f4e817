"""A whole set: the same however it was made, continued after a kill, refused where it would mix with another."""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from endosdk.commands.cli import VERBS, build_parser, main
from endosdk.commands.simulate import _recipe
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.verifier import verify_dataset
from endosdk.errors import InvalidArgument
from endosdk.io.locks import LOCK, locked_folder
from endosdk.simulation.generate import CHANGED, generate
from endosdk.simulation.recipe import SEED_BLOCK, TEST_OFFSET, Recipe
from endosdk.training.config import TrainConfig
from endosdk.training.sets import split_pairs

SIZE = ("--width", "64", "--height", "48", "--focal", "27")
SMALL = ("--organ", "stomach", "--seed", "3", "--max-disparity", "6", "--min-disparity", "0.2", *SIZE)


def simulate(out: Path, *more: str) -> int:
    return main(["simulate", "--out", str(out), *SMALL, *more])


@pytest.fixture(scope="module")
def whole(renderer: object, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pairs rendered without interruption."""
    out = tmp_path_factory.mktemp("whole") / "set"
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    return out


def test_a_set_says_what_it_is(whole: Path) -> None:
    record = json.loads((whole / "dataset.json").read_text())
    assert record["name"] == "set"
    assert record["camera"] == {"width": 64, "height": 48, "focal_px": 27.0, "baseline_mm": 10.0}
    assert record["seeds"] == {
        "train": [3 * SEED_BLOCK, 3 * SEED_BLOCK + 1],
        "test": [3 * SEED_BLOCK + TEST_OFFSET] * 2,
    }
    train, test = (open_dataset(whole, split) for split in ("train", "test"))
    assert (len(train), len(test)) == (2, 1)
    assert train.sha256 == test.sha256
    sample = train[1]
    assert sample.left.shape == (48, 64, 3)
    assert sample.info["organ"] == "stomach"
    assert sample.info["scene"]["seed"] == 3 * SEED_BLOCK + 1


def started(out: Path, *words: str, first: str = "train/*", stderr: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
    """Start the command in a process of its own, and return when it has rendered ``first``."""
    # A shell starts what it puts in the background with control-C ignored, which tests begun there would hand on.
    heed = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    program = f"{heed}; import sys; from endosdk.commands.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "simulate", "--out", str(out), *SMALL, *words]
    run = subprocess.Popen(command, stderr=stderr, text=True, start_new_session=True)
    limit = time.monotonic() + 120
    while not list(out.glob(first)):
        assert run.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.02)
    return run


def test_a_killed_run_is_continued_and_gives_the_same_set(whole: Path, tmp_path: Path) -> None:
    out = tmp_path / "set"
    run = started(out, "--pairs", "2", "--test-pairs", "1")
    os.kill(run.pid, signal.SIGKILL)
    run.wait()
    assert not (out / "dataset.json").exists()
    finished = {path.name: path.stat().st_mtime_ns for path in out.glob("train/*")}
    # What a kill in the middle of writing leaves behind must not count.
    left_over = out / ".partial-train-003000001-1"
    left_over.mkdir(exist_ok=True)
    (left_over / "left.png").write_bytes(b"half")
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert not list(out.glob(".partial*"))
    assert {name: (out / "train" / name).stat().st_mtime_ns for name in finished} == finished
    assert open_dataset(out, "train").sha256 == open_dataset(whole, "train").sha256


def test_several_workers_make_the_same_set(whole: Path, tmp_path: Path) -> None:
    assert simulate(tmp_path / "set", "--pairs", "2", "--test-pairs", "1", "--workers", "2") == 0
    assert open_dataset(tmp_path / "set", "train").sha256 == open_dataset(whole, "train").sha256


def test_check_finds_a_flipped_byte(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "--check", str(whole)]) == 0
    assert "3 of 3" in capsys.readouterr().out
    out = tmp_path / "set"
    shutil.copytree(whole, out)
    victim = out / "train" / f"{3 * SEED_BLOCK:09d}" / "right.png"
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 1
    victim.write_bytes(bytes(data))
    assert main(["simulate", "--check", str(out)]) == 1
    assert "train/003000000: its bytes differ" in capsys.readouterr().out


def test_a_set_can_grow_but_not_change(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "set"
    assert simulate(out, "--pairs", "1") == 0
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert all(fault is None for _, fault in verify_dataset(out))
    assert open_dataset(out, "train").sha256 == open_dataset(whole, "train").sha256
    assert simulate(out, "--pairs", "2", "--baseline", "9") == 2
    assert f"out: must be new, or hold a set begun with the same settings; got {out}" in capsys.readouterr().err
    for words, seen in (
        (("--pairs", "3", "--test-pairs", "1", "--baseline", "9"), "camera.baseline_mm 10.0, not 9.0"),
        (("--pairs", "1", "--test-pairs", "1"), "pairs 2, not 1"),
        (("--pairs", "2", "--test-pairs", "1", "--faults"), "faults nothing, not true"),
    ):
        assert simulate(out, *words) == 2
        assert f"begun with {seen} [" in capsys.readouterr().err


def test_a_growth_that_was_stopped_still_knows_what_was_finished(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    shutil.copytree(whole, out)
    more = ("--pairs", "5", "--test-pairs", "1")
    run = started(out, *more, first=f"train/{3 * SEED_BLOCK + 2:09d}")
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    assert not (out / "dataset.json").exists()
    changed, other = (out / "train" / f"{3 * SEED_BLOCK + k:09d}" for k in range(2))
    (changed / "left.png").write_bytes((other / "left.png").read_bytes())
    assert simulate(out, *more) == 2
    assert f"{CHANGED}; got {changed}" in capsys.readouterr().err
    shutil.rmtree(changed)
    run = started(out, *more, first=f"train/{changed.name}")  # rendered anew, on another machine to other bits
    os.killpg(run.pid, signal.SIGKILL)
    run.wait()
    (changed / "left.png").write_bytes((other / "left.png").read_bytes())
    assert simulate(out, *more) == 0
    assert {path.name for path in out.iterdir()} == {path.name for path in whole.iterdir()}


def test_neighbours_that_share_an_organ_are_held_out_together(renderer: object, tmp_path: Path) -> None:
    words = ("--organ", "stomach", "--rig", "drawn", "--width", "64", "--seed", "3", "--pairs", "5")
    assert main(["simulate", "--out", str(tmp_path), *words]) == 0
    reader = open_dataset(tmp_path, "train")
    first = 3 * SEED_BLOCK  # a multiple of three
    assert [reader.film(k) for k in range(5)] == [f"organ-{first // 3}"] * 3 + [f"organ-{first // 3 + 1}"] * 2
    organs = [json.dumps(sample.info["scene"]["parts"], sort_keys=True) for sample in reader]
    assert len(set(organs[:3])) == len(set(organs[3:])) == 1 and organs[0] != organs[3]
    learned, held_out = split_pairs(reader, TrainConfig(held_out=1))
    assert learned == [0, 1, 2] and len(held_out) == 1


def test_a_strange_folder_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    assert simulate(tmp_path, "--pairs", "1") == 2
    assert "out: must be an empty or new folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert simulate(tmp_path / "file" / "set", "--pairs", "1") == 2
    assert "out: the folder must be writable" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "value"),
    [("organ", "liver"), ("renderer", "povray"), ("rig", "mono"), ("pairs", -1), ("pairs", 0), ("seed", 10_000)],
)
def test_a_recipe_names_what_is_wrong(name: str, value: object) -> None:
    with pytest.raises(InvalidArgument, match=f"^{name}: "):
        Recipe(**{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (("--width", "100000"), "width: must be within 16..4096 pixels"),
        (("--height", "1000"), "height: must be within 1/4..4 times the width"),
        (("--focal", "1e9"), "focal: must be within 0.1..10.0 times the width"),
        (("--baseline", "0"), "baseline: must be within 0.1..100.0 mm"),
        (("--min-disparity", "5"), "min_disparity, max_disparity: "),
        (
            ("--max-disparity", "33"),
            "min_disparity, max_disparity: the largest disparity must be at most half the width",
        ),
        (("--video", "--frames", "0"), "frames: must be at least 1"),
    ],
)
def test_impossible_ranges_are_refused_before_anything_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], rule: str
) -> None:
    assert simulate(tmp_path / "set", *words) == 2
    assert rule in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("workers", ["1", "2"])
def test_an_interrupted_run_says_how_to_go_on(renderer: object, tmp_path: Path, workers: str) -> None:
    out = tmp_path / "set"
    run = started(out, "--pairs", "40", "--workers", workers, stderr=subprocess.PIPE)
    os.killpg(run.pid, signal.SIGINT)  # as a terminal does to all of its processes
    said = run.communicate(timeout=120)[1]
    assert run.returncode == 130
    assert "Traceback" not in said
    assert said.endswith(f"endosdk simulate: stopped; the same command continues {out}\n")
    assert not (out / "dataset.json").exists()


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (
            ("--recipe", "endosim-gi", "--pairs", "3", "--chroma", "--no-noise"),
            "so leave out the rest; got --chroma, --no-noise",
        ),
        (("--frames", "3"), "frames: are those of a video; add --video"),
        (("--rig", "drawn", "--min-disparity", "1"), "min_disparity: is drawn for every scene, so leave it out"),
        (("--organ", "lap", "--min-disparity", "1"), "min_disparity: is drawn for every scene"),
        (("--organ", "shapes", "--min-disparity", "1"), "min_disparity: is drawn for every scene"),
        (
            ("--organ", "shapes", "--bubbles", "--emitters", "1", "--no-glare"),
            "organ: shapes has no effects of organs; leave out --bubbles, --emitters, --no-glare",
        ),
        (("--organ", "shapes", "--textures", "photos"), "leave out --textures; got shapes"),
        (("--faults", "--rig", "drawn", "--no-noise"), "noise: comes with --faults here, so leave it out"),
        (("--faults", "--organ", "lap", "--no-compression"), "compression: comes with --faults here"),
    ],
)
def test_a_setting_that_would_not_count_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...], rule: str
) -> None:
    assert main(["simulate", "--out", str(tmp_path / "set"), *words]) == 2
    assert rule in capsys.readouterr().err
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("words", "rule"),
    [
        (("--check", "{set}", "--pairs", "3", "--no-noise"), "check: reads a set as it is, so leave out the rest"),
        (("--check", "{set}", "--spoil", "{set}", "--recipe", "endosim-gi"), "got --spoil, --recipe"),
        (("--check", "{set}", "--workers", "2", "--ray"), "got --workers, --ray"),
        (("--setup-cycles", "--textures", "photos"), "setup_cycles: installs Blender, so leave out the rest"),
        (("--setup-cycles", "--seed", "0", "--cycles-python", "python"), "got --seed, --cycles-python"),
    ],
)
def test_what_has_no_use_for_an_option_refuses_it(
    whole: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], rule: str
) -> None:
    monkeypatch.setattr("endosdk.simulation.cycles.environment.set_up", lambda: pytest.fail("it is set up"))
    assert main(["simulate", *(word.format(set=whole) for word in words)]) == 2
    assert rule in capsys.readouterr().err


@pytest.mark.parametrize(("width", "largest"), [(24, 6.0), (480, 120.0), (1000, 250.0), (1920, 250.0)])
def test_the_usual_range_of_drawn_rigs_is_one_that_is_allowed(width: int, largest: float) -> None:
    words = ["simulate", "--out", "set", "--rig", "drawn", "--width", str(width)]
    recipe = _recipe(build_parser(VERBS).parse_args(words))
    assert recipe.limits.largest == largest


@pytest.mark.parametrize(
    ("width", "camera", "largest"),
    [(960, (960, 720, 400.0), 69.5), (480, (480, 360, 200.0), 34.75), (3840, (3840, 2880, 1600.0), 250.0)],
)
def test_the_width_alone_keeps_the_field_of_view(width: int, camera: tuple[int, int, float], largest: float) -> None:
    words = ["simulate", "--out", "set", "--width", str(width)]
    recipe = _recipe(build_parser(VERBS).parse_args(words))
    assert (recipe.camera.width, recipe.camera.height, recipe.camera.focal_px) == camera
    assert recipe.limits.largest == largest
    recipe = _recipe(build_parser(VERBS).parse_args([*words, "--focal", "500"]))
    assert recipe.camera.focal_px == 500


@pytest.fixture
def room() -> Iterator[Callable[[int], None]]:
    """Limit how many bytes a file may have: what a full disk does, without one."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_leaves_nothing_half_written(
    whole: Path, tmp_path: Path, room: Callable[[int], None], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    room(100)
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 2
    assert "out: the folder must be writable" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == {LOCK}
    room(2000)
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 2
    assert "out: must be writable" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == {LOCK, "recipe.json"}
    room(100_000_000)
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert open_dataset(out, "train").sha256 == open_dataset(whole, "train").sha256


def test_a_run_goes_on_after_the_disk_was_full_at_its_start(whole: Path, tmp_path: Path) -> None:
    (tmp_path / ".partial-recipe.json").write_text("")
    assert simulate(tmp_path, "--pairs", "1") == 0
    assert not list(tmp_path.glob(".partial*"))


@pytest.mark.parametrize("complete", [True, False])
@pytest.mark.parametrize("pairs", ["2", "3"])  # none, or another one, to render
def test_a_damaged_sample_is_named(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], complete: bool, pairs: str
) -> None:
    out = tmp_path / "set"
    shutil.copytree(whole, out)
    if not complete:
        (out / "dataset.json").unlink()
    before = {path.name for path in out.iterdir()}
    damaged = out / "train" / f"{3 * SEED_BLOCK:09d}"
    (damaged / "sample.json").unlink()
    assert simulate(out, "--pairs", pairs, "--test-pairs", "1") == 2
    assert f"delete its folder, and the same command renders it again; got {damaged}" in capsys.readouterr().err
    assert {path.name for path in out.iterdir()} == before
    if pairs != "2":
        return
    shutil.rmtree(damaged)
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert open_dataset(out, "train").sha256 == open_dataset(whole, "train").sha256


def test_a_changed_or_missing_picture_of_a_complete_set_is_named_and_its_record_kept(
    whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "set"
    shutil.copytree(whole, out)
    changed, bare = (out / "train" / f"{3 * SEED_BLOCK + k:09d}" for k in range(2))
    (changed / "left.png").write_bytes((bare / "left.png").read_bytes())
    (bare / "occlusion.png").unlink()
    (out / "test" / f"{3 * SEED_BLOCK + TEST_OFFSET:09d}" / ".ipynb_checkpoints").mkdir()
    for damaged in (changed, bare, out / "test" / f"{3 * SEED_BLOCK + TEST_OFFSET:09d}"):
        assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 2
        assert "out: a finished sample was changed; delete its folder" in capsys.readouterr().err
        assert (out / "dataset.json").read_bytes() == (whole / "dataset.json").read_bytes()
        shutil.rmtree(damaged)
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert open_dataset(out, "train").sha256 == open_dataset(whole, "train").sha256


def test_workers_end_when_their_run_is_killed(renderer: object, tmp_path: Path) -> None:
    out = tmp_path / "set"
    run = started(out, "--pairs", "400", "--workers", "2")
    workers = [int(pid) for pid in Path(f"/proc/{run.pid}/task/{run.pid}/children").read_text().split()]
    assert len(workers) >= 2
    run.kill()
    run.wait()
    limit = time.monotonic() + 120
    while any(_runs(pid) for pid in workers):
        assert time.monotonic() < limit
        time.sleep(0.02)


def _runs(pid: int) -> bool:
    """Return whether a process is there and has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def test_two_runs_do_not_write_one_set(whole: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = Path(shutil.copytree(whole, tmp_path / "set"))
    video = out / ".partial-train-003000000.mp4"  # as the first run has it while it writes a film
    video.write_bytes(b"half")
    recipe = (out / "recipe.json").read_bytes()
    with locked_folder(out, "out"):
        for pairs in ("2", "3"):
            assert simulate(out, "--pairs", pairs, "--test-pairs", "1") == 2
            assert "out: must not be in use by another process" in capsys.readouterr().err
        assert video.read_bytes() == b"half"
        assert (out / "recipe.json").read_bytes() == recipe
    assert simulate(out, "--pairs", "2", "--test-pairs", "1") == 0
    assert not video.exists()


def test_no_worker_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match=r"^workers: "):
        generate(tmp_path, Recipe(pairs=1), workers=0)


def test_training_and_test_seeds_never_meet() -> None:
    seeds = [seed for _, seed in Recipe(pairs=TEST_OFFSET, test_pairs=TEST_OFFSET, seed=4).tasks()]
    assert len(seeds) == len(set(seeds))
    assert max(seeds) < 5 * SEED_BLOCK
