import json
import resource
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save as safetensors_bytes

from endosdk.datasets.dataset import EndosdkReader
from endosdk.errors import InvalidArgument, StorageFailed
from endosdk.runtime.models import shipped_models
from endosdk.training import checkpoint, past_runs
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


def test_a_network_has_the_output_stride_it_was_trained_for(tmp_path):
    config = TrainConfig(network="wang2020", max_disparity=32, output_stride=4)
    network = build_network("wang2020", 32)
    checkpoint.save(tmp_path / checkpoint.LAST, config, 7, STATE, network, torch.optim.SGD(network.parameters()))
    assert checkpoint.load(tmp_path).build().deployed_stride == 4


@pytest.mark.parametrize(
    ("network_name", "cells", "stride"), [("wang2020", 4, 4), ("wang2020", 1, 1), ("fast", 2, 4), ("fast", 1, 2)]
)
def test_older_checkpoints_counted_cells_of_the_networks_map(tmp_path, network_name, cells, stride):
    config = TrainConfig(network=network_name, max_disparity=32)
    network = build_network(network_name, 32)
    file = tmp_path / checkpoint.LAST
    checkpoint.save(file, config, 7, STATE, network, torch.optim.SGD(network.parameters()))
    with safe_open(file, framework="pt") as archive:
        header, tensors = archive.metadata(), {name: archive.get_tensor(name) for name in archive.keys()}
    settings = json.loads(header["config"])
    assert settings.pop("output_stride") is None
    file.write_bytes(safetensors_bytes(tensors, header | {"config": json.dumps(settings | {"answer_cell": cells})}))
    loaded = checkpoint.load(file)
    assert loaded.config.output_stride == (None if cells == 1 else stride)
    assert loaded.build().deployed_stride == stride


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
        ("fast-320", "fast-320-fp32"),
        ("accurate", "accurate-fp32"),
        ("wang2020", "wang2020"),
    ],
)
def test_shipped_weights_are_those_of_the_shipped_model(name, model):
    sample = EndosdkReader(PATH_TRACED, "test")[0]
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
    # This run alone says nothing of shipped weights: their last one may have fitted the confidence, without a step.
    assert checkpoint.load(checkpoint.starting_point("fast")).steps_in_all > 7
    with pytest.raises(InvalidArgument, match=r"init_from: .* one of fast, fast-320, accurate, wang2020; got fats"):
        checkpoint.starting_point("fats")


def test_a_long_line_of_runs_is_still_read(tmp_path):
    network, optimiser = stepped("adamw")
    origin = None
    for number in range(60):
        origin = past_runs.with_oldest_joined({"data": {"name": str(number)}, "steps": 2, "init": origin})
    checkpoint.save(tmp_path / checkpoint.LAST, CONFIG, 7, STATE | {"init": origin}, network, optimiser)
    saved = checkpoint.load(tmp_path)
    assert saved.steps_in_all == 7 + 60 * 2
    told, runs = saved.state["init"], []
    while told is not None:
        runs.append(told["data"]["name"])
        oldest, told = told, told["init"]
    assert runs == [str(number) for number in range(59, 59 - past_runs.MOST_RUNS, -1)]
    assert "joined" in oldest and oldest["steps"] == 2 * (60 - past_runs.MOST_RUNS + 1)


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
    with pytest.raises(InvalidArgument, match="rounds"):
        TrainConfig.from_dict({"rounds": 16})


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


def test_the_rate_may_be_held_within_epochs_and_fall_by_one_factor_between_them():
    config = TrainConfig(steps=1600, rate=1e-3, final_rate=3e-5, warmup=0, decay="epochs", epochs=16)
    rates = [config.rate_at(step) for step in range(1600)]
    assert len({round(rate, 12) for rate in rates}) == 16
    assert all(rates[100 * epoch] == rates[100 * epoch + 99] for epoch in range(16))
    factors = [rates[100 * (epoch + 1)] / rates[100 * epoch] for epoch in range(15)]
    assert factors == pytest.approx([(3e-5 / 1e-3) ** (1 / 15)] * 15)
    assert rates[0] == 1e-3 and rates[-1] == pytest.approx(3e-5) and config.rate_at(9999) == pytest.approx(3e-5)
    assert replace(config, epochs=1).rate_at(1599) == 1e-3


def test_the_rate_may_drop_once_after_two_thirds():
    config = TrainConfig(steps=300, rate=5e-4, final_rate=5e-5, warmup=0, decay="drop")
    assert {config.rate_at(step) for step in range(200)} == {5e-4}
    assert {config.rate_at(step) for step in range(200, 300)} == {5e-5}


PART = "aggregation.surroundings"


def test_weights_of_another_release_are_refused_with_a_name():
    network = build_network("fast", 32)
    older = {name: tensor for name, tensor in network.state_dict().items() if not name.startswith(PART)}
    assert len(older) < len(network.state_dict())
    with pytest.raises(InvalidArgument, match=f"must hold the weights of fast.*such as {PART}"):
        checkpoint.Checkpoint(CONFIG, 7, STATE, older, {}).build()
    with pytest.raises(InvalidArgument, match="must hold the weights of fast"):  # also by planes of another range
        checkpoint.Checkpoint(CONFIG, 7, STATE, older, {}).load_into(build_network("fast", 64))


def test_surroundings_of_other_planes_are_taken_from_the_nearest():
    torch.manual_seed(0)
    network = build_network("fast", 32)
    for name, values in network.named_parameters():
        if name.startswith(PART):
            torch.nn.init.normal_(values, std=0.1)
    saved = checkpoint.Checkpoint(CONFIG, 7, STATE, network.state_dict(), {})
    nearer = build_network("fast", 64, dense_disparity=32)  # planes at 0..28 as before, and at 32, 40, 48, 56
    saved.load_into(nearer)
    old, new = network.aggregation.surroundings, nearer.aggregation.surroundings
    torch.testing.assert_close(new.last.weight[:28], old.last.weight[:28], rtol=0, atol=0)
    for plane in range(8, 12):
        assert torch.equal(new.last.bias[4 * plane : 4 * plane + 4], old.last.bias[28:32])
    # A volume that is the same in all planes that came from one gives what that one gave.
    volume, view = torch.rand(1, 8, 16, 8, 12), torch.rand(1, 32, 16, 24)
    wider = volume[:, [*range(8), 7, 7, 7, 7]]
    with torch.no_grad():
        expected = old.eval()(volume.flatten(1, 2), view)
        torch.testing.assert_close(new.eval()(wider.flatten(1, 2), view)[:, :32], expected, rtol=1e-4, atol=1e-5)


def test_a_set_that_counted_twice_held_out_its_pairs_twice():
    note = {"sha256": "both", "splits": ["a", "a", "b"], "held_out": 24}
    origin = {"data": {"sha256": "other", "splits": ["c"], "held_out": 0}, "steps": 1}
    origin["init"] = {"data": note, "steps": 1, "init": None}
    past_runs.check_held_out(origin, {"sha256": "a"}, 8)
    with pytest.raises(InvalidArgument, match="held_out: must be at most 8"):
        past_runs.check_held_out(origin, {"sha256": "a"}, 9)
    past_runs.check_held_out(origin, {"sha256": "a", "held_out": 8}, 20)  # of films, no more than 8 of the 20
