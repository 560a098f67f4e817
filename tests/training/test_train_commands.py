import json
import shutil
import signal
from dataclasses import replace

import cv2
import numpy as np
import onnxruntime as ort
import pytest

from endosdk.commands.cli import main
from endosdk.datasets.dataset import Sample
from endosdk.datasets.writer import write_dataset_record, write_sample
from endosdk.errors import InferenceFailed, InvalidArgument
from endosdk.runtime.models import shipped_weights
from endosdk.training import checkpoint
from endosdk.training.config import TrainConfig
from endosdk.training.release import release
from endosdk.training.train import train


def test_from_data_to_model_file(dataset_root, tmp_path, capsys, monkeypatch):
    run, model = tmp_path / "run", tmp_path / "model.onnx"
    common = ["--crop", "64", "128", "--batch", "1", "--held-out", "1", "--max-disparity", "48"]
    begin = ["train", "--data", str(dataset_root), "--out", str(run), "--steps", "2", "--inference-width", "160"]
    # The network whose file takes least time to write.
    assert main([*begin, "--network", "wang2020", *common]) == 0
    assert main(["train", "--out", str(run), "--resume", "--steps", "3"]) == 0
    capsys.readouterr()
    weights = tmp_path / "kept.safetensors"
    named = ["--name", "trial", "--model-version", "7", "--weights", str(weights)]
    assert main(["export", str(run), "--out", str(model), *named, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["parity"]["largest_px"] <= 1e-3
    assert report["training"]["steps_done"] == report["training"]["steps_in_all"] == 3
    assert report["training"]["test"]["pairs"] == 2
    assert report["training"]["test"]["all"]["epe_px"] > 0
    assert report["training"]["data"]["name"] == "warped"
    assert (report["training"]["data"]["pairs"], report["training"]["data"]["held_out"]) == (9, 1)
    assert (report["training"]["recipe"]["train_pairs"], report["training"]["recipe"]["held_out"]) == (None, 1)

    metadata = ort.InferenceSession(model).get_modelmeta().custom_metadata_map
    assert (metadata["endosdk.name"], metadata["endosdk.version"]) == ("trial", "7")
    assert json.loads(metadata["endosdk.training"]) == report["training"]
    assert (metadata["endosdk.max_disparity"], metadata["endosdk.inference_width"]) == ("48", "160")
    assert str(tmp_path) not in metadata["endosdk.training"]

    # Weights alone can be exported where a set to score them on is given.
    again = tmp_path / "again.onnx"
    with monkeypatch.context() as patch:
        # To write a file takes long. That of the run must be what the kept weights compute: the export compares them.
        patch.setattr("endosdk.training.release.export_model", lambda network, file, info: shutil.copy(model, file))
        assert main(["export", str(weights), "--out", str(again), "--data", str(dataset_root)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "wang2020 1, 2 pairs of warped, split test" and lines[-1] == f"written {again}"
    assert [line.split()[0] for line in lines[1:-1]] == ["float32", "parity"] and "EPE" in lines[1]
    for given, named in (
        ([], "data: must be given"),
        (["--data", str(dataset_root), "--int8", str(again)], "int8: must be another file than --out"),
        (["--data", str(dataset_root), "--int8", str(run / "8.onnx")], "int8: needs the pairs trained on"),
    ):
        assert main(["export", str(weights), "--out", str(again), *given]) == 2
        assert named in capsys.readouterr().err

    # Both ways on: from what was kept, and from weights that come with the package.
    for network, start in (("wang2020", str(weights)), ("fast", "fast")):
        begun = ["--data", str(dataset_root), "--out", str(tmp_path / f"from-{network}"), "--init-from", start]
        assert main(["train", *begun, "--network", network, "--steps", "1", *common]) == 0
    printed = capsys.readouterr().out
    assert "from fast: dense_disparity 48, mode_reach 2, inference_width none, looks tone colours" in printed
    past = checkpoint.load(checkpoint.starting_point("fast")).config
    assert past.steps == 0  # its confidence was fitted last, with the rates of the last third of the run before
    rates = f"rate {past.rate:.3g}, final_rate {past.final_rate:.3g}\n"
    assert f"decay linear, epochs 16, weight_decay 0.0001, frozen_norm {past.frozen_norm}, {rates}" in printed
    assert checkpoint.load(tmp_path / "from-fast").config.optimiser == "muon"


@pytest.fixture
def asked(monkeypatch):
    """The settings of the runs that the command would begin."""
    seen = []
    monkeypatch.setattr("endosdk.training.train.train", lambda config, out, resume: seen.append(config) or out)
    return seen


@pytest.mark.parametrize(
    ("words", "settings"),
    [
        ([], {}),
        (["--looks", "tone", "colours"], {"looks": ("tone", "colours")}),
        (["--no-augment"], {"augment": False}),
        (["--frozen-norm"], {"frozen_norm": True}),
        (["--quantised"], {"quantised": True}),
        (["--refine-only"], {"refine_only": True}),
        (["--refine-crop", "64", "96"], {"refine_crop": (64, 96)}),
    ],
)
def test_an_option_changes_its_own_setting_alone(words, settings, asked):
    assert main(["train", "--data", "set", "--out", "run", *words]) == 0
    assert asked == [TrainConfig(data=("set",), **settings)]


def test_options_come_before_the_recipe_of_the_weights(asked):
    begin = ["train", "--data", "set", "--out", "run", "--init-from"]
    for start, words in (("fast", []), ("fast", ["--looks", "--no-frozen-norm"])):
        assert main([*begin, start, *words]) == 0
    taken_over, own = asked
    assert taken_over.looks and own == replace(taken_over, looks=(), frozen_norm=False)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["train", "--data", "nowhere", "--out", "run"], "dataset: must be a folder that is there; got nowhere"),
        (["train", "--data", "x", "--out", "run", "--network", "no-such"], "wang2020"),
        (["train", "--out", "nowhere", "--resume"], "checkpoint"),
        (["train", "--out", "run"], "data: must name the folder of a data set"),
        (["train", "--data", "x", "--out", "run", "--workers", "-1"], "workers: must be within 0.."),
        (["train", "--data", "x", "--out", "run", "--device", "gpu"], "device: must be one of auto, cpu, cuda"),
        (["export", "nowhere", "--out", "model.onnx"], "checkpoint"),
        (["export", "no-such", "--out", "model.onnx"], "run: must be a run folder, a checkpoint or one of fast, "),
        (["export", "fast", "--out", "model.onnx"], "data: must be given: weights alone do not say"),
        (["export", "nowhere", "--out", "."], "out: must be a file that ends in .onnx"),
        (["export", "nowhere", "--out", "model.onnx", "--layout", "kitti"], "layout: is that of --data"),
        (["export", "nowhere", "--out", "model.onnx", "--ranges-of", "8.onnx"], "ranges_of: is for --int8; give both"),
        (["export", "nowhere", "--out", "m.onnx", "--int8", "./m.onnx"], "int8: must be another file than --out"),
        (["export", "fast", "--triton", "served", "--layout", "kitti"], "layout: is for a training run"),
        (["export", "fast", "--triton", "served", "--model-version", "2"], "model_version: is for a training run"),
        (["export", "fast", "--triton", "served", "--output-stride", "4"], "output_stride: is for a training run"),
        (
            ["export", "nowhere", "--out", "model.onnx", "--triton", "served", "--model-version", "1.2"],
            "model_version: must be a whole number with --triton; got '1.2'",
        ),
    ],
)
def test_bad_input_is_one_line_and_status_two(words, part, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert part in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("--name", "a/b"), "name: must be 1 to 100 letters"),
        (("--name", ""), "name: must be 1 to 100 letters"),
        (("--model-version", ""), "version: must not be empty"),
        (("--int8", "8 bit.onnx"), "int8: its name must be 1 to 100 letters"),
    ],
)
def test_a_name_no_model_may_have_is_refused_at_once(words, part, dataset_root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("endosdk.training.release.full_scores", lambda *_: pytest.fail("scored"))
    weights = str(shipped_weights()["fast"])
    assert main(["export", weights, "--out", "m.onnx", "--data", str(dataset_root), *words]) == 2
    assert part in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def leave_out_the_export(monkeypatch):
    """Where only the scores are looked at."""
    monkeypatch.setattr("endosdk.training.release.export_model", lambda network, file, info: file.touch())
    monkeypatch.setattr("endosdk.training.release.check_parity", lambda *_: None)


def test_a_file_that_fails_the_comparison_replaces_none(dataset_root, tmp_path, monkeypatch):
    def unlike(*_):
        raise InferenceFailed("model", "must agree with torch", "1 px")

    model, run = tmp_path / "m.onnx", checkpoint.load(checkpoint.starting_point("fast"))
    model.write_text("a good one")
    leave_out_the_export(monkeypatch)
    monkeypatch.setattr("endosdk.training.release.check_parity", unlike)
    with pytest.raises(InferenceFailed):
        release(run, model, version="1", data=dataset_root)
    assert model.read_text() == "a good one" and list(tmp_path.iterdir()) == [model]
    with pytest.raises(InvalidArgument, match="run: must have held out pairs, to which its confidence is fitted"):
        state = {**run.state, "dataset": {**run.state["dataset"], "held_out": 0}}
        release(replace(run, state=state), model, version="1", data=dataset_root)


def test_a_layout_without_test_pairs_is_scored_on_those_with_truth(tmp_path, monkeypatch):
    """KITTI has truth for its training pairs alone; the record names the split."""
    rng = np.random.default_rng(1)
    for name in ("000000_10", "000001_10"):
        wide = rng.integers(0, 256, (96, 170, 3), dtype=np.uint8)
        for folder, picture in (
            ("image_2", wide[:, :160]),
            ("image_3", wide[:, 10:]),
            ("disp_occ_0", np.full((96, 160), 10 * 256, np.uint16)),
        ):
            file = tmp_path / "kitti/training" / folder / f"{name}.png"
            file.parent.mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(file), picture)
        calibration = tmp_path / f"kitti/training/calib_cam_to_cam/{name.removesuffix('_10')}.txt"
        calibration.parent.mkdir(exist_ok=True)
        rows = "100 0 80 {} 0 100 48 0 0 0 1 0\n"
        calibration.write_text(f"P_rect_02: {rows.format(0)}P_rect_03: {rows.format(-54)}")
    common = {"network": "fast", "max_disparity": 48, "crop": (64, 128), "inference_width": 160, "batch": 1}
    data = {"data": (str(tmp_path / "kitti"),), "layout": "kitti", "held_out": 1}
    run = train(TrainConfig(**common, **data, steps=1), tmp_path / "run")
    leave_out_the_export(monkeypatch)
    for given in ({}, {"data": tmp_path / "kitti", "layout": "kitti"}):
        report = release(checkpoint.load(run), tmp_path / "m.onnx", version="1", **given)
        assert (report["training"]["test"]["split"], report["training"]["test"]["pairs"]) == ("held out", 1)
    assert cv2.imwrite(str(tmp_path / "kitti/training/image_2/000001_10.png"), wide[:, 1:161])
    with pytest.raises(InvalidArgument, match="data: must name other pairs: the set has changed"):
        release(checkpoint.load(run), tmp_path / "m.onnx", version="1")


def write_plain(root, pairs):
    for number in range(pairs):
        picture = np.full((64, 128, 3), 90 + number, np.uint8)
        (root / f"{number}").mkdir(parents=True)
        for name, content in (
            ("left", picture),
            ("right", picture),
            ("disparity", np.full((64, 128), 9 * 256, np.uint16)),
        ):
            assert cv2.imwrite(str(root / f"{number}/{name}.png"), content)


def test_no_pair_that_was_trained_on_is_scored_as_a_test(tmp_path, monkeypatch):
    """A plain folder serves as both splits."""
    for name, pairs in (("mine", 3), ("others", 2)):
        write_plain(tmp_path / name, pairs)
    common = {"network": "fast", "max_disparity": 48, "crop": (64, 128), "inference_width": 128, "batch": 1}
    data = {"data": (str(tmp_path / "mine"),), "layout": "plain"}
    leave_out_the_export(monkeypatch)
    run = checkpoint.load(train(TrainConfig(**common, **data, held_out=1, steps=1), tmp_path / "run"))

    def scored(run, **given):
        test = release(run, tmp_path / "m.onnx", version="1", **given)["training"]["test"]
        return test["name"], test["split"], test["pairs"]

    mine, others = ({"data": tmp_path / name, "layout": "plain"} for name in ("mine", "others"))
    for given in ({}, mine):
        assert scored(run, **given) == ("plain:mine", "held out", 1)
    assert scored(run, **others) == ("plain:others", "test", 2)
    checkpoint.save_weights(tmp_path / "kept.safetensors", run)  # they do not say where their data lies
    assert scored(checkpoint.load(tmp_path / "kept.safetensors"), **mine) == ("plain:mine", "held out", 1)
    goes_on = TrainConfig(
        **common, data=(str(tmp_path / "others"),), layout="plain", held_out=1, steps=1, init_from=str(tmp_path / "run")
    )
    with pytest.raises(InvalidArgument, match="data: must name other pairs: a run that this one goes back to"):
        scored(checkpoint.load(train(goes_on, tmp_path / "goes-on")), **mine)
    none = checkpoint.load(train(TrainConfig(**common, **data, held_out=0, steps=1), tmp_path / "none"))
    with pytest.raises(InvalidArgument, match="data: must name other pairs: the run was trained on all of these"):
        release(none, tmp_path / "m.onnx", version="1")


def test_a_polite_kill_leaves_a_run_to_resume(dataset_root, tmp_path, monkeypatch, capsys):
    def killed(*_):
        signal.raise_signal(signal.SIGTERM)
        return {}

    monkeypatch.setattr("endosdk.training.train.Run._train_step", killed)
    run = tmp_path / "my run"
    words = ["train", "--network", "fast", "--crop", "64", "128", "--batch", "1", "--held-out", "1"]
    assert main([*words, "--data", str(dataset_root), "--out", str(run)]) == 143
    assert f"stopped; endosdk train --resume --out '{run}' continues" in capsys.readouterr().err
    assert not checkpoint.load(run).state["finished"]
    monkeypatch.setattr("endosdk.training.train.open_sets", killed)
    assert main([*words, "--data", str(dataset_root), "--out", str(tmp_path / "none")]) == 143
    assert "train: interrupted" in capsys.readouterr().err


def test_own_pairs_can_be_mixed_with_rendered_ones(dataset_root, tmp_path, monkeypatch):
    write_plain(tmp_path / "mine", 3)
    words = ["train", "--network", "fast", "--layout", "plain", "--crop", "64", "128", "--inference-width", "128"]
    words += [
        "--max-disparity",
        "48",
        "--batch",
        "1",
        "--steps",
        "1",
        "--held-out",
        "1",
        "--out",
        str(tmp_path / "run"),
    ]
    assert main([*words, "--data", str(tmp_path / "mine"), str(dataset_root)]) == 0
    run = checkpoint.load(tmp_path / "run")
    assert (run.state["dataset"]["pairs"], run.state["dataset"]["held_out"]) == (2 + 9, 2)  # none of the test pairs
    leave_out_the_export(monkeypatch)
    test = release(run, tmp_path / "m.onnx", version="1")["training"]["test"]
    assert (test["name"], test["split"], test["pairs"]) == ("plain:mine + warped", "held out + test", 3)


def test_plain_folders_can_be_trained_on(tmp_path):
    write_plain(tmp_path / "mine", 1)
    words = ["--data", str(tmp_path / "mine"), "--layout", "plain", "--out", str(tmp_path / "run"), "--held-out", "0"]
    size = ["--crop", "64", "128", "--inference-width", "128", "--max-disparity", "48"]
    assert main(["train", "--network", "fast", *words, *size, "--batch", "1", "--steps", "1"]) == 0
    assert checkpoint.load(tmp_path / "run").step == 1


def test_a_set_without_test_pairs_is_named_at_once(tmp_path, capsys):
    picture, truth = np.zeros((64, 128, 3), np.uint8), np.full((64, 128), 9.0, np.float32)
    sample = write_sample(tmp_path, "train", Sample("0", picture, picture, truth, None, None, 200.0, 5.0))
    write_dataset_record(
        tmp_path, {"format_version": 1, "name": "bare", "samples": {"train": {"0": sample}, "test": {}}}
    )
    weights = str(shipped_weights()["fast"])
    assert main(["export", weights, "--out", str(tmp_path / "m.onnx"), "--data", str(tmp_path)]) == 2
    assert "data: must have pairs in its split test; got none in bare" in capsys.readouterr().err
    assert (
        main(
            [
                "train",
                "--data",
                str(tmp_path),
                "--out",
                str(tmp_path / "dataset.json"),
                "--held-out",
                "0",
                "--network",
                "fast",
                "--crop",
                "64",
                "128",
            ]
        )
        == 2
    )
    assert "out: the folder must be writable" in capsys.readouterr().err
