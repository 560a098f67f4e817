"""The way from a finished run to a model file that can be shipped: score, export, compare."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from endosdk.datasets.dataset import DatasetReader
from endosdk.datasets.layouts import default_split, layout_of, open_dataset
from endosdk.errors import InvalidArgument
from endosdk.evaluation.methods import estimator_method, evaluate, require_pairs
from endosdk.io.names import RULE, is_plain_name
from endosdk.io.whole_files import whole_path
from endosdk.jobs.machine import machine_record
from endosdk.training.checkpoint import Checkpoint
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.memory import keep_freed_memory
from endosdk.training.parity import check_parity, parity_pairs
from endosdk.training.past_runs import runs_before, splits_of
from endosdk.training.quantize import describe_quantised, quantize_like, quantize_model, read_ranges
from endosdk.training.sets import HeldOutReader, JoinedReader, open_sets, split_pairs
from endosdk.training.validation import full_scores

RANGE_PAIRS = 48  # about so many, spread over those trained on, give the ranges of 8-bit integers
# Settings that say how the weights came about; the rest of the settings only say where and how fast.
RECIPE = (
    "network inference_width dense_disparity mode_reach train_pairs held_out loss balance volume_weight coarse_weight "
    "optimiser rate final_rate decay epochs warmup weight_decay clip steps batch crop refine_from_step refine_crop "
    "refine_only output_stride augment looks quantised frozen_norm seed"
).split()


def release(
    trained: Checkpoint,
    path: Path,
    *,
    version: str,
    name: str | None = None,
    data: Path | None = None,
    layout: str = "endosdk",
    int8: Path | None = None,
    ranges_of: Path | None = None,
    output_stride: int | None = None,
) -> dict[str, Any]:
    """Write the model file and return its scores on the test split and the parity with torch.

    ``data``, in this ``layout``, is the set whose test split is used, by default the one that the run was trained on;
    of a layout that has truth for no test split, the training split is taken, as the scores say. Of pairs that the run
    was trained on, only those that it held out are scored, and the scores name them ``held out``.
    With ``int8`` the 8-bit form is written there, named for its file; ranges are measured on pairs that the run was
    trained on, or taken from ``ranges_of``, an 8-bit file of the same weights. Weights that were kept without their run
    do not say where its data lies: they need ``data``, and ``ranges_of`` for an 8-bit form. The file has this
    ``output_stride``, by default the one that the network was trained for. Raises InvalidArgument for these, for a name
    or a version that no model may have, for a test split without pairs, and where a run that held out none would be
    scored on the pairs it was trained on. So does a run that stopped early: its confidence was never fitted.
    """
    if not trained.state.get("finished", True):  # runs before the key was kept may be finished
        rule = "must be finished: resume it, or a run of --steps 0 with --init-from fits the confidence"
        raise InvalidArgument("run", rule, f"one that stopped at step {trained.step} of {trained.config.steps}")
    info = ModelDescription(name=trained.config.network if name is None else name, version=version)
    if int8 is not None and not is_plain_name(int8.stem):
        raise InvalidArgument("int8", f"its name {RULE}", repr(int8.stem))
    reader = _test_split(trained, data, layout)
    if not trained.state["dataset"].get("held_out", 1):  # runs before the key was kept held out some
        rule = "must have held out pairs, to which its confidence is fitted; --steps 0 with --init-from fits it"
        raise InvalidArgument("run", rule, "held_out 0")
    # Both before the scoring, which takes minutes.
    known = None if ranges_of is None else read_ranges(ranges_of)
    ranges = _range_pairs(trained) if int8 is not None and ranges_of is None else None
    keep_freed_memory()  # the frames of the test split go through torch on the CPU
    network = trained.build()
    if output_stride is not None:
        network.deploy_at(output_stride)
    scores = full_scores(network, reader)
    machine = machine_record()
    training = {
        "data": trained.state["dataset"],
        "test": {**_note(reader), **scores},
        "commit": machine["commit"],
        "recipe": {key: trained.config.as_dict()[key] for key in RECIPE},
        "steps_done": trained.step,
        "steps_in_all": trained.steps_in_all,
        "precision": trained.state.get("precision"),  # None: of a run before it was kept
        "init": trained.state["init"],
        "changes": trained.state.get("changes", []),  # that a resumed run made: by the step from which they hold
    }
    sample = reader[0]
    # A file takes its name once it is known to be right: it may replace one that was.
    with whole_path(path, "out") as draft:
        export_model(network, draft, replace(info, training=training))
        parity = check_parity(network, draft, parity_pairs(sample.left, sample.right))
    report = {"model": info.name, "version": version, "training": training, "parity": parity, "machine": machine}
    if int8 is not None:
        with whole_path(int8, "int8") as draft:
            if ranges is not None:
                quantize_model(path, draft, *ranges)
            elif known is not None:
                quantize_like(path, draft, known)
            int8_scores = evaluate(estimator_method(str(draft)), reader)
            describe_quantised(draft, int8.stem, {**_note(reader), **int8_scores})
        report["int8"] = int8_scores
    return report


def _test_split(trained: Checkpoint, data: Path | None, layout: str) -> DatasetReader:
    if data is None:
        if not trained.config.data:
            raise InvalidArgument("data", "must be given: weights alone do not say where their data lies", "nothing")
        config = trained.config
        readers = [_unseen_pairs(trained, Path(root), layout_of(root, config.layout)) for root in config.data]
        return readers[0] if len(readers) == 1 else JoinedReader(readers)
    return _unseen_pairs(trained, data, layout)


def _unseen_pairs(trained: Checkpoint, root: Path, layout: str) -> DatasetReader:
    """Return the test split of a set, or, where that is what the run was trained on, the pairs that it held out."""
    reader = open_dataset(root, default_split(layout), layout=layout)
    require_pairs(reader)
    noted = trained.state["dataset"]
    if reader.split_sha256 not in splits_of(noted):
        own = root.resolve() in (Path(one).resolve() for one in trained.config.data)
        if own and open_dataset(root, "train", layout=layout).split_sha256 == reader.split_sha256:
            raise InvalidArgument("data", "must name other pairs: the set has changed since it was trained on", root)
        if any(reader.split_sha256 in splits_of(run["data"]) for run in runs_before(trained.state["init"])):
            rule = "must name other pairs: a run that this one goes back to was trained on these"
            raise InvalidArgument("data", rule, root)
        return reader
    _, held_out = split_pairs(reader, replace(trained.config, train_pairs=None))
    if not held_out:
        rule = "must name other pairs: the run was trained on all of these and held out none"
        raise InvalidArgument("data", rule, root)
    return HeldOutReader(reader, held_out)


def _note(reader: DatasetReader) -> dict[str, str]:
    return {"name": reader.name, "split": reader.split, "sha256": reader.sha256}


def _range_pairs(trained: Checkpoint) -> tuple[DatasetReader, list[int]]:
    """Return the training split of a run and the pairs of it on which ranges are measured."""
    if not trained.config.data:
        rule = "needs the pairs trained on, and weights do not say where they lie: export the run, or give ranges_of"
        raise InvalidArgument("int8", rule, trained.config.network)
    reader = open_sets(trained.config.data, "train", trained.config.layout)
    pairs, _ = split_pairs(reader, trained.config)
    return reader, pairs[:: max(1, len(pairs) // RANGE_PAIRS)]
