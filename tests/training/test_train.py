import csv
import json
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
import torch

from endosdk.datasets.dataset import Sample
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.errors import DatasetInvalid, InferenceFailed, InvalidArgument, ProviderUnavailable
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.devices import bf16_pays
from endosdk.training.networks import build_network
from endosdk.training.networks.blocks import EXACT, ConvNorm
from endosdk.training.release import release
from endosdk.training.rounding import rounded_weights
from endosdk.training.run_log import RunLog
from endosdk.training.sets import split_pairs
from endosdk.training.train import Run, train
from endosdk.training.validation import mean_errors, pad_to_multiple
from tests.training.conftest import SIZE
from tests.training.warped_set import write_warped_set

# Frames are seen as they are: enlarged to the width that ``fast`` is made for, a step takes four times as long.
AS_THEY_ARE = {"inference_width": SIZE[1]}
SHORT = {"network": "fast", "crop": (64, 128), "batch": 2, "held_out": 2, "log_every": 1, "precision": "fp32"}


def settings(root, **changes):
    return TrainConfig(data=(str(root),), **{**SHORT, **AS_THEY_ARE, **changes})


def weights(run):
    return checkpoint.load(run).network


@pytest.fixture(scope="module")
def two_steps(dataset_root, tmp_path_factory):
    """A run of two steps, for tests that only read it."""
    run = tmp_path_factory.mktemp("run") / "first"
    train(settings(dataset_root, steps=2), run)
    return run


@pytest.fixture(scope="module")
def four_steps(dataset_root, tmp_path_factory):
    """A run of four steps without an interrupt, for tests that only read it."""
    run = tmp_path_factory.mktemp("run") / "straight"
    train(settings(dataset_root, steps=4), run)
    return run


def test_the_papers_network_learns_to_match(dataset_root, tmp_path):
    """Random weights know only the mean; a hundred steps later it has to see disparity."""
    config = settings(
        dataset_root,
        network="wang2020",
        max_disparity=40,
        crop=(64, 160),
        steps=260,
        refine_from_step=220,
        refine_crop=(32, 96),
        validate_every=1000,
        final_rate=2e-4,
    )
    run = train(config, tmp_path)
    reader = open_dataset(dataset_root, "test")
    truth = np.concatenate([sample.disparity.ravel() for sample in reader])
    constant_guess = float(np.abs(truth - np.median(truth)).mean())
    torch.manual_seed(0)
    before = mean_errors(build_network("wang2020", 40), reader, range(2), refined=True)["epe_refined"]
    after = mean_errors(checkpoint.load(run).build(), reader, range(2), refined=True)
    assert after["epe_refined"] < 0.5 * min(before, constant_guess)
    assert after["epe_coarse"] < 0.5 * constant_guess


def test_a_quantised_run_rounds_and_keeps_its_weights_exact(dataset_root, tmp_path):
    runs = {name: settings(dataset_root, steps=2, quantised=name == "quantised") for name in ("exact", "quantised")}
    for name, config in runs.items():
        train(config, tmp_path / name)
    exact, quantised = (checkpoint.load(tmp_path / name) for name in runs)
    assert quantised.config.quantised
    assert exact.network.keys() == quantised.network.keys()
    assert not torch.equal(exact.network["stem.conv.weight"], quantised.network["stem.conv.weight"])
    whole = quantised.network["stem.conv.weight"] / rounded_weights(quantised.network["stem.conv.weight"])
    assert (whole - 1).abs().max() > 1e-3  # kept as they were learned, not as they were rounded
    assert all(module.numbers is EXACT for module in quantised.build().modules() if isinstance(module, ConvNorm))


def test_a_resumed_run_equals_one_that_never_stopped(dataset_root, tmp_path):
    straight = settings(dataset_root, steps=6, refine_from_step=3, validate_every=3)
    train(straight, tmp_path / "straight")
    # The rate depends on the planned length, so the first half is cut off rather than planned shorter.
    interrupted = tmp_path / "interrupted"
    with pytest.raises(KeyboardInterrupt):
        _train_until(straight, interrupted, stop_at=4)
    assert checkpoint.load(interrupted).step == 4
    train(straight, interrupted, resume=True)
    for name, value in weights(tmp_path / "straight").items():
        torch.testing.assert_close(weights(interrupted)[name], value, atol=1e-6, rtol=1e-5)
    logs = [(tmp_path / run / "log.csv").read_text().splitlines() for run in ("straight", "interrupted")]
    assert [line.split(",")[0] for line in logs[0]] == [line.split(",")[0] for line in logs[1]]


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM])
def test_a_step_that_is_interrupted_is_taken_whole(stop, dataset_root, four_steps, tmp_path, monkeypatch):
    config = settings(dataset_root, steps=4)
    losses = Run._losses

    def interrupted(run, *args):
        """When a batch has moved the norms' statistics, and no weight yet."""
        if run.step == 2:
            signal.raise_signal(stop)
        return losses(run, *args)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Run, "_losses", interrupted)
        train(config, tmp_path / "interrupted")
    step = checkpoint.load(tmp_path / "interrupted").step
    train(config, tmp_path / "interrupted", resume=True)
    for name, value in weights(four_steps).items():
        torch.testing.assert_close(weights(tmp_path / "interrupted")[name], value, atol=1e-6, rtol=1e-5)
    logs = [(run / "log.csv").read_text().splitlines() for run in (four_steps, tmp_path / "interrupted")]
    assert [line.split(",")[0] for line in logs[0]] == [line.split(",")[0] for line in logs[1]]
    assert step == 3


@pytest.mark.parametrize("stopped_at", [2, 4])
def test_a_validation_that_is_interrupted_is_made_up_for(stopped_at, dataset_root, tmp_path, monkeypatch):
    config = settings(dataset_root, steps=4, validate_every=2)
    validate = Run._validate

    def interrupted(run, *args):
        if run.step == stopped_at:
            raise KeyboardInterrupt
        validate(run, *args)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Run, "_validate", interrupted)
        train(config, tmp_path)
    train(config, tmp_path, resume=True)
    assert [entry["step"] for entry in checkpoint.load(tmp_path).state["history"]] == [2, 4]


def test_a_run_that_stopped_early_is_not_exported(dataset_root, tmp_path):
    config = settings(dataset_root, steps=5)
    with pytest.raises(KeyboardInterrupt):
        _train_until(config, tmp_path, stop_at=1)
    with pytest.raises(InvalidArgument, match=r"run: must be finished: resume it.*got one that stopped at step 1 of 5"):
        release(checkpoint.load(tmp_path), tmp_path / "m.onnx", version="1")


@pytest.mark.parametrize("steps", [0, 1])
def test_nothing_is_written_where_nothing_is_left(steps, dataset_root, tmp_path, caplog):
    config = settings(dataset_root, steps=steps)
    train(config, tmp_path)
    assert checkpoint.load(tmp_path).state["finished"]
    kept = {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in tmp_path.iterdir()}
    assert caplog.text == ""
    train(config, tmp_path, resume=True)
    assert f"is finished, with all {steps} steps; nothing is written" in caplog.text
    assert {file: (file.read_bytes(), file.stat().st_mtime_ns) for file in tmp_path.iterdir()} == kept
    with pytest.raises(KeyboardInterrupt):
        _train_until(replace(config, steps=3), tmp_path, stop_at=2, resume=True)
    assert not checkpoint.load(tmp_path).state["finished"]


def _train_until(config, out, stop_at, **given):
    from endosdk.training import train as module

    class Interrupted(module.Run):
        def _train_step(self, *args):
            if self.step == stop_at:
                raise KeyboardInterrupt
            return super()._train_step(*args)

    original, module.Run = module.Run, Interrupted
    try:
        module.train(config, out, **given)
    finally:
        module.Run = original


def test_the_logs_tell_the_run(dataset_root, tmp_path):
    train(settings(dataset_root, steps=4, refine_from_step=2, validate_every=2), tmp_path)
    with (tmp_path / "log.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == [1, 2, 3, 4]
    assert [bool(row["epe_refined"]) for row in rows] == [False, False, True, True]
    assert all(float(row["loss"]) > 0 for row in rows)
    log = json.loads((tmp_path / "log.json").read_text())
    assert log["config"]["steps"] == 4
    assert log["dataset"]["sha256"] == open_dataset(dataset_root, "train").sha256
    assert [entry["step"] for entry in log["validation"]] == [2, 4]
    assert "epe_refined" in log["validation"][1]


def test_a_row_of_the_log_has_the_mean_over_its_steps(dataset_root, four_steps, tmp_path):
    train(settings(dataset_root, steps=4, log_every=3), tmp_path)
    every, some = (
        [float(line.split(",")[3]) for line in (run / "log.csv").read_text().splitlines()[1:]]
        for run in (four_steps, tmp_path)
    )
    assert some == pytest.approx([sum(every[:3]) / 3, every[3]], rel=1e-5)


def test_the_coarse_stage_alone_leaves_the_refinement_untouched(dataset_root, tmp_path):
    train(settings(dataset_root, steps=2, refine_from_step=2), tmp_path)
    torch.manual_seed(0)
    fresh = build_network("fast").state_dict()
    same = {name: torch.equal(value, fresh[name]) for name, value in weights(tmp_path).items()}
    refinement = {name for name in same if name.startswith("refinement.")}
    learned = {name for name in same if name.endswith("conv.weight")} - refinement
    assert refinement and learned
    assert {name for name in refinement | learned if same[name]} == refinement


def test_the_refinement_alone_leaves_everything_else_untouched(dataset_root, two_steps, tmp_path):
    alone = settings(dataset_root, steps=2, init_from=str(two_steps), refine_only=True, held_out=0)
    train(alone, tmp_path / "alone")
    before, after = weights(two_steps), weights(tmp_path / "alone")
    for name, value in before.items():
        learns = name.startswith("refinement.") and name.endswith("conv.weight")
        stays = not name.startswith("refinement.") or "running" in name
        assert not (learns and torch.equal(value, after[name])), name
        assert not stays or torch.equal(value, after[name]), name
    checkpoint.save_weights(tmp_path / "kept.safetensors", checkpoint.load(tmp_path / "alone"))
    assert checkpoint.load(tmp_path / "kept.safetensors").config.refine_only
    with pytest.raises(InvalidArgument, match="init_from: must name a trained coarse stage"):
        train(replace(alone, init_from=None), tmp_path / "nothing")
    with pytest.raises(InvalidArgument, match="refine_from_step: must be 0"):
        replace(alone, refine_from_step=1)


def test_frozen_norm_keeps_its_statistics_and_learns_the_rest(dataset_root, two_steps, tmp_path):
    frozen = settings(dataset_root, steps=2, init_from=str(two_steps), frozen_norm=True, held_out=0)
    train(frozen, tmp_path / "frozen")
    before, after = weights(two_steps), weights(tmp_path / "frozen")
    for name, value in before.items():
        if ".running_" in name:
            assert torch.equal(value, after[name]), name
        elif name.endswith(("conv.weight", "norm.weight")):
            assert not torch.equal(value, after[name]), name
    assert checkpoint.inherited(str(tmp_path / "frozen"), {})["frozen_norm"]
    with pytest.raises(InvalidArgument, match="init_from: must name trained weights with frozen_norm"):
        train(replace(frozen, init_from=None), tmp_path / "nothing")


def test_another_run_can_be_the_start(dataset_root, two_steps, tmp_path):
    train(settings(dataset_root, steps=1, init_from=str(two_steps), rate=1e-9, final_rate=1e-9), tmp_path / "b")
    first, second = weights(two_steps), weights(tmp_path / "b")
    torch.testing.assert_close(first["stem.conv.weight"], second["stem.conv.weight"], atol=1e-7, rtol=0)
    assert checkpoint.load(tmp_path / "b").state["init"]["steps"] == 2
    with pytest.raises(InvalidArgument, match="network: must be the checkpoint's fast"):
        train(settings(dataset_root, init_from=str(two_steps), network="wang2020"), tmp_path / "c")


def test_no_steps_fit_the_confidence_and_change_nothing_else(dataset_root, two_steps, tmp_path):
    train(settings(dataset_root, steps=0, init_from=str(two_steps)), tmp_path / "fitted")
    first, second = weights(two_steps), weights(tmp_path / "fitted")
    changed = [name for name in first if not torch.equal(first[name], second[name])]
    assert "confidence.weights" in changed and all(name.startswith("confidence.") for name in changed)
    fitted = checkpoint.load(tmp_path / "fitted")
    assert (fitted.step, fitted.steps_in_all) == (0, 2)


def test_what_a_run_before_learned_from_is_never_held_out(dataset_root, tmp_path):
    train(settings(dataset_root, steps=1, held_out=2), tmp_path / "first")
    train(settings(dataset_root, steps=1, held_out=1, init_from=str(tmp_path / "first")), tmp_path / "second")
    for start, held_out, most in (("first", 3, 2), ("second", 2, 1)):
        begun = settings(dataset_root, steps=0, held_out=held_out, init_from=str(tmp_path / start))
        with pytest.raises(InvalidArgument, match=f"held_out: must be at most {most}: the run that this one begins"):
            train(begun, tmp_path / "third")


def test_a_network_of_the_same_weights_can_be_the_start(dataset_root, tmp_path):
    given = {"steps": 1, "max_disparity": 40, "held_out": 0}
    train(settings(dataset_root, network="wang2020", **given), tmp_path / "alone")
    start = {"init_from": str(tmp_path / "alone"), "network": "wang2020-photometric", "rate": 1e-9, "final_rate": 1e-9}
    train(settings(dataset_root, **given, **start), tmp_path / "corrected")
    first, second = weights(tmp_path / "alone"), weights(tmp_path / "corrected")
    torch.testing.assert_close(first["down.0.conv.weight"], second["down.0.conv.weight"], atol=1e-7, rtol=0)
    with pytest.raises(InvalidArgument, match="network: must be the checkpoint's wang2020-photometric; got wang2020"):
        train(settings(dataset_root, network="wang2020", **given), tmp_path / "corrected", resume=True)


@pytest.mark.parametrize("network", ["fast", "wang2020"])
def test_a_run_of_another_range_can_be_the_start(network, dataset_root, tmp_path):
    common = {"network": network, "steps": 1, "rate": 1e-9, "final_rate": 1e-9}
    train(settings(dataset_root, max_disparity=48, **common), tmp_path / "near")
    train(settings(dataset_root, max_disparity=96, init_from=str(tmp_path / "near"), **common), tmp_path / "far")
    near, far = weights(tmp_path / "near"), weights(tmp_path / "far")
    assert near.keys() == far.keys()
    for name in near:
        if name.endswith("conv.weight") and near[name].shape == far[name].shape:
            torch.testing.assert_close(near[name], far[name], atol=1e-7, rtol=0)
    assert checkpoint.load(tmp_path / "far").build().max_disparity == 96
    assert checkpoint.load(tmp_path / "far").state["init"]["max_disparity"] == 48
    with pytest.raises(InvalidArgument, match="max_disparity"):
        train(settings(dataset_root, max_disparity=96, **{**common, "steps": 2}), tmp_path / "near", resume=True)


def test_frames_can_be_seen_narrower(dataset_root, tmp_path):
    narrow = settings(dataset_root, inference_width=128, max_disparity=32, steps=1)  # frames are 256 px wide
    train(narrow, tmp_path / "narrow")
    assert checkpoint.load(tmp_path / "narrow").build().inference_width == 128
    with pytest.raises(InvalidArgument, match="fit into frames of 64 x 128, as the network sees them"):
        train(replace(narrow, crop=(64, 136)), tmp_path / "too-wide")
    with pytest.raises(InvalidArgument, match="inference_width: must be the checkpoint's 128"):
        train(replace(narrow, inference_width=None, steps=2), tmp_path / "narrow", resume=True)


def test_what_is_watched_joins_the_history_and_a_resumed_run_does_not_measure_twice(dataset_root, tmp_path):
    seen = []

    def watch(network, refined):
        seen.append(refined)
        network.eval()  # as any measurement does; training goes on all the same
        return {"test_epe": float(len(seen))}

    config = settings(dataset_root, network="wang2020", steps=2, validate_every=1, held_out=0, refine_from_step=1)
    train(config, tmp_path, watch=watch)
    train(replace(config, steps=3), tmp_path, resume=True, watch=watch)
    history = checkpoint.load(tmp_path).state["history"]
    assert [(entry["step"], entry["test_epe"]) for entry in history] == [(1, 1), (2, 2), (3, 3)]
    assert seen == [False, True, True]


def test_a_run_is_not_overwritten(dataset_root, tmp_path):
    train(settings(dataset_root, steps=1), tmp_path)
    with pytest.raises(InvalidArgument, match="resumed"):
        train(settings(dataset_root, steps=1), tmp_path)
    with pytest.raises(InvalidArgument, match="resumed"):
        train(settings(dataset_root, steps=1, init_from=str(tmp_path)), tmp_path)


def test_a_resumed_run_is_the_run_that_began(dataset_root, tmp_path):
    began = settings(dataset_root, steps=1)
    train(began, tmp_path / "run")
    kept = (tmp_path / "run" / checkpoint.LAST).read_bytes()
    write_warped_set(tmp_path / "other", 10, 0, SIZE, (3.0, 20.0))
    for name, value in (
        ("optimiser", "adamw"),
        ("seed", 7),
        ("batch", 1),
        ("crop", (64, 136)),
        ("looks", ("tone",)),
        ("loss", "l1"),
        ("layout", "plain"),
        ("train_pairs", 5),
        ("held_out", 3),
    ):
        with pytest.raises(InvalidArgument, match=f"{name}: must be the checkpoint's"):
            train(replace(began, steps=2, **{name: value}), tmp_path / "run", resume=True)
    with pytest.raises(InvalidArgument, match=r"data: must be what the run began with, sha256 .*--init-from .*run"):
        train(replace(began, steps=2, data=(str(tmp_path / "other"),)), tmp_path / "run", resume=True)
    with pytest.raises(InvalidArgument, match="rate: must be the checkpoint's"):
        train(replace(began, rate=0.5), tmp_path / "run", resume=True)  # no step is left to use it
    # Told before the network is built of settings that it cannot have, and before too few pairs are split.
    with pytest.raises(InvalidArgument, match="network: must be the checkpoint's fast; got cascade "):
        train(replace(began, steps=2, network="cascade"), tmp_path / "run", resume=True)
    write_warped_set(tmp_path / "few", 1, 0, SIZE, (3.0, 20.0))
    with pytest.raises(InvalidArgument, match="data: must be what the run began with, sha256 "):
        train(replace(began, steps=2, data=(str(tmp_path / "few"),)), tmp_path / "run", resume=True)
    assert (tmp_path / "run" / checkpoint.LAST).read_bytes() == kept


def test_a_resumed_run_says_from_which_step_its_rates_hold(dataset_root, tmp_path):
    began = settings(dataset_root, steps=1, held_out=0)
    train(began, tmp_path / "run")
    assert checkpoint.load(tmp_path / "run").state["changes"] == []
    moved = tmp_path / "moved"
    moved.symlink_to(dataset_root)
    train(replace(began, data=(str(moved),), steps=2, rate=5e-4), tmp_path / "run", resume=True)
    noted = [{"step": 1, "steps": [1, 2], "rate": [1e-3, 5e-4]}]
    assert checkpoint.load(tmp_path / "run").state["changes"] == noted
    train(settings(dataset_root, steps=1, held_out=0, init_from=str(tmp_path / "run")), tmp_path / "next")
    assert checkpoint.load(tmp_path / "next").state["init"]["changes"] == noted


def test_a_resumed_run_keeps_its_origin_and_the_steps_that_are_done(dataset_root, tmp_path):
    train(settings(dataset_root, steps=2, held_out=0), tmp_path)
    with pytest.raises(InvalidArgument, match="init_from: must be the checkpoint's None; got fast"):
        train(settings(dataset_root, steps=3, held_out=0, init_from="fast"), tmp_path, resume=True)
    with pytest.raises(InvalidArgument, match="steps: must be at least the 2 that are done; got 1"):
        train(settings(dataset_root, steps=1, held_out=0), tmp_path, resume=True)


def test_truth_beyond_the_range_is_counted_and_told(tmp_path, caplog):
    truth = np.full((64, 128), 20.0, np.float32)
    truth[:16] = 50.0
    truth[16:32] = np.nan
    one_frame_set(tmp_path / "set", (64, 128), truth)
    seen = {"held_out": 0, "inference_width": 128}
    Run(settings(tmp_path / "set", max_disparity=56, **seen), tmp_path / "wide")
    assert caplog.text == ""
    run = Run(settings(tmp_path / "set", max_disparity=48, **seen), tmp_path / "run")
    assert "33.3 % of the truth in 2 training pairs lies beyond max_disparity, 48 px" in caplog.text
    run.save()
    assert checkpoint.load(tmp_path / "run").state["dataset"]["beyond_range"] == pytest.approx(1 / 3)


def test_truth_too_large_to_be_kept_counts_as_beyond_the_range(tmp_path, caplog):
    truth = np.full((64, 128), 128.0, np.float32)  # seen twice as wide: 256 px
    truth[:48] = 20.0
    one_frame_set(tmp_path / "set", (64, 128), truth)
    config = settings(tmp_path / "set", max_disparity=48, held_out=0, inference_width=256)
    assert Run(config, tmp_path / "run").beyond_range == pytest.approx(1 / 4)


@pytest.mark.parametrize("disparity", [np.nan, 60.0, 128.0])
def test_pairs_without_truth_in_range_are_refused_before_the_run_begins(disparity, tmp_path):
    one_frame_set(tmp_path / "set", (64, 128), disparity)
    config = settings(tmp_path / "set", max_disparity=48, held_out=0, inference_width=256)
    with pytest.raises(DatasetInvalid, match="must have truth below max_disparity, 48 px, in the pairs trained on"):
        Run(config, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_one_pair_with_truth_in_range_is_enough(tmp_path, monkeypatch):
    monkeypatch.setattr("endosdk.training.beyond_range.COUNTED_PAIRS", 1)  # the first one, which has none
    one_frame_set(tmp_path / "set", (64, 128))
    picture, truth = np.full((64, 128, 3), 90, np.uint8), np.full((64, 128), np.nan, np.float32)
    bare = write_sample(tmp_path / "set", "train", Sample("0", picture, picture, truth, None, None, 200.0, 5.0))
    record = json.loads((tmp_path / "set/dataset.json").read_text())
    record["samples"]["train"]["0"] = bare
    write_dataset_record(tmp_path / "set", record)
    config = settings(tmp_path / "set", max_disparity=48, held_out=0, inference_width=128)
    assert Run(config, tmp_path / "run").beyond_range == 0


def test_the_precision_that_ran_is_kept_and_a_change_is_told(dataset_root, tmp_path, caplog):
    train(settings(dataset_root, steps=1, precision="auto", held_out=0), tmp_path)
    ran = "bf16" if bf16_pays(torch.device("cpu")) else "fp32"
    assert checkpoint.load(tmp_path).state["precision"] == ran
    train(settings(dataset_root, steps=2, precision="auto", held_out=0), tmp_path, resume=True)
    assert caplog.text == ""
    other = "fp32" if ran == "bf16" else "bf16"
    train(settings(dataset_root, steps=3, precision=other, held_out=0), tmp_path, resume=True)
    assert f"has computed in {ran} and goes on in {other} here" in caplog.text
    assert checkpoint.load(tmp_path).state["precision"] == other


def test_a_run_of_another_number_of_processes_is_warned_of(dataset_root, tmp_path, caplog):
    begun = Run(settings(dataset_root, steps=2, held_out=0), tmp_path)
    begun.world = 2
    begun.save()
    begun.log.close()
    train(settings(dataset_root, steps=2, held_out=0), tmp_path, resume=True)
    assert "drawn its crops for 2 processes and goes on with 1" in caplog.text


def test_a_run_takes_the_threads_it_is_given(dataset_root, tmp_path):
    before = torch.get_num_threads()
    try:
        Run(settings(dataset_root, threads=3), tmp_path)
        assert torch.get_num_threads() == 3
    finally:
        torch.set_num_threads(before)
    with pytest.raises(InvalidArgument, match=r"threads: must be within 1\.\.256"):
        settings(dataset_root, threads=0)


def test_the_recipe_of_the_weights_is_taken_over(dataset_root, tmp_path):
    recipe = {"loss": "l1", "optimiser": "muon", "looks": ("tone",), "max_disparity": 40, "inference_width": 192}
    past = settings(dataset_root, **recipe, mode_reach=2, steps=1, rate=1e-3, final_rate=1e-6, decay="linear")
    train(past, tmp_path / "past")
    start = str(tmp_path / "past")
    found = TrainConfig.from_dict(checkpoint.inherited(start, {}))
    for name, value in {**recipe, "mode_reach": 2, "network": "fast", "crop": (64, 128), "decay": "linear"}.items():
        assert getattr(found, name) == value, name
    assert (found.steps, found.held_out, found.seed) == (4000, 8, 0)  # those of a run, not of a recipe
    assert found.rate == pytest.approx(1e-3 / 3, rel=0.01) and found.final_rate == 1e-6
    own = checkpoint.inherited(start, {"loss": "l2", "inference_width": 128, "rate": 1e-7})
    assert "loss" not in own and "crop" not in own and "rate" not in own and own["final_rate"] == 1e-7
    with pytest.raises(InvalidArgument, match="init_from: must be a run folder, a checkpoint or one of fast"):
        checkpoint.inherited("nowhere", {})


def test_bf16_trains_too(dataset_root, tmp_path):
    train(settings(dataset_root, steps=2, precision="bf16"), tmp_path)
    assert all(torch.isfinite(value).all() for value in weights(tmp_path).values())
    assert all(value.dtype != torch.bfloat16 for value in weights(tmp_path).values())


def test_held_out_pairs_are_not_trained_on(dataset_root):
    reader = open_dataset(dataset_root, "train")
    assert split_pairs(reader, settings(dataset_root, held_out=3)) == (list(range(7)), [7, 8, 9])
    assert split_pairs(reader, settings(dataset_root, train_pairs=4)) == ([0, 1, 2, 3], [8, 9])
    assert split_pairs(reader, settings(dataset_root, train_pairs=8)) == (list(range(8)), [8, 9])
    with pytest.raises(InvalidArgument, match="held_out"):
        split_pairs(reader, settings(dataset_root, held_out=10))
    with pytest.raises(InvalidArgument, match=r"train_pairs: must be at most 8: .*; got 9"):
        split_pairs(reader, settings(dataset_root, train_pairs=9))


def test_a_run_says_on_how_many_pairs_it_learned(dataset_root, tmp_path):
    train(settings(dataset_root, steps=1, train_pairs=5), tmp_path)
    name, sha256 = "warped", open_dataset(dataset_root, "train").sha256
    splits = [open_dataset(dataset_root, "train").split_sha256]
    noted = {"name": name, "sha256": sha256, "splits": splits, "pairs": 5, "held_out": 2, "beyond_range": 0.0}
    assert checkpoint.load(tmp_path).state["dataset"] == noted
    assert json.loads((tmp_path / "log.json").read_text())["dataset"] == noted


@pytest.mark.parametrize(
    ("network", "size", "crop"), [("fast", (720, 960), (256, 384)), ("wang2020", (264, 520), (256, 512))]
)
def test_every_network_has_a_crop_of_its_own(network, size, crop, tmp_path):
    one_frame_set(tmp_path / "set", size)
    run = Run(TrainConfig(data=(str(tmp_path / "set"),), network=network, held_out=0, batch=1), tmp_path / "run")
    assert run.crops[0][0].shape == (3, *crop)
    run.save()
    assert checkpoint.load(tmp_path / "run").config.crop == crop


def test_a_crop_that_does_not_fit_is_refused_before_the_run_begins(tmp_path):
    one_frame_set(tmp_path / "set", (240, 320))
    config = TrainConfig(data=(str(tmp_path / "set"),), network="fast", held_out=0, inference_width=320)
    with pytest.raises(InvalidArgument, match=r"crop: must fit into frames of 240 x 320.*; got \(256, 384\)"):
        train(config, tmp_path / "run")
    with pytest.raises(InvalidArgument, match="refine_crop: must fit into the crop"):
        train(replace(config, refine_crop=(264, 264)), tmp_path / "run")
    assert not (tmp_path / "run").exists()


def one_frame_set(root, size, disparity=20.0):
    """Write a set of two training pairs of this disparity, a number or a map."""
    picture, truth = np.full((*size, 3), 90, np.uint8), np.full(size, disparity, np.float32)
    hashes = {
        name: write_sample(root, "train", Sample(name, picture, picture, truth, None, None, 200.0, 5.0))
        for name in ("0", "1")
    }
    write_dataset_record(root, {"format_version": 1, "name": "flat", "samples": {"train": hashes, "test": {}}})


@pytest.mark.skipif(torch.cuda.is_available(), reason="tests what a machine without a graphics card says")
def test_a_card_that_is_not_there_is_an_error(dataset_root, tmp_path):
    with pytest.raises(ProviderUnavailable, match="device"):
        train(settings(dataset_root, device="cuda"), tmp_path)


def test_a_validation_without_truth_or_without_numbers_is_an_error(tmp_path, dataset_root):
    one_frame_set(tmp_path, (64, 128), np.nan)
    network = build_network("wang2020")
    with pytest.raises(DatasetInvalid, match="held-out"):
        mean_errors(network, open_dataset(tmp_path, "train"), [0], refined=True)
    torch.nn.init.constant_(network.refinement[-1].weight, float("nan"))
    with pytest.raises(InferenceFailed, match="smaller rate"):
        mean_errors(network, open_dataset(dataset_root, "train"), [0], refined=True)


def test_padding_repeats_the_border():
    image = torch.arange(12.0).reshape(1, 1, 3, 4)
    padded = pad_to_multiple(image, 8)
    assert padded.shape == (1, 1, 8, 8)
    assert torch.equal(padded[..., :3, :4], image)
    assert torch.equal(padded[0, 0, 5], torch.tensor([8.0, 9, 10, 11, 11, 11, 11, 11]))
    assert pad_to_multiple(padded, 8).shape == (1, 1, 8, 8)


ENDLESS = """
import sys
from pathlib import Path
from endosdk.training.config import TrainConfig
from endosdk.training.train import train
config = TrainConfig(data=(sys.argv[1],), network="fast", crop=(64, 128), batch=1, held_out=1, log_every=1)
train(config, Path(sys.argv[2]))
"""


def test_a_killed_run_saves_what_it_has(dataset_root, tmp_path):
    log = tmp_path / "log.csv"
    process = subprocess.Popen(
        [sys.executable, "-c", ENDLESS, str(dataset_root), str(tmp_path)], stderr=subprocess.PIPE, text=True
    )
    try:
        deadline = time.monotonic() + 120
        while (not log.exists() or log.read_text().count("\n") < 3) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.terminate()
        _, error = process.communicate(timeout=60)
    finally:
        process.kill()
    assert "KeyboardInterrupt" in error
    assert 2 <= checkpoint.load(tmp_path).step < 4000


def test_a_log_that_a_crash_has_cut_short_is_gone_on_with(tmp_path):
    log = RunLog(tmp_path, None)
    for step in (1, 2, 3):
        log.add_step(step, 0.5 * step, {"loss": 1.0})
    with pytest.raises(InvalidArgument, match="out: must not be in use by another process"):
        RunLog(tmp_path, 2)
    log.close()
    written = (tmp_path / "log.csv").read_bytes()
    (tmp_path / "log.csv").write_bytes(written + b"4,2.0\n\n\0\0\0")
    RunLog(tmp_path, 2).close()
    assert (tmp_path / "log.csv").read_text().splitlines() == written.decode().splitlines()[:3]


TWO_PROCESSES = """
import sys, torch
from pathlib import Path
from endosdk.training.config import TrainConfig
from endosdk.training.run_process import process_group
from endosdk.training.train import Run
torch.set_num_threads(1)
config = TrainConfig(data=(sys.argv[1],), network="fast", crop=(64, 128), batch=1, held_out=2, steps=3,
                     refine_from_step=1, validate_every=2, device="cpu")
out = Path(sys.argv[2])
with process_group(torch.device("cpu")) as (rank, world):
    run = Run(config, out, rank, world)
    run.fit()
    total = sum(p.double().abs().sum().item() for p in run.network.parameters())
    (out / f"rank{rank}").write_text(f"{world} {total!r}")
"""


def test_two_processes_train_one_network(dataset_root, tmp_path):
    script, out = tmp_path / "two.py", tmp_path / "run"
    script.write_text(TWO_PROCESSES)
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", str(script)]
    done = subprocess.run([*command, str(dataset_root), str(out)], capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    # Each process saw other pairs; that both hold the same weights shows that gradients were shared.
    reports = [(out / f"rank{rank}").read_text() for rank in (0, 1)]
    assert reports[0] == reports[1]
    assert reports[0].startswith("2 ")
    trained = checkpoint.load(out)
    assert trained.step == 3
    total = sum(trained.network[name].double().abs().sum().item() for name, _ in trained.build().named_parameters())
    assert total == pytest.approx(float(reports[0].split()[1]))
    torch.manual_seed(0)
    assert not torch.equal(trained.network["stem.conv.weight"], build_network("fast").state_dict()["stem.conv.weight"])
