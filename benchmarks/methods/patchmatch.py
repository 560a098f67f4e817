"""PatchMatch stereo (Bleyer et al., BMVC 2011): builds the compiled matcher where it runs, and calls it."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from endosdk.errors import DependencyMissing, InvalidArgument

SOURCE = Path(__file__).parent / "patchmatch"
BUILD = Path(__file__).resolve().parents[2] / "build" / "patchmatch"

View = npt.NDArray[np.uint8]
FloatMap = npt.NDArray[np.float32]


@dataclass(frozen=True)
class PatchMatchSettings:
    """What the paper leaves to the user; radius 17 and three rounds are its choice."""

    max_disparity: int = 72
    radius: int = 17
    rounds: int = 3
    threads: int = len(os.sched_getaffinity(0))
    seed: int = 1


class _Settings(ctypes.Structure):
    _fields_ = (
        ("max_disparity", ctypes.c_int),
        ("radius", ctypes.c_int),
        ("rounds", ctypes.c_int),
        ("threads", ctypes.c_int),
        ("seed", ctypes.c_uint64),
    )


def cmake_program() -> str | None:
    """Return the cmake on the path, or the one installed beside this interpreter."""
    return shutil.which("cmake") or shutil.which("cmake", path=str(Path(sys.executable).parent))


@cache
def library() -> ctypes.CDLL:
    """Build the matcher if it is out of date, and load it."""
    print("building PatchMatch", file=sys.stderr)
    return built_in(BUILD)


def built_in(folder: Path, *options: str) -> ctypes.CDLL:
    """Build the matcher in a folder, with further options for cmake, and load it."""
    cmake = cmake_program()
    if cmake is None:
        raise DependencyMissing("patchmatch", "needs cmake and a C++20 compiler", "no cmake")
    try:
        for words in (
            [cmake, "-S", str(SOURCE), "-B", str(folder), "-DCMAKE_BUILD_TYPE=Release", *options],
            [cmake, "--build", str(folder)],
        ):
            subprocess.run(words, check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        raise DependencyMissing("patchmatch", "must build", error.stderr or error.stdout) from error
    loaded = ctypes.CDLL(str(folder / "libendosdk_patchmatch.so"))
    loaded.patchmatch_compute.restype = None
    loaded.patchmatch_fill.restype = None
    loaded.patchmatch_cost.restype = ctypes.c_float
    return loaded


def match(left: View, right: View, settings: PatchMatchSettings | None = None) -> tuple[FloatMap, FloatMap]:
    """Disparity, px, float32 [H, W] of an RGB pair [H, W, 3]: where both views agree (else NaN), and filled."""
    s = settings or PatchMatchSettings()
    if left.ndim != 3 or left.shape[2] != 3 or left.shape != right.shape or left.dtype != np.uint8:
        raise InvalidArgument("left", "must be uint8 [H, W, 3] like right", (left.dtype, left.shape, right.shape))
    if not 1 <= s.radius <= 31:
        raise InvalidArgument("radius", "must be 1 to 31 px", s.radius)
    if left.shape[1] < 2:
        raise InvalidArgument("left", "must be at least two columns wide", left.shape)
    height, width = left.shape[:2]
    checked, filled = np.empty((2, height, width), np.float32)
    numbers = _Settings(s.max_disparity, s.radius, s.rounds, s.threads, s.seed)
    pair = [np.ascontiguousarray(view) for view in (left, right)]
    library().patchmatch_compute(
        *(pointer(view) for view in pair), height, width, ctypes.byref(numbers), pointer(checked), pointer(filled)
    )
    return checked, filled


def pointer(array: npt.NDArray[np.generic]) -> ctypes.c_void_p:
    """Return the address of a contiguous array; the caller keeps the array alive."""
    return ctypes.c_void_p(array.ctypes.data)
