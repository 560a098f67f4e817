import json
import resource
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors import safe_open

from endosdk.datasets.dataset import DatasetReader
from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.runtime.models import shipped_models
from endosdk.training import checkpoint
from endosdk.training.config import CHOICES, TrainConfig
from endosdk.training.networks import build_network
from endosdk.training.optimisers import build_optimiser
from endosdk.training.parity import check_parity, parity_pairs

PATH_TRACED = Path(__file__).parents[2] / "datasets" / "endosim-gi-cycles"

CONFIG = TrainConfig(network="fast", max_disparity=32, crop=(64, 128), refine_crop=(32, 64))
STATE = {"seconds": 1.5, "history": [], "dataset": {"name": "x"}, "init": None}


def stepped(optimiser_name):
    torch.manual_seed(0)
    network = build_network("fast", 32)
    optimiser = build_optimiser(network, TrainConfig(optimiser=optimiser_name, rate=1e-3))
    network(*torch.rand(2, 1, 3, 64, 64) * 255).disparities[0].sum().backward()
    optimiser.step()
    return network, optimiser


@pytest.mark.parametrize("optimiser_name", CHOICES["optimiser"])
def test_everything_comes_back(tmp_path, optimiser_name):
    network, optimiser = stepped(optimiser_name)
    checkpoint.save(tmp_path / checkpoint.LAST, CONFIG, 7, STATE, network, optimiser)
    loaded = checkpoint.load(tmp_path)
    assert (loaded.config, loaded.step, loaded.state) == (CONFIG, 7, STATE)
    for name, value in loaded.build().state_dict().items():
        assert torch.equal(value, network.state_dict()[name])
    fresh = build_optimiser(network, TrainConfig(optimiser=optimiser_name, rate=5e-4))
    checkpoint.restore_optimiser(fresh, loaded.optimiser)
    assert fresh.param_groups[0]["lr"] == 5e-4
    for index, entries in optimiser.state_dict()["state"].items():
        for name, value in entries.items():
            assert torch.equal(fresh.state_dict()["state"][index][name], value)


def test_a_network_answers_for_the_cells_it_was_trained_for(tmp_path):
    config = TrainConfig(network="wang2020", max_disparity=32, answer_cell=4)
    network = build_network("wang2020", 32)
    checkpoint.save(tmp_path / checkpoint.LAST, config, 7, STATE, network, torch.optim.SGD(network.parameters()))
    assert checkpoint.load(tmp_path).build().deployed_stride == 4


def test_the_file_is_plain_safetensors_with_json(tmp_path):
    network, optimiser = stepped("rmsprop")
    checkpoint.save(tmp_path / "a.safetensors", CONFIG, 7, STATE, network, optimiser)
    with safe_open(tmp_path / "a.safetensors", framework="numpy") as archive:
        assert json.loads(archive.metadata()["config"])["network"] == "fast"
        assert "network.confidence.weights" in archive.keys()
    assert [path.name for path in tmp_path.iterdir()] == ["a.safetensors"]


def test_a_failed_write_leaves_the_old_checkpoint(tmp_path):
    network, optimiser = stepped("rmsprop")
    path = tmp_path / checkpoint.LAST
    checkpoint.save(path, CONFIG, 7, STATE, network, optimiser)
    before = path.read_bytes()
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))  # no file may grow further: the kernel refuses the write
    try:
        with pytest.raises(StorageFailed, match="writable"):
            checkpoint.save(path, CONFIG, 8, STATE, network, optimiser)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_kept_weights_are_those_of_the_checkpoint_without_its_optimiser(tmp_path):
    network, optimiser = stepped("adamw")
    checkpoint.save(tmp_path / checkpoint.LAST, CONFIG, 7, STATE, network, optimiser)
    checkpoint.save_weights(tmp_path / "kept.safetensors", checkpoint.load(tmp_path))
    kept = checkpoint.load(tmp_path / "kept.safetensors")
    assert (kept.config, kept.step, kept.state["dataset"], kept.optimiser) == (CONFIG, 7, {"name": "x"}, {})
    assert all(torch.equal(value, network.state_dict()[name]) for name, value in kept.network.items())


@pytest.mark.parametrize(
    ("name", "model"),
    [
        ("fast", "fast-fp32"),
        ("fast-25", "fast-25-fp32"),
        ("fast-320", "fast-320-fp32"),
        ("accurate", "accurate-fp32"),
        ("wang2020", "wang2020"),
    ],
)
def test_shipped_weights_are_those_of_the_shipped_model(name, model):
    sample = DatasetReader(PATH_TRACED, "test")[0]
    network = checkpoint.load(checkpoint.starting_point(name)).build()
    check_parity(network, shipped_models()[model], parity_pairs(sample.left, sample.right)[1:])


def test_a_folder_called_like_shipped_weights_is_still_a_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgument, match="readable"):
        checkpoint.load(Path("fast"))  # nothing there: not the shipped weights instead
    network, optimiser = stepped("adamw")
    Path("fast").mkdir()
    checkpoint.save(Path("fast") / checkpoint.LAST, CONFIG, 7, STATE, network, optimiser)
    assert checkpoint.load(Path("fast")).step == checkpoint.load(checkpoint.starting_point("./fast")).step == 7
    assert checkpoint.load(checkpoint.starting_point("fast")).step > 7
    with pytest.raises(
        InvalidArgument, match=r"init_from: .* one of fast, fast-25, fast-320, accurate, wang2020; got fats"
    ):
        checkpoint.starting_point("fats")


def test_broken_and_foreign_files_are_named(tmp_path):
    network, optimiser = stepped("rmsprop")
    path = tmp_path / "a.safetensors"
    checkpoint.save(path, CONFIG, 7, STATE, network, optimiser)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InvalidArgument, match=r"a\.safetensors"):
        checkpoint.load(path)
    with pytest.raises(InvalidArgument, match="readable"):
        checkpoint.load(tmp_path / "missing.safetensors")
    from safetensors.torch import save_file

    save_file({"weight": torch.zeros(2)}, path)
    with pytest.raises(InvalidArgument, match="format"):
        checkpoint.load(path)


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({"loss": "l3"}, "loss"),
        ({"optimiser": "sgd"}, "optimiser"),
        ({"decay": "cosine"}, "decay"),
        ({"precision": "fp16"}, "precision"),
        ({"steps": -1}, "steps"),
        ({"final_rate": 1.0}, "final_rate"),
        ({"rate": float("inf")}, "rate"),
        ({"rate": float("nan")}, "rate"),
        ({"crop": (256, 512), "refine_crop": (512, 512)}, "refine_crop"),
        ({"refine_crop": (60, 128)}, "crop"),
        ({"balance": 5.0}, "balance: must be within 0..1; got 5.0"),
        ({"balance": float("nan")}, "balance"),
        ({"device": "gpu"}, "device: must be one of auto, cpu, cuda; got gpu"),
        ({"train_pairs": -2}, "train_pairs"),
        ({"train_pairs": 0}, "train_pairs"),
        ({"held_out": -1}, "held_out"),
        ({"workers": -1}, "workers"),
        ({"seed": -1}, "seed"),
        ({"cache_gib": -1.0}, "cache_gib"),
        ({"coarse_weight": -0.5}, "coarse_weight"),
        ({"weight_decay": -1e-4}, "weight_decay"),
        ({"refine_from_step": -1}, "refine_from_step"),
        ({"checkpoint_minutes": -1.0}, "checkpoint_minutes"),
        ({"crop": (60, 128)}, "crop"),
        ({"looks": ("fog",)}, "looks"),
        ({"volume_weight": -1.0}, "volume_weight"),
    ],
)
def test_bad_settings_are_named_at_once(changes, name):
    with pytest.raises(InvalidArgument, match=name):
        TrainConfig(**changes)


def test_a_set_by_itself_is_no_list_of_sets():
    with pytest.raises(InvalidArgument, match="data"):
        TrainConfig(data="somewhere")
    # As checkpoints of earlier releases hold it.
    assert TrainConfig.from_dict({"data": "somewhere"}).data == ("somewhere",)
    assert TrainConfig.from_dict({"data": ""}).data == ()


def test_unknown_settings_are_refused():
    with pytest.raises(InvalidArgument, match="epochs"):
        TrainConfig.from_dict({"epochs": 16})


def test_weights_of_another_shape_are_named(tmp_path):
    network, optimiser = stepped("rmsprop")
    checkpoint.save(tmp_path / checkpoint.LAST, replace(CONFIG, network="wang2020"), 7, STATE, network, optimiser)
    with pytest.raises(InvalidArgument, match=r"checkpoint: must hold the weights of wang2020 .* such as "):
        checkpoint.load(tmp_path).build()


def test_the_rate_rises_then_falls_to_its_end():
    config = TrainConfig(steps=1000, rate=1e-3, final_rate=1e-5, warmup=10)
    assert config.rate_at(0) == pytest.approx(1e-4)
    assert config.rate_at(500) == pytest.approx(1e-4)
    assert config.rate_at(1000) == pytest.approx(1e-5)
    assert config.rate_at(5000) == pytest.approx(1e-5)


def test_the_rate_may_fall_linearly():
    config = TrainConfig(steps=1000, rate=1e-3, final_rate=1e-5, warmup=10, decay="linear")
    assert config.rate_at(0) == pytest.approx(1e-4)
    assert config.rate_at(500) == pytest.approx(5.05e-4)
    assert config.rate_at(1000) == pytest.approx(1e-5)
    assert config.rate_at(5000) == pytest.approx(1e-5)
