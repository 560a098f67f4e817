"""The way from a finished run to a model file that can be shipped: score, export, compare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from endosdk.dataset_layouts import open_dataset
from endosdk.errors import InvalidArgument
from endosdk.evaluation import estimator_method, evaluate
from endosdk.machine import machine_record
from endosdk.training.checkpoint import Checkpoint
from endosdk.training.evaluate import full_scores
from endosdk.training.export import ModelInfo, export_model
from endosdk.training.memory import keep_freed_memory
from endosdk.training.parity import check_parity, parity_pairs
from endosdk.training.quantize import describe_quantised, quantize_model

RANGE_PAIRS = 48  # on which the ranges of 8-bit integers are measured, spread over the training split
# Settings that say how the weights came about; the rest of the settings only say where and how fast.
RECIPE = (
    "loss balance coarse_weight optimiser rate final_rate steps batch crop refine_from_step refine_crop augment seed"
).split()


def release(
    trained: Checkpoint,
    path: Path,
    *,
    name: str | None = None,
    version: str = "1",
    data: Path | None = None,
    layout: str = "endosdk",
    int8: Path | None = None,
) -> dict[str, Any]:
    """Write the model file and return its scores on the test split and the parity with torch.

    ``data`` is the set whose test split is used, by default the one that the run was trained on. With ``int8`` the
    8-bit form is written there, named for its file; ranges are measured on pairs that the run was trained on.
    """
    seen = open_dataset(Path(trained.config.data), "train", layout=trained.config.layout)
    reader = open_dataset(data if data is not None else Path(trained.config.data), "test", layout=layout)
    if len(reader) == 0:
        raise InvalidArgument("data", "must have pairs in its test split", reader.name)
    keep_freed_memory()  # the frames of the test split go through torch on the CPU
    network = trained.build()
    scores = full_scores(network, reader)
    machine = machine_record()
    training = {
        "data": trained.state["dataset"],
        "test": {"name": reader.name, "sha256": reader.sha256, **scores},
        "commit": machine["commit"],
        "recipe": {key: trained.config.as_dict()[key] for key in RECIPE},
        "steps_done": trained.step,
        "init": trained.state["init"],
    }
    info = ModelInfo(name=name or trained.config.network, version=version, training=training)
    export_model(network, path, info)
    sample = reader[0]
    parity = check_parity(network, path, parity_pairs(sample.left, sample.right))
    report = {"model": info.name, "version": version, "training": training, "parity": parity, "machine": machine}
    if int8 is not None:
        quantize_model(path, int8, seen, range(0, len(seen), max(1, len(seen) // RANGE_PAIRS)))
        int8_scores = evaluate(estimator_method(str(int8)), reader)
        describe_quantised(int8, int8.stem, {"name": reader.name, "sha256": reader.sha256, **int8_scores})
        report["int8"] = int8_scores
    return report
