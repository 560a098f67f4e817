"""The study of a clean teacher, and the runs that it shares with the study of the recipe's gains."""

import json
from dataclasses import replace

import pytest
import torch

from benchmarks.studies.clean_teacher import SpoiltAndClean, Student, volume_distance
from benchmarks.studies.short_runs import KINDS, Variant, run_variants, study_parser
from endosdk.datasets.layouts import open_dataset
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.data import Crops
from tests.training.warped_set import write_warped_set

LOOKS = ("tone", "compression")


@pytest.fixture(scope="module")
def tiny_set(tmp_path_factory):
    root = tmp_path_factory.mktemp("set") / "tiny"
    write_warped_set(root, 8, 0, (128, 256), (3.0, 20.0))
    return root


def test_the_student_sees_the_crops_of_the_recipe_and_the_teacher_the_same_place(tiny_set):
    reader = open_dataset(tiny_set, "train")
    given = {"seed": 1, "looks": LOOKS}
    plain, both = (kind(reader, range(4), (64, 128), **given) for kind in (Crops, SpoiltAndClean))
    for item in range(4):
        *seen, left, right = both[item]
        for part, expected in zip(seen, plain[item], strict=True):
            torch.testing.assert_close(part, expected, equal_nan=True)
        for clean, spoilt in ((left, seen[0]), (right, seen[1])):
            assert clean.dtype == torch.uint8 and not torch.equal(clean, spoilt)
        same, another = (
            torch.corrcoef(torch.stack([left.float().ravel(), view.float().ravel()]))[0, 1]
            for view in (seen[0], both[item + 1][0])
        )
        assert same > 0.5 > another


def test_distance_of_two_volumes():
    torch.manual_seed(0)
    taught, mask = 3 * torch.randn(2, 5, 4, 3, 6), torch.ones(2, 1, 24, 48, dtype=torch.bool)
    assert volume_distance(taught, taught, mask) == pytest.approx(0.0, abs=1e-6)
    assert volume_distance(torch.zeros_like(taught), taught, mask) > 0.1
    changed = taught.clone()
    changed[..., :3] += 5 * torch.randn(2, 5, 4, 3, 3)
    mask[..., :24] = False
    assert volume_distance(changed, taught, mask) == pytest.approx(0.0, abs=1e-6)


def test_a_student_learns_and_its_teacher_stays(tiny_set, tmp_path):
    given = {
        "data": (str(tiny_set),),
        "init_from": "fast",
        "held_out": 0,
        "steps": 2,
        "crop": (64, 128),
        "batch": 2,
    }
    recipe = {**checkpoint.inherited("fast", given), **given, "looks": LOOKS}
    run = Student(TrainConfig.from_dict(recipe), tmp_path / "run", resume=False)
    before = [parameter.clone() for parameter in run.teacher.parameters()]
    run.fit()
    assert all(torch.equal(a, b) for a, b in zip(before, run.teacher.parameters(), strict=True))
    learned = checkpoint.load(tmp_path / "run")
    assert learned.step == 2
    assert any(not torch.equal(value, run.teacher.state_dict()[name]) for name, value in learned.network.items())


def test_a_run_that_is_there_goes_on_and_is_checked_by_its_fit(tiny_set, tmp_path):
    started = checkpoint.load(checkpoint.starting_point("fast"))
    asked = []

    def fit(config, out, *, resume):
        asked.append((out.name, config.seed, resume))
        out.mkdir(exist_ok=True)
        checkpoint.save_weights(out / checkpoint.LAST, replace(started, step=config.steps))

    runs = {"one": Variant("the-one", {"seed": 7}, fit)}
    words = [f"--{name}={tiny_set}" for name in (*KINDS, "held-out", "middlebury")]
    args = study_parser("").parse_args([*words, f"--runs={tmp_path}", f"--json={tmp_path / 'record.json'}"])
    for steps in (3, 3, 5):
        args.steps = steps
        run_variants(args, {}, {"steps": steps}, runs, "python -m benchmarks.studies.recipe_gains ...")
    assert asked == [("the-one", 7, False), ("the-one", 7, True), ("the-one", 7, True)]
    assert list(json.loads((tmp_path / "record.json").read_text())["runs"]) == ["before", "one"]
