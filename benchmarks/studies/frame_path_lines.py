"""Lines of the frame path, before and after there was one for Python and C.

    python -m benchmarks.studies.frame_path_lines

Counts every line of the files named below, at the last commit with two frame paths and as they are committed now.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BEFORE = "28f885b"
C_LIBRARY = "capi capi_structs runtime session_interface status"
FRAME_PATH = "depth estimator latency network_size rectify_stage self_test session"
MAPS = "agreement glare_rows guided maps postprocess"
PATHS_BEFORE = {
    "python": [
        f"python/endosdk/{name}.py"
        for name in "estimator estimator_rules postprocess rectify result session stream".split()
    ],
    "cpp": [f"cpp/src/{name}.[ch]pp" for name in f"{FRAME_PATH} {MAPS} {C_LIBRARY}".split()],
    "binding": ["cpp/python/*.cpp", "cpp/python/*.hpp"],
}
PATHS_AFTER = {
    "python": [
        f"python/endosdk/runtime/{name}.py" for name in "arguments estimator maps rectify result session stream".split()
    ],
    "cpp": ["cpp/src/frame_path/*", "cpp/src/maps/*", "cpp/src/library/*.[ch]pp"],
    "binding": ["cpp/python/*.cpp", "cpp/python/*.hpp"],
}


def lines_of(commit: str, paths: list[str]) -> int:
    """Return how many lines the files have at a commit."""
    # The empty pattern matches every line; --count gives "commit:file:lines".
    command = ["git", "grep", "--count", "-e", "", commit, "--", *(f":(glob){path}" for path in paths)]
    counts = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()
    return sum(int(line.rpartition(":")[2]) for line in counts)


def main() -> None:
    """Run from the command line."""
    found = {
        label: {part: lines_of(commit, files) for part, files in paths.items()}
        for label, commit, paths in (("before", BEFORE, PATHS_BEFORE), ("after", "HEAD", PATHS_AFTER))
    }
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
