"""Frame rate of models on a processor without AVX-512 and VNNI: these are hidden from the libraries.

    python -m benchmarks.speed.avx2_only --models fast fast-320 --json benchmarks/results/speed/avx2_only.json

It needs the packages `gdb` and `binutils`. ONNX Runtime and endosdk ask the processor when they are loaded, and a
debugger changes the answers. From there on the process runs as it always does. `endosdk-bench` measures every model in
turns, with and without. Cores and caches stay those of this machine: an older processor has slower ones.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.record import write_record
from endosdk.io.progress import progress

LIBRARIES = ("onnxruntime.capi.onnxruntime_pybind11_state", "endosdk._core")
SCRIPT = Path(__file__).with_name("hide_avx512.py")
INSTRUCTION = re.compile(r"^\s*([0-9a-f]+):\s+cpuid", re.MULTILINE)
# glibc asks on its own, and has a setting.
ENVIRONMENT = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW,-AVX512DQ,-AVX512CD"}


def cpuid_offsets(library: Path) -> list[int]:
    """Return where in a library, in bytes from its beginning in memory, the processor is asked what it has."""
    code = subprocess.run(
        ["objdump", "-d", "--no-show-raw-insn", str(library)], capture_output=True, text=True, check=True
    ).stdout
    return [int(address, 16) for address in INSTRUCTION.findall(code)]


def library_file(module: str) -> Path:
    """Return the file of a compiled module. Raises ImportError where there is none."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ImportError(f"no module {module}")
    return Path(spec.origin)


def without_avx512(command: list[str], offsets: dict[str, list[int]]) -> None:
    """Run a command of Python with AVX-512 and VNNI hidden.

    Raises RuntimeError where it fails, or where a library never asks the processor.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "report.json"
        hidden = {"CPUID_OFFSETS": json.dumps(offsets), "CPUID_REPORT": str(file), **ENVIRONMENT}
        debugger = ["gdb", "-nx", "-batch", "-x", str(SCRIPT), "--args", sys.executable, *command]
        ended = subprocess.run(debugger, env=os.environ | hidden, capture_output=True, text=True, check=True)
        report = json.loads(file.read_text())
    if report["status"] != 0:
        raise RuntimeError(f"ended with {report['status']}: {ended.stderr[-2000:]}")
    if missing := offsets.keys() - report["answers"].keys():
        raise RuntimeError(f"never asked the processor: {', '.join(sorted(missing))}")


def measured(model: str, arguments: argparse.Namespace, offsets: dict[str, list[int]] | None) -> dict[str, Any]:
    """Return what `endosdk-bench` says of a model. With ``offsets`` AVX-512 and VNNI are hidden."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "bench.json"
        options = ["--threads", str(arguments.threads), "--frames", str(arguments.frames), "--size", arguments.size]
        options += ["--provider", "cpu"]
        command = ["-m", "endosdk", "bench", "--model", model, *options, "--out", str(out)]
        if offsets is None:
            subprocess.run([sys.executable, *command], capture_output=True, check=True)
        else:
            without_avx512(command, offsets)
        found: dict[str, Any] = json.loads(out.read_text())
    return found


def summary(runs: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the medians over runs of one kind. Raises RuntimeError where they differ in kernels or answer."""
    if len({(run["machine"]["kernels"], run["epe_px"]) for run in runs}) > 1:
        raise RuntimeError("runs of one kind gave unlike answers")
    latency = {name: statistics.median(run["latency_ms"][name] for run in runs) for name in ("p50", "p99")}
    rates = {name: statistics.median(run[name] for run in runs) for name in ("fps", "stream_fps")}
    kernels = runs[0]["machine"]["kernels"]
    return {"size": runs[0]["size"], **rates, "latency_ms": latency, "epe_px": runs[0]["epe_px"], "kernels": kernels}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", nargs="+", default=["fast", "fast-320"])
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--size", default="960x720", help="of the camera's frames")
    parser.add_argument("--turns", type=int, default=3)
    parser.add_argument("--json", type=Path, required=True)
    arguments = parser.parse_args()
    for tool in ("gdb", "objdump"):
        if shutil.which(tool) is None:
            sys.exit(f"needs {tool}")
    files = [library_file(module) for module in LIBRARIES]
    offsets = {file.name: cpuid_offsets(file) for file in files}
    kinds: dict[str, dict[str, list[int]] | None] = {"all instructions": None, "AVX2 alone": offsets}
    models, hashes = {}, {}
    for model in arguments.models:
        runs: dict[str, list[dict[str, Any]]] = {kind: [] for kind in kinds}
        for _ in progress(range(arguments.turns), title=model, unit="turn"):
            for kind, hidden in kinds.items():
                runs[kind].append(measured(model, arguments, hidden))
        models[model] = {kind: summary(found) for kind, found in runs.items()}
        if models[model]["AVX2 alone"]["kernels"] != "avx2":
            raise RuntimeError("endosdk did not take its AVX2 kernels")
        hashes[model] = runs["AVX2 alone"][0]["model"]["sha256"]
        for kind, found in models[model].items():
            print(f"{model:10} {kind:17} {found['fps']:6.1f} FPS, p99 {found['latency_ms']['p99']:5.1f} ms")
    names = " ".join(arguments.models)
    command = f"python -m benchmarks.speed.avx2_only --models {names} --threads {arguments.threads}"
    command += f" --frames {arguments.frames} --size {arguments.size} --turns {arguments.turns}"
    found = {"threads": arguments.threads, "frames": arguments.frames, "models": models}
    write_record(arguments.json, found, command=command, hashes={"model_sha256": hashes})


if __name__ == "__main__":
    main()
