"""Instructions that the NEON kernels take, beside the plain ones, counted in an emulator of the processor.

An emulator's time says nothing of a real processor; how many instructions it ran does not depend on it. First
``scripts/test_aarch64.sh``, which builds the program and checks that both sets give the same bytes. Then
``python -m benchmarks.speed.arm_instructions --out benchmarks/results/speed/arm_instructions.json``.
"""

from __future__ import annotations

import argparse
import subprocess
from pathlib import Path

from benchmarks.record import NO_MODEL, write_record
from endosdk.io.progress import progress

PROGRAM = Path("build/aarch64/cpp/tests/test_kernel_bytes")
EMULATOR = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]
SETS = ("plain", "neon")
REPEATS = 10


def kernel_names() -> list[str]:
    """Return the kernels that the program checks; it fails where two sets differ."""
    run = subprocess.run([*EMULATOR, str(PROGRAM)], capture_output=True, text=True, check=True)
    return [line.split()[0] for line in run.stdout.splitlines()]


def executed(kernel_set: str, kernel: str, repeats: int) -> int:
    """Instructions of a whole run: the emulator logs each as a block of its own."""
    command = [*EMULATOR, "-singlestep", "-d", "exec,nochain", str(PROGRAM), kernel_set, kernel, str(repeats)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL) as run:
        assert run.stderr is not None
        count = sum(line.startswith(b"Trace") for line in run.stderr)
    if run.returncode:
        raise subprocess.CalledProcessError(run.returncode, command)
    return count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, help="write the record there")
    arguments = parser.parse_args()
    counts = {}
    for kernel in progress(kernel_names(), unit="kernel"):
        counts[kernel] = {
            name: (executed(name, kernel, 1 + REPEATS) - executed(name, kernel, 1)) // REPEATS for name in SETS
        }
        plain, neon = (counts[kernel][name] for name in SETS)
        print(f"{kernel:16} plain {plain:9,}  NEON {neon:9,}  {plain / neon:5.2f} times fewer")
    if arguments.out:
        compiler, emulator = (_first_line(tool, "--version") for tool in ("aarch64-linux-gnu-g++", "qemu-aarch64"))
        record = {"compiler": compiler, "emulator": emulator, "instructions": counts}
        write_record(arguments.out, record, command="python -m benchmarks.speed.arm_instructions", hashes=NO_MODEL)


def _first_line(*command: str) -> str:
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()[0]


if __name__ == "__main__":
    main()
