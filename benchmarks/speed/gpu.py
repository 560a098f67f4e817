"""Every shipped float model on a graphics card: the provider's options swept, half precision, copies counted or not.

    python -m benchmarks.speed.gpu --json FILE

Each variant is checked against the processor's answer before it is timed; one that cannot run or is too far off is
recorded as such. Times are of one pair: with inputs and outputs on the device, with both copied, and with inputs copied
from page-locked memory. The floors are what the card's arithmetic and memory allow at best. Compared with the same
network in torch, which answers the same pair from the device, is checked in the same way, and does not round to TF32
either. It is compiled by torch.compile, unless ``--eager`` is given.
``--provider cpu`` runs the same code where there is no card.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime as ort
import torch

from benchmarks.record import write_record
from benchmarks.speed.graph_cost import GraphCost, graph_cost
from endosdk.runtime.models import read_model, shipped_models
from endosdk.training import checkpoint
from endosdk.training.half import halved
from endosdk.training.model_file import sealed_bytes
from endosdk.training.networks.base import Deployed

Array = np.ndarray
Options = dict[str, str]

# As in the frame path, floats are not rounded to TF32. The exhaustive search for algorithms takes minutes: left out.
SWEEP: dict[str, tuple[str, ...]] = {
    "prefer_nhwc": ("0", "1"),
    "use_tf32": ("0",),
    "enable_cuda_graph": ("0", "1"),
    "cudnn_conv_algo_search": ("HEURISTIC",),
}
# Mean difference from the processor's answer, px, up to which a variant is fit for use.
LARGEST_DIFFERENCE = 0.05
TOO_FAR = "too far from the processor's answer"


@dataclass(frozen=True)
class Card:
    """Where to run, and its rates from the maker's data sheet (dense, no sparsity)."""

    provider: str  # "cuda" or "cpu"
    tera_fp32: float
    tera_fp16: float
    gigabytes: float

    @property
    def execution_provider(self) -> str:
        return {"cuda": "CUDAExecutionProvider", "cpu": "CPUExecutionProvider"}[self.provider]


def float_models() -> list[str]:
    """Name the shipped models that suit a graphics card."""
    return [
        name for name, file in shipped_models().items() if file == Path(read_model(name, integer_units=False).origin)
    ]


def half_precision(model: bytes) -> bytes:
    """Convert to 16-bit floats, but for what turns costs into disparity and looks into the pictures."""
    return sealed_bytes(halved(onnx.load_from_string(model)))


def pair_of(width: int, height: int) -> dict[str, Array]:
    """A textured pair shifted by 12 px, planar."""
    rng = np.random.default_rng(0)
    coarse = rng.integers(0, 256, (3, height // 4 + 1, width // 4 + 8)).astype(np.uint8)
    wide = coarse.repeat(4, axis=1).repeat(4, axis=2)[:, :height]
    return {"left": wide[None, :, :, :width].copy(), "right": wide[None, :, :, 12 : width + 12].copy()}


def page_locked(array: Array) -> Array:
    """Copy to memory that a card reads by itself, without a copy in between."""
    locked = torch.from_numpy(array).pin_memory()
    return locked.numpy()  # keeps the tensor alive


def named_sides(model: bytes) -> list[str]:
    """Name the sides of the model's pictures; empty where one is fixed."""
    graph = onnx.load_from_string(model).graph
    return [side.dim_param for side in graph.input[0].type.tensor_type.shape.dim]


class BoundSession:
    """A session with inputs and outputs in fixed memory of the device."""

    def __init__(self, model: bytes, device: Card, options: Options, feed: dict[str, Array], like: list[Array]) -> None:
        settings = ort.SessionOptions()
        settings.log_severity_level = 3
        if device.provider != "cpu":
            settings.add_session_config_entry("session.disable_cpu_ep_fallback", "1")
        # As the frame path does: where sides are known, no arithmetic of shapes is left, which runs on the processor.
        for side, length in zip(named_sides(model), feed["left"].shape, strict=True):
            if side:
                settings.add_free_dimension_override_by_name(side, length)
        providers = [(device.execution_provider, options)]
        self._session = ort.InferenceSession(model, settings, providers=providers)
        if self._session.get_providers()[0] != device.execution_provider:
            raise RuntimeError(f"{device.execution_provider} did not start")
        self._binding = self._session.io_binding()
        self._inputs = {
            name: ort.OrtValue.ortvalue_from_numpy(value, device.provider, 0) for name, value in feed.items()
        }
        self._outputs = [
            ort.OrtValue.ortvalue_from_shape_and_type(value.shape, value.dtype, device.provider, 0) for value in like
        ]
        for name, value in self._inputs.items():
            self._binding.bind_ortvalue_input(name, value)
        for name, value in zip(("disparity", "confidence"), self._outputs, strict=True):
            self._binding.bind_ortvalue_output(name, value)

    def run(self) -> None:
        """One pair that is on the device already; returns when the answer is there."""
        self._session.run_with_iobinding(self._binding)
        self._binding.synchronize_outputs()

    def run_with_copies(self, feed: dict[str, Array]) -> list[Array]:
        """One pair from the processor's memory and back to it."""
        for name, value in self._inputs.items():
            value.update_inplace(feed[name])
        self.run()
        return [value.numpy() for value in self._outputs]


def spread(call: Callable[[], object], frames: int, warmup: int) -> dict[str, float]:
    """Milliseconds of one call."""
    for _ in range(warmup):
        call()
    times = []
    for _ in range(frames):
        started = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - started))
    p50, p99 = np.percentile(times, (50, 99))
    return {"p50": float(p50), "p99": float(p99), "fps": 1000 / float(np.mean(times))}


def variants(device: Card) -> list[Options]:
    """Every combination of the options swept; one for the processor, which has none of them."""
    if device.provider == "cpu":
        return [{}]
    return [dict(zip(SWEEP, values, strict=True)) for values in itertools.product(*SWEEP.values())]


def parity_of(answer: Array, truth: Array) -> dict[str, float]:
    """Return how far an answer is from the processor's, px."""
    difference = np.abs(answer - truth)
    return {"mean_px": float(difference.mean()), "max_px": float(difference.max())}


def fits(parity: dict[str, float]) -> bool:
    return parity["mean_px"] <= LARGEST_DIFFERENCE  # NaN does not


def measure_variant(
    model: bytes, device: Card, options: Options, feed: dict[str, Array], truth: list[Array], frames: int
) -> dict[str, Any]:
    """Check and time one variant."""
    try:
        bound = BoundSession(model, device, options, feed, truth)
        parity = parity_of(bound.run_with_copies(feed)[0], truth[0])
    except Exception as error:  # the runtime has its own exception types with no common base
        return {"options": options, "failed": str(error).splitlines()[0]}
    if not fits(parity):
        return {"options": options, "parity": parity, "failed": TOO_FAR}
    feeds = {"with_copies_ms": feed}
    if device.provider == "cuda":
        feeds["with_page_locked_copies_ms"] = {name: page_locked(view) for name, view in feed.items()}
    warmup = frames // 10 + 1
    return {
        "options": options,
        "parity": parity,
        "on_device_ms": spread(bound.run, frames, warmup),
        **{name: spread(partial(bound.run_with_copies, views), frames, warmup) for name, views in feeds.items()},
    }


def measure_torch(
    name: str, device: Card, feed: dict[str, Array], truth: list[Array], frames: int, compiled: bool
) -> dict[str, Any]:
    """Check and time the network of a shipped model in torch, with an answer of the size of the truth."""
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = False
    place = "cuda" if device.provider == "cuda" else "cpu"
    built = checkpoint.load(checkpoint.starting_point(name.removesuffix("-fp32"))).build()
    built.deploy_at(feed["left"].shape[-1] // truth[0].shape[-1])
    network = Deployed(built.export_form()).eval().to(place)
    views = [torch.from_numpy(feed[side]).to(place) for side in ("left", "right")]
    call = torch.compile(network, mode="max-autotune") if compiled else network

    def run() -> torch.Tensor:
        disparity: torch.Tensor = call(*views)[0]
        if place == "cuda":
            torch.cuda.synchronize()
        return disparity

    found: dict[str, Any] = {"compiled": compiled}
    for precision in ("fp32", "fp16"):
        with torch.inference_mode(), torch.autocast(place, torch.float16, enabled=precision == "fp16"):
            parity = parity_of(run().float().cpu().numpy(), truth[0])
            found[precision] = {"parity": parity}
            if fits(parity):
                found[precision] |= spread(run, frames, frames // 10 + 1)
            else:
                found[precision]["failed"] = TOO_FAR
    return found


def with_floors(result: dict[str, Any], cost: GraphCost, device: Card, precision: str) -> dict[str, Any]:
    """Add the floors of this precision and how near to the higher one the device came."""
    rate, share = (device.tera_fp16, 0.5) if precision == "fp16" else (device.tera_fp32, 1.0)
    floors = cost.floors_ms(rate, device.gigabytes, share)
    if "on_device_ms" in result:
        result["share_of_floor"] = {name: ms / result["on_device_ms"]["p50"] for name, ms in floors.items()}
    return {"precision": precision, "floors_ms": floors, **result}


def measure_model(name: str, device: Card, size: tuple[int, int], frames: int, compiled: bool) -> dict[str, Any]:
    """Everything about one model."""
    model = read_model(name).data
    feed = pair_of(*size)
    reference = ort.InferenceSession(model, providers=["CPUExecutionProvider"])
    truth = reference.run(["disparity", "confidence"], feed)
    cost = graph_cost(model, *size)
    results = []
    for precision, data in (("fp32", model), ("fp16", half_precision(model))):
        for options in variants(device):
            found = measure_variant(data, device, options, feed, truth, frames)
            results.append(with_floors(found, cost, device, precision))
            timed = found.get("on_device_ms", {})
            print(name, precision, options, timed or found["failed"], file=sys.stderr, flush=True)
    return {
        "gmacs": cost.macs / 1e9,
        "conv_megabytes_fp32": cost.conv_bytes / 1e6,
        "variants": results,
        "torch": measure_torch(name, device, feed, truth, frames, compiled),
    }


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=float_models(), help="by name (default: %(default)s)")
    parser.add_argument("--size", default="960x720", help="size the network works at (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--provider", choices=["cuda", "cpu"], default="cuda")
    parser.add_argument("--eager", action="store_true", help="torch without torch.compile")
    # Of an H200: dense rates of its data sheet.
    parser.add_argument("--tera-fp32", type=float, default=67.0, help="10^12 operations a second")
    parser.add_argument("--tera-fp16", type=float, default=989.0, help="10^12 operations a second")
    parser.add_argument("--gigabytes", type=float, default=4800.0, help="of memory traffic a second")
    parser.add_argument("--json", type=Path, required=True)
    args = parser.parse_args(arguments)
    device = Card(args.provider, args.tera_fp32, args.tera_fp16, args.gigabytes)
    if device.execution_provider not in ort.get_available_providers():
        raise SystemExit(f"{device.execution_provider} is not installed here: pip install 'endosdk[gpu]'")
    warnings.filterwarnings("ignore", message=".*truncated.*")  # the conversion tells of every weight below 6e-8
    width, height = (int(side) for side in args.size.split("x"))
    name = torch.cuda.get_device_name() if device.provider == "cuda" else "processor"
    record = {
        "device": name,
        "size": [width, height],
        "models": {
            model: measure_model(model, device, (width, height), args.frames, not args.eager) for model in args.models
        },
    }
    command = f"python -m benchmarks.speed.gpu --models {' '.join(args.models)} --size {args.size}"
    command += f" --frames {args.frames} --provider {args.provider}{' --eager' if args.eager else ''}"
    hashes = {"model_sha256": {model: read_model(model).sha256 for model in args.models}}
    write_record(args.json, record, command=command, hashes=hashes)
    return 0


if __name__ == "__main__":
    sys.exit(main())
