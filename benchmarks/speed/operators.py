"""What the parts of a stereo network cost in ONNX Runtime on this processor, in float and in 8-bit integers.

    python -m benchmarks.speed.operators --threads 2 --json FILE

Each part is a graph of a few layers at the sizes of a network that sees 480 x 360. The 8-bit form is made by static
quantisation on one input and must agree with the float form before either is timed; the two are timed in turns.
"""

from __future__ import annotations

import argparse
import logging
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime as ort
import torch
import torch.nn.functional as F
from onnxruntime.quantization import CalibrationDataReader, QuantFormat, QuantType, quantize_static
from torch import Tensor, nn

from benchmarks.record import NO_MODEL, write_record

LAYERS = 8  # of a chain, so that the cost of entering and leaving it hardly counts
LARGEST_SHARE = 0.1  # mean difference of the 8-bit form, relative to the mean of the answer
SHOWN = "Conv Relu Add Concat Slice".split()


class SoftArgmin(nn.Module):
    """Softmax over planes and their mean, planes first or last."""

    def __init__(self, axis: int) -> None:
        super().__init__()
        self.axis = axis

    def forward(self, cost: Tensor) -> Tensor:
        planes = torch.arange(cost.shape[self.axis], dtype=torch.float32)
        if self.axis == 1:
            return (torch.softmax(-cost, 1) * planes.view(1, -1, 1, 1)).sum(1)
        return torch.softmax(-cost, -1) @ planes


class Neighbours(nn.Module):
    """A 3x3x3 convolution as a 2-D one over each plane and its two neighbours."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(3 * channels, channels, 3, padding=1)

    def forward(self, planes: Tensor) -> Tensor:
        nearer, farther = torch.cat([planes[:1], planes[:-1]]), torch.cat([planes[1:], planes[-1:]])
        return torch.relu(self.conv(torch.cat([nearer, planes, farther], dim=1)))


class Enlarged(nn.Module):
    def __init__(self, mode: str) -> None:
        super().__init__()
        self.mode = mode

    def forward(self, x: Tensor) -> Tensor:
        return F.interpolate(x, scale_factor=2.0, mode=self.mode)


def chain(channels: int, kernel: int = 3, groups: int = 1) -> nn.Module:
    layers = [nn.Conv2d(channels, channels, kernel, padding=kernel // 2, groups=groups) for _ in range(LAYERS)]
    return nn.Sequential(*(part for layer in layers for part in (layer, nn.ReLU())))


def parts() -> Iterator[tuple[str, nn.Module, tuple[int, ...], int]]:
    """Name, graph, input shape, and how many layers of the name the graph holds."""
    for views, height, width in ((2, 90, 120), (1, 90, 120), (1, 45, 60)):
        for channels in (16, 32, 64):
            name = f"conv 3x3, {channels} channels, {views} x {height} x {width}"
            yield name, chain(channels), (views, channels, height, width), LAYERS
    yield "conv 1x1, 64 channels, 1 x 90 x 120", chain(64, 1), (1, 64, 90, 120), LAYERS
    yield "depthwise 3x3, 64 channels, 1 x 90 x 120", chain(64, 3, 64), (1, 64, 90, 120), LAYERS
    yield "patches 4x4 to 32, 2 x 360 x 480", nn.Sequential(nn.Conv2d(3, 32, 4, 4), nn.ReLU()), (2, 3, 360, 480), 1
    yield "patches 8x8 to 32, 2 x 720 x 960", nn.Sequential(nn.Conv2d(3, 32, 8, 8), nn.ReLU()), (2, 3, 720, 960), 1
    yield "conv 3x3x3, 16 channels, 12 x 45 x 60", nn.Conv3d(16, 16, 3, padding=1), (1, 16, 12, 45, 60), 1
    yield "the same over neighbouring planes", Neighbours(16), (12, 16, 45, 60), 1
    yield "thin head 32 to 4, 1 x 90 x 120", nn.Conv2d(32, 4, 3, padding=1), (1, 32, 90, 120), 1
    yield "soft-argmin, planes first, 12 x 90 x 120", SoftArgmin(1), (1, 12, 90, 120), 1
    yield "soft-argmin, planes last, 90 x 120 x 12", SoftArgmin(-1), (1, 90, 120, 12), 1
    yield "pixel shuffle x2, 128 to 32 channels, 45 x 60", nn.PixelShuffle(2), (1, 128, 45, 60), 1
    yield "enlarge x2 nearest, 32 channels, 45 x 60", Enlarged("nearest"), (1, 32, 45, 60), 1
    yield "enlarge x2 bilinear, 1 channel, 90 x 120", Enlarged("bilinear"), (1, 1, 90, 120), 1


class OneInput(CalibrationDataReader):
    def __init__(self, value: np.ndarray) -> None:
        self.values = iter([{"x": value}])

    def get_next(self) -> dict[str, np.ndarray] | None:
        return next(self.values, None)


def forms(module: nn.Module, value: np.ndarray, folder: Path) -> dict[str, Path]:
    """Export a part and, where it has convolutions to quantise, its 8-bit form."""
    files = {"fp32": folder / "fp32.onnx"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's own deprecations
        torch.onnx.export(
            module.eval(),
            (torch.from_numpy(value),),
            str(files["fp32"]),
            input_names=["x"],
            dynamo=False,
            opset_version=18,
        )
    if any(isinstance(part, nn.Conv2d) for part in module.modules()):
        files["int8"] = folder / "int8.onnx"
        quantize_static(
            files["fp32"],
            files["int8"],
            OneInput(value),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            op_types_to_quantize=SHOWN,
        )
    return files


def measure(module: nn.Module, shape: tuple[int, ...], layers: int, threads: int, runs: int) -> dict[str, float]:
    """Milliseconds a layer of each form, medians of runs taken in turns; raises when the forms disagree."""
    value = np.random.default_rng(0).normal(size=shape).astype(np.float32)
    options = ort.SessionOptions()
    options.intra_op_num_threads, options.log_severity_level = threads, 3
    # Waiting threads of one session must not take time from the other.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    with tempfile.TemporaryDirectory() as folder:
        sessions = {
            name: ort.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
            for name, path in forms(module, value, Path(folder)).items()
        }
    answers = {name: session.run(None, {"x": value})[0] for name, session in sessions.items()}
    for name, answer in answers.items():
        share = float(np.abs(answer - answers["fp32"]).mean() / np.abs(answers["fp32"]).mean())
        if not share < LARGEST_SHARE:
            raise SystemExit(f"{name} differs from fp32 by {share:.0%} of the answer")
    times: dict[str, list[float]] = {name: [] for name in sessions}
    for _ in range(runs):
        for name, session in sessions.items():
            started = time.perf_counter()
            session.run(None, {"x": value})
            times[name].append(1e3 * (time.perf_counter() - started))
    return {name: float(np.median(values[runs // 4 :])) / layers for name, values in times.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--runs", type=int, default=24)
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args()
    logging.disable(logging.WARNING)  # the quantiser recommends a step that does nothing for such graphs
    torch.manual_seed(0)
    table: dict[str, dict[str, Any]] = {}
    for name, module, shape, layers in parts():
        table[name] = measure(module, shape, layers, args.threads, args.runs)
        found = "  ".join(f"{form} {ms:7.3f} ms" for form, ms in table[name].items())
        print(f"{name:48} {found}", file=sys.stderr, flush=True)
    command = f"python -m benchmarks.speed.operators --threads {args.threads} --runs {args.runs}"
    write_record(args.json, {"ms_per_layer": table}, command=command, hashes=NO_MODEL)


if __name__ == "__main__":
    main()
