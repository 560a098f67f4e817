"""What the exported form of wang2020 gains over the network as it is trained, in ONNX Runtime on this processor.

    python -m benchmarks.studies.export_form --data DIR --threads 2 --json FILE

Every form has the same weights and must give the same answer on a pair of the test split before any is timed; they are
timed in turns. The weights are drawn rather than trained, because time does not depend on them.
"""

from __future__ import annotations

import argparse
import copy
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
import torch
from torch import Tensor, nn

from benchmarks.record import NO_MODEL, write_record
from endosdk.datasets.layouts import open_dataset
from endosdk.training.data import planar
from endosdk.training.export import ModelDescription, export_model
from endosdk.training.networks.base import StereoNetwork
from endosdk.training.networks.wang2020 import Wang2020
from endosdk.training.networks.wang2020_export import PlaneAggregation

PARITY_PX = 1e-3  # largest difference of the answers
WARMUP = 1


class AsTrained(Wang2020):
    """No change but evaluation mode; the runtime folds batch norm by itself."""

    def export_form(self) -> StereoNetwork:
        """Return a copy."""
        return copy.deepcopy(self).eval()


class Residuals(Wang2020):
    """Additions of a layer's own input folded into its weights."""

    def export_form(self) -> StereoNetwork:
        """Return a copy with that change."""
        return StereoNetwork.export_form(self)


class Planes(Wang2020):
    """The same, and 3-D convolutions as 2-D ones for every plane and its neighbours."""

    def export_form(self) -> StereoNetwork:
        """Return a copy with both changes."""
        form = StereoNetwork.export_form(self)
        form.aggregation = PlaneAggregation(form.aggregation)  # type: ignore[arg-type, assignment]
        return form


FORMS: dict[str, type[Wang2020]] = {
    "as trained": AsTrained,
    "additions in the weights": Residuals,
    "and planes one by one": Planes,
    "and the last layer in blocks, as shipped": Wang2020,
}


def drawn_weights(left: Tensor, right: Tensor, max_disparity: int) -> dict[str, Any]:
    """Return the state of a network whose batch norms have seen the pair and whose refinement does something."""
    torch.manual_seed(0)
    network = Wang2020(max_disparity).train()
    nn.init.normal_(network.refinement[-1].weight, std=0.01)  # type: ignore[arg-type]
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d | nn.BatchNorm3d):
            module.momentum = 1.0
    with torch.no_grad():
        network(left, right)
    return network.state_dict()


def start_sessions(state: dict[str, Any], max_disparity: int, threads: int) -> dict[str, ort.InferenceSession]:
    """Export every form and load it."""
    options = ort.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = threads, 3
    # Waiting threads of one session must not take time from the other.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    sessions = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, kind in FORMS.items():
            print(f"exporting: {name}", file=sys.stderr, flush=True)
            network = kind(max_disparity)
            network.load_state_dict(state)
            file = Path(folder) / "form.onnx"
            export_model(network, file, ModelDescription(name="wang2020", version="0"))
            sessions[name] = ort.InferenceSession(file.read_bytes(), options, providers=["CPUExecutionProvider"])
    return sessions


def largest_differences(sessions: dict[str, ort.InferenceSession], feeds: dict[str, np.ndarray]) -> dict[str, float]:
    """Return by how much each form's disparity differs from that of the first, px; raise where it is too much."""
    answers = {name: session.run(["disparity"], feeds)[0] for name, session in sessions.items()}
    first = next(iter(answers.values()))
    found = {name: float(np.abs(answer - first).max()) for name, answer in answers.items()}
    for name, difference in found.items():
        if not difference < PARITY_PX:
            raise SystemExit(f"{name!r} differs by {difference} px")
    return found


def medians(sessions: dict[str, ort.InferenceSession], feeds: dict[str, np.ndarray], runs: int) -> dict[str, float]:
    """Return the median time of each form, ms, of runs taken in turns."""
    times: dict[str, list[float]] = {name: [] for name in sessions}
    for turn in range(WARMUP + runs):
        for name, session in sessions.items():
            started = time.perf_counter()
            session.run(["disparity"], feeds)
            if turn >= WARMUP:
                times[name].append(1e3 * (time.perf_counter() - started))
        print(f"run {turn + 1} of {WARMUP + runs}", file=sys.stderr, flush=True)
    return {name: float(np.median(values)) for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of a data set with a test split")
    parser.add_argument("--max-disparity", type=int, default=72)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    sample = open_dataset(args.data, "test")[0]
    feeds = {name: planar(view)[None].numpy() for name, view in (("left", sample.left), ("right", sample.right))}
    views = [torch.from_numpy(view).float() for view in feeds.values()]
    sessions = start_sessions(drawn_weights(views[0], views[1], args.max_disparity), args.max_disparity, args.threads)
    differences = largest_differences(sessions, feeds)
    times = medians(sessions, feeds, args.runs)
    base = times["as trained"]
    for name, ms in times.items():
        print(f"{name:42} {ms:8.1f} ms  {ms / base:5.2f} of it", file=sys.stderr)
    height, width = sample.left.shape[:2]
    command = f"python -m benchmarks.studies.export_form --data {args.data.name} --max-disparity "
    command += f"{args.max_disparity} --threads {args.threads} --runs {args.runs}"
    record = {
        "network": "wang2020",
        "size": [width, height],
        "forms": {name: {"ms": ms, "share": ms / base, "differs_px": differences[name]} for name, ms in times.items()},
    }
    write_record(args.json, record, command=command, hashes=NO_MODEL)


if __name__ == "__main__":
    main()
