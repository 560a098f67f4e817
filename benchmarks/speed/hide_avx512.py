"""Run by the debugger: the libraries of a process learn of no AVX-512 and no VNNI when they ask the processor.

`avx2_only` starts it. `CPUID_OFFSETS` names, as JSON, the libraries and where in each of them CPUID stands. Behind each
of these instructions the bits of AVX-512, VNNI, AMX and their kin are cleared in the answer. Libraries ask when they
are loaded, so nothing of this costs time afterwards. `CPUID_REPORT` is where it writes how the process ended.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import gdb

OFFSETS = json.loads(os.environ["CPUID_OFFSETS"])
LENGTH = 2  # bytes of the instruction
# Bits to clear in eax, ebx, ecx and edx, by leaf and subleaf (Intel's manual, volume 2, CPUID).
HIDDEN = {
    (7, 0): {
        "ebx": (16, 17, 21, 26, 27, 28, 30, 31),  # AVX-512 F, DQ, IFMA, PF, ER, CD, BW, VL
        "ecx": (1, 6, 11, 12, 14),  # AVX-512 VBMI, VBMI2, VNNI, BITALG, VPOPCNTDQ
        "edx": (2, 3, 8, 22, 23, 24, 25),  # AVX-512 4VNNIW, 4FMAPS, VP2INTERSECT, FP16; AMX BF16, TILE, INT8
    },
    (7, 1): {"eax": (4, 5, 21, 23), "edx": (4, 5, 8, 10, 19)},  # AVX-VNNI, BF16, AVX-IFMA, AVX-VNNI-INT, AVX10
}
ALL = 0xFFFFFFFF

asked: dict[int, tuple[int, int]] = {}  # leaf and subleaf, by thread
answers: dict[str, int] = {}  # how often an answer was changed, by library


def register(name: str) -> int:
    """Return the lower half of a register."""
    return int(gdb.selected_frame().read_register(name)) & ALL


class Question(gdb.Breakpoint):
    """Stands at an instruction and remembers what is asked."""

    def stop(self) -> bool:
        """Let the process go on."""
        asked[gdb.selected_thread().num] = register("rax"), register("rcx")
        return False


class Answer(gdb.Breakpoint):
    """Stands behind an instruction and changes the answer."""

    library = ""

    def stop(self) -> bool:
        """Let the process go on."""
        for name, bits in HIDDEN.get(asked[gdb.selected_thread().num], {}).items():
            full = f"r{name[1:]}"
            kept = register(full) & ~sum(1 << bit for bit in bits) & ALL
            gdb.execute(f"set ${full} = {kept}")
            answers[self.library] = answers.get(self.library, 0) + 1
        return False


def loaded(event: gdb.NewObjFileEvent) -> None:
    """Set the breakpoints of a library before anything in it runs."""
    library = Path(event.new_objfile.filename).name
    if library not in OFFSETS:
        return
    maps = Path(f"/proc/{gdb.selected_inferior().pid}/maps").read_text().splitlines()
    base = int(next(line for line in maps if line.endswith("/" + library)).split("-")[0], 16)
    for offset in OFFSETS[library]:
        Question(f"*{base + offset:#x}")
        Answer(f"*{base + offset + LENGTH:#x}").library = library


gdb.events.new_objfile.connect(loaded)
for setting in ("pagination off", "debuginfod enabled off", "print thread-events off", "print inferior-events off"):
    gdb.execute(f"set {setting}")
gdb.execute("run", to_string=True)
status = gdb.convenience_variable("_exitcode")
report = {"status": None if status is None else int(status), "answers": answers}
Path(os.environ["CPUID_REPORT"]).write_text(json.dumps(report))
