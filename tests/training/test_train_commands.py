import json

import pytest

from endosdk.cli import main


def test_from_data_to_model_file(dataset_root, tmp_path, capsys):
    run, model = tmp_path / "run", tmp_path / "model.onnx"
    common = ["--network", "fast", "--crop", "64", "128", "--batch", "1", "--held-out", "1", "--max-disparity", "48"]
    assert main(["train", "--data", str(dataset_root), "--out", str(run), "--steps", "2", *common]) == 0
    assert main(["train", "--out", str(run), "--resume", "--steps", "3"]) == 0
    capsys.readouterr()
    weights = tmp_path / "kept.safetensors"
    named = ["--name", "trial", "--model-version", "7", "--weights", str(weights)]
    assert main(["export", str(run), "--out", str(model), *named]) == 0
    printed = capsys.readouterr().out
    report = json.loads(printed[: printed.rindex("}") + 1])
    assert report["parity"]["largest_px"] <= 1e-3
    assert report["training"]["steps_done"] == 3
    assert report["training"]["test"]["pairs"] == 2
    assert report["training"]["test"]["all"]["epe_px"] > 0
    assert report["training"]["data"]["name"] == "warped"

    import onnxruntime as ort

    metadata = ort.InferenceSession(model).get_modelmeta().custom_metadata_map
    assert (metadata["endosdk.name"], metadata["endosdk.version"]) == ("trial", "7")
    assert json.loads(metadata["endosdk.training"]) == report["training"]
    assert metadata["endosdk.max_disparity"] == "48"
    assert str(tmp_path) not in metadata["endosdk.training"]

    # Both ways on: from what was kept, and from weights that come with the package.
    for start in (str(weights), "fast"):
        begun = ["--data", str(dataset_root), "--out", str(tmp_path / f"from-{len(start)}"), "--init-from", start]
        assert main(["train", *begun, "--steps", "1", *common]) == 0


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["train", "--data", "nowhere", "--out", "run"], "dataset.json"),
        (["train", "--data", "x", "--out", "run", "--network", "no-such"], "wang2020"),
        (["train", "--out", "nowhere", "--resume"], "checkpoint"),
        (["export", "nowhere", "--out", "model.onnx"], "checkpoint"),
    ],
)
def test_bad_input_is_one_line_and_status_two(words, part, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    error = capsys.readouterr().err
    assert part in error
    assert error.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
