"""Bad input: the tests that feed it to each interface, and what spoilt files and fuzzing found."""

from __future__ import annotations

import re

from benchmarks.tables import records
from benchmarks.tables.markdown import table
from benchmarks.tables.records import SOURCES

ATTACKS = {  # files of tests that feed each interface what is bad
    "Python": sorted((SOURCES / "tests" / "hardening").glob("test_*.py")),
    "C": [
        *(SOURCES / "cpp/tests/library" / f"test_{name}.cpp" for name in ("refusals", "models", "streams")),
        *(SOURCES / "cpp/tests/library" / f"test_{name}.cpp" for name in ("allocation", "resources", "stack")),
        *(SOURCES / "tests/c_library" / f"test_{name}.py" for name in ("errors", "same_refusals", "fork")),
    ],
}


def spoilt_files_table() -> str:
    """Every reader of strangers' files: spoilt ones tried, how many were read, refused by which code, anything else."""
    rows = []
    record = records.read("studies/spoilt_files")
    for name, reader in record["readers"].items():
        outcomes = dict(reader["outcomes"])
        read = outcomes.pop("read", 0)
        untyped = sum(outcomes.pop(kind) for kind in list(outcomes) if kind.startswith("untyped"))
        refused = ", ".join(f"{count} {code}" for code, count in outcomes.items())
        rows.append([name, str(reader["tried"]), str(read), refused, str(untyped), f"{reader['slowest_s']:.2f}"])
    heads = ["file", "tried", "still valid, read", "rejected with a typed error", "anything else", "slowest, s"]
    return table(heads, rows) + _made_at(record["machine"])


def fuzzed_table() -> str:
    """What libFuzzer has tried on the C library."""
    labels = {
        "model": "model file",
        "calibration": "rig",
        "rig_file": "rig file",
        "frame": "pair of frames, with strides and formats",
    }
    record = records.read("speed/c_library")["fuzz"]
    rows = [
        [labels[name], f"{one['inputs']:,}", f"{one['edges_reached']:,}", str(one["failures"])]
        for name, one in record["result"].items()
    ]
    return table(["input", "tried", "branches reached", "crashes, hangs, reports"], rows) + _made_at(record["machine"])


def _made_at(machine: dict[str, str]) -> str:
    """Say of which commit a count is: code that was changed since then may differ."""
    commit, _, changed = machine["commit"].partition("+")
    return f"\nRun on {machine['date'][:10]}, at commit `{commit}`{' with changes' if changed else ''}.\n"


def attacks_table() -> str:
    """Every file of tests of bad input: what it tries, in its own words, and how many tests it has."""
    rows = []
    for interface, files in ATTACKS.items():
        counts = [len(tests_in(file.read_text())) for file in files]
        for file, count in zip(files, counts, strict=True):
            tries = file.read_text().partition("\n")[0].strip('/" ')
            rows.append([interface, f"`{file.relative_to(SOURCES)}`", tries, str(count)])
        rows.append([f"**{interface}, together**", "", "", f"**{sum(counts)}**"])
    return table(["interface", "file", "what it tries", "tests"], rows)


def tests_in(text: str) -> set[str]:
    """Return the test functions of a Python file, or those that the main function of a C++ program calls."""
    program, _, main = text.partition("int main(")
    called = set(re.findall(r"\w+", main))
    return set(re.findall(r"^def (test_\w+)", text, re.MULTILINE)) | {
        name for name in re.findall(r"^void (\w+)\(", program, re.MULTILINE) if name in called
    }
