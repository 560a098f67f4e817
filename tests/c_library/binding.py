"""libendosdk through ctypes: built once per test session, its structs, and one pair in and maps out."""

from __future__ import annotations

import ctypes
import fcntl
import importlib.util
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator, Sequence
from ctypes import (
    POINTER,
    Structure,
    byref,
    c_char,
    c_char_p,
    c_double,
    c_int32,
    c_int64,
    c_size_t,
    c_uint32,
    c_uint64,
    c_void_p,
)
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from endosdk import StereoCalibration
from tests.conftest import ROOT

# The environment's own CMake and Ninja serve where the system has none.
os.environ["PATH"] = os.pathsep.join([os.environ["PATH"], str(Path(sys.executable).parent)])

HEADER = ROOT / "cpp" / "include" / "endosdk" / "endosdk.h"
BUILD = ROOT / "build" / "release"  # of the preset that vendors use
FORMATS = {"rgb": 0, "bgr": 1, "gray": 2}


class Options(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("threads", c_int32),
        ("spinning", c_int32),
        ("log_level", c_int32),
        ("provider", c_char_p),
        ("runtime_library", c_char_p),
        ("model_sha256", c_char_p),
        ("log", c_void_p),
        ("log_context", c_void_p),
        ("network_width", c_int32),
        ("network_height", c_int32),
        ("min_confidence", c_double),
        ("min_depth_mm", c_double),
        ("max_depth_mm", c_double),
        ("depth_unit_mm", c_double),
        ("deadline_ms", c_double),
        ("float32_model", c_char_p),
        ("float32_model_sha256", c_char_p),
        ("provider_options", POINTER(c_char_p)),
        ("runtime_sha256", c_char_p),
        ("max_age_ms", c_double),
        ("public_key", c_char_p),
        ("public_key_size", c_size_t),
        ("signature", c_char_p),
        ("signature_size", c_size_t),
        ("float32_model_signature", c_char_p),
        ("float32_model_signature_size", c_size_t),
        ("crypto_library", c_char_p),
        ("thread_started", c_void_p),
        ("thread_context", c_void_p),
    ]


def texts(*values: str) -> Any:
    """An array of texts that ends with NULL."""
    return (c_char_p * (len(values) + 1))(*(value.encode() for value in values), None)


class Calibration(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("camera_model", c_int32),
        ("width", c_int32),
        ("height", c_int32),
        ("left_distortion_count", c_int32),
        ("right_distortion_count", c_int32),
        ("left_matrix", c_double * 9),
        ("right_matrix", c_double * 9),
        ("left_distortion", c_double * 8),
        ("right_distortion", c_double * 8),
        ("rotation", c_double * 9),
        ("translation", c_double * 3),
        ("left_field_of_view", c_double * 4),
        ("right_field_of_view", c_double * 4),
    ]

    @classmethod
    def of(cls, rig: StereoCalibration) -> Calibration:
        """The numbers of a Python calibration."""
        numbers = cls(
            struct_size=ctypes.sizeof(cls),
            camera_model=int(rig.model == "fisheye"),
            width=rig.width,
            height=rig.height,
            left_distortion_count=rig.left_distortion.size,
            right_distortion_count=rig.right_distortion.size,
        )
        for name in ("left_matrix", "right_matrix", "left_distortion", "right_distortion", "rotation", "translation"):
            for i, value in enumerate(getattr(rig, name).ravel()):
                getattr(numbers, name)[i] = value
        for name in ("left_field_of_view", "right_field_of_view"):
            getattr(numbers, name)[:] = getattr(rig, name) or (0, 0, 0, 0)
        return numbers


class Geometry(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("rectifies", c_int32),
        ("focal_px", c_double),
        ("baseline_mm", c_double),
        ("cx", c_double),
        ("cy", c_double),
        ("doffs", c_double),
        ("focal_y_px", c_double),
    ]


class Image(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("format", c_int32),
        ("data", c_void_p),
        ("width", c_int32),
        ("height", c_int32),
        ("stride", c_int64),
    ]

    @classmethod
    def of(cls, frame: np.ndarray, order: str = "rgb") -> Image:
        """A view of a picture [H, W, 3] or [H, W] of any row pitch; the array must outlive it."""
        format = FORMATS["gray" if frame.ndim == 2 else order]
        return cls(ctypes.sizeof(cls), format, frame.ctypes.data, frame.shape[1], frame.shape[0], frame.strides[0])


ROTATIONS = ("rotation_deg", "rotation_se_deg", "steady_rotation_deg", "steady_rotation_se_deg", "corrected_deg")

MAPS = {
    "disparity": np.float32,
    "confidence": np.float32,
    "depth": np.float32,
    "sigma": np.float32,
    "reasons": np.uint8,
    "disparity_u16": np.uint16,
    "depth_u16": np.uint16,
}


class Identity(Structure):
    _fields_ = [
        ("endosdk", c_char * 16),
        ("model", c_char * 104),
        ("model_version", c_char * 32),
        ("model_sha256", c_char * 72),
        ("calibration_sha256", c_char * 72),
        ("runtime", c_char * 32),
        ("runtime_sha256", c_char * 72),
        ("provider", c_char * 40),
        ("device", c_char * 72),
    ]


class Result(Structure):
    _fields_ = [
        ("struct_size", c_uint32),
        ("quality", c_int32),
        ("capacity", c_uint64),
        *((name, c_void_p) for name in MAPS),
        ("frame", c_uint64),
        ("valid_share", c_double),
        ("rectify_ms", c_double),
        ("session_ms", c_double),
        ("postprocess_ms", c_double),
        ("late", c_int32),
        ("reserved", c_int32),
        ("causes", c_uint64),
        ("measures", c_double * 32),
        ("vertical_disparity_px", c_double),
        ("vertical_disparity_se_px", c_double),
        *((name, c_double * 3) for name in ROTATIONS),
        ("drifted", c_int32),
        ("reserved2", c_int32),
        ("stamp_ns", c_int64),
        ("age_ms", c_double),
        ("identity", Identity),
    ]


SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "endo_version": (c_char_p, []),
    "endo_build_info": (c_char_p, []),
    "endo_status_name": (c_char_p, [c_int32]),
    "endo_cause_name": (c_char_p, [c_int32]),
    "endo_last_error": (c_char_p, []),
    "endo_options_init": (c_int32, [POINTER(Options), c_size_t]),
    "endo_open_file": (c_int32, [c_char_p, POINTER(Options), POINTER(c_void_p)]),
    "endo_open_memory": (c_int32, [c_char_p, c_size_t, POINTER(Options), POINTER(c_void_p)]),
    "endo_close": (None, [c_void_p]),
    "endo_set_calibration": (c_int32, [c_void_p, POINTER(Calibration)]),
    "endo_read_calibration": (c_int32, [c_char_p, c_size_t, POINTER(Calibration)]),
    "endo_get_geometry": (c_int32, [c_void_p, POINTER(Geometry)]),
    "endo_prepare": (c_int32, [c_void_p, c_int32, c_int32]),
    "endo_predict": (c_int32, [c_void_p, POINTER(Image), POINTER(Image), POINTER(Result)]),
    "endo_rectify": (c_int32, [c_void_p, POINTER(Image), POINTER(Image), c_void_p, c_void_p, c_size_t]),
    "endo_get_rectified": (c_int32, [c_void_p, c_void_p, c_void_p, c_size_t]),
    "endo_cancel": (c_int32, [c_void_p]),
    "endo_stream_open": (c_int32, [c_void_p, c_int32, c_int32, POINTER(c_int32), POINTER(c_void_p)]),
    "endo_stream_set_temporal": (c_int32, [c_void_p, c_int32]),
    "endo_stream_submit": (c_int32, [c_void_p, POINTER(Image), POINTER(Image), POINTER(Result)]),
    "endo_stream_receive": (c_int32, [c_void_p, POINTER(POINTER(Result))]),
    "endo_stream_wait": (c_int32, [c_void_p, c_double, POINTER(c_int32)]),
    "endo_stream_end": (c_int32, [c_void_p]),
    "endo_stream_follow_rig": (c_int32, [c_void_p]),
    "endo_stream_close": (None, [c_void_p]),
    "endo_point_at": (c_int32, [POINTER(Calibration), POINTER(Result), c_double, c_double, c_void_p]),
    "endo_path_length": (c_int32, [POINTER(Calibration), POINTER(Result), c_void_p, c_size_t, c_void_p]),
    "endo_area_inside": (c_int32, [POINTER(Calibration), POINTER(Result), c_void_p, c_size_t, c_void_p]),
    "endo_get_rectification": (c_int32, [POINTER(Calibration), c_double, c_void_p]),
    "endo_raw_to_rectified": (c_int32, [POINTER(Calibration), c_double, c_int32, c_void_p, c_size_t, c_void_p]),
    "endo_rectified_to_raw": (c_int32, [POINTER(Calibration), c_double, c_int32, c_void_p, c_size_t, c_void_p]),
    "endo_to_raw_left": (c_int32, [POINTER(Calibration), c_void_p, c_size_t, c_void_p]),
    "endo_self_test": (c_int32, [c_void_p]),
    "endo_get_diagnostics": (c_int32, [c_void_p, c_char_p, c_size_t, POINTER(c_size_t)]),
}


def runtime_library() -> Path:
    """The library of the onnxruntime package that Python uses."""
    spec = importlib.util.find_spec("onnxruntime")
    assert spec is not None and spec.origin is not None
    return next((Path(spec.origin).parent / "capi").glob("libonnxruntime.so.*"))


def cmake(*arguments: str | Path) -> str:
    """Run CMake and return what it printed; a failure shows all of it."""
    done = subprocess.run(["cmake", *map(str, arguments)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"cmake {' '.join(map(str, arguments))}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
    return done.stdout


def configure(folder: Path, *options: str) -> None:
    """Configure the C++ part of the project into ``folder``; skip where its one foreign header cannot be had."""
    if shutil.which("cmake") is None:
        pytest.skip("no CMake (Debian: apt-get install cmake)")
    generator = ["-G", "Ninja"] if shutil.which("ninja") else []
    done = subprocess.run(
        ["cmake", "-S", str(ROOT), "-B", str(folder), *generator, *options], capture_output=True, text=True, check=False
    )
    if "No headers of ONNX Runtime" in done.stderr:
        pytest.skip("the headers of ONNX Runtime are not here and cannot be fetched: see docs/c-library.md")
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]


def build(folder: Path, *options: str, targets: Sequence[str] = ("all",)) -> None:
    """Configure and build; tests inside the folder open this environment's runtime."""
    folder.parent.mkdir(exist_ok=True)
    with folder.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another worker may want the same; the second finds it done
        configure(folder, f"-DENDOSDK_TEST_RUNTIME={runtime_library()}", *options)
        cmake("--build", folder, "--parallel", "--target", *targets)


def load(path: Path) -> ctypes.CDLL:
    """Open the library and declare its functions."""
    library = ctypes.CDLL(str(path))
    for name, (result, arguments) in SIGNATURES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    return library


class CEstimator:
    """One estimator of the C library. Calls that fail raise `CError`; ``close`` frees it."""

    def __init__(
        self, library: ctypes.CDLL, model: Path | bytes, rig: StereoCalibration | None = None, **options: Any
    ) -> None:
        self.library = library
        self.handle = c_void_p()
        settings = Options()
        self._check(library.endo_options_init(byref(settings), ctypes.sizeof(settings)))
        settings.runtime_library = os.fsencode(runtime_library())
        for name, value in options.items():
            setattr(settings, name, value)
        self._keep = settings  # the log function must live as long as the estimator
        if isinstance(model, bytes):
            status = library.endo_open_memory(model, len(model), byref(settings), byref(self.handle))
        else:
            status = library.endo_open_file(os.fsencode(model), byref(settings), byref(self.handle))
        self._check(status)
        if rig is not None:
            self.set_calibration(rig)

    def set_calibration(self, rig: StereoCalibration | Calibration | None) -> None:
        """Set a Python calibration, numbers, or none."""
        numbers = Calibration.of(rig) if isinstance(rig, StereoCalibration) else rig
        self._check(self.library.endo_set_calibration(self.handle, None if numbers is None else byref(numbers)))

    def geometry(self) -> Geometry:
        """Geometry of the rectified pair."""
        geometry = Geometry(struct_size=ctypes.sizeof(Geometry))
        self._check(self.library.endo_get_geometry(self.handle, byref(geometry)))
        return geometry

    def predict(
        self,
        left: np.ndarray,
        right: np.ndarray,
        order: str = "rgb",
        maps: tuple[str, ...] = tuple(MAPS),
        stamp_ns: int = 0,
        room: tuple[Result, dict[str, np.ndarray]] | None = None,
    ) -> tuple[Result, dict[str, np.ndarray]]:
        """Maps of one pair by name, in the room of an earlier answer where that is given."""
        result, arrays = room or self._room(left, maps)
        result.stamp_ns = stamp_ns
        views = Image.of(left, order), Image.of(right, order)
        self._check(self.library.endo_predict(self.handle, byref(views[0]), byref(views[1]), byref(result)))
        return result, arrays

    def stream(
        self,
        pairs: Iterable[tuple[np.ndarray, np.ndarray]],
        maps: tuple[str, ...] = tuple(MAPS),
        temporal: bool = False,
    ) -> Iterator[tuple[Result, dict[str, np.ndarray]]]:
        """Maps of every pair in order, in a ring of as many as can be in flight and two more."""
        source = iter(pairs)
        first = next(source)
        height, width = first[0].shape[:2]
        stream, flight = c_void_p(), c_int32()
        opened = self.library.endo_stream_open(self.handle, width, height, byref(flight), byref(stream))
        self._check(opened)
        self._check(self.library.endo_stream_set_temporal(stream, int(temporal)))
        ring = [self._room(first[0], maps) for _ in range(flight.value + 2)]
        free = threading.Semaphore(len(ring) - 1)  # the caller still looks at the latest

        def submit() -> None:
            for number, (left, right) in enumerate(chain([first], source)):
                free.acquire()
                views = Image.of(left), Image.of(right)
                result = ring[number % len(ring)][0]
                self.library.endo_stream_submit(stream, byref(views[0]), byref(views[1]), byref(result))
            self.library.endo_stream_end(stream)

        feeding = threading.Thread(target=submit, daemon=True)
        feeding.start()
        received = POINTER(Result)()
        for number in count():
            self._check(self.library.endo_stream_receive(stream, byref(received)))
            if not received:
                break
            yield ring[number % len(ring)]
            free.release()
        feeding.join()
        self.library.endo_stream_close(stream)

    def _room(self, frame: np.ndarray, maps: tuple[str, ...]) -> tuple[Result, dict[str, np.ndarray]]:
        height, width = frame.shape[:2]
        arrays = {name: np.empty((height, width), MAPS[name]) for name in maps}
        result = Result(struct_size=ctypes.sizeof(Result), capacity=height * width)
        for name, array in arrays.items():
            setattr(result, name, array.ctypes.data)
        return result, arrays

    def diagnostics(self) -> bytes:
        """The report as JSON."""
        needed = c_size_t()
        self._check(self.library.endo_get_diagnostics(self.handle, None, 0, byref(needed)))
        buffer = ctypes.create_string_buffer(needed.value)
        self._check(self.library.endo_get_diagnostics(self.handle, buffer, needed.value, None))
        return buffer.value

    def self_test(self) -> None:
        """Run the built-in pair."""
        self._check(self.library.endo_self_test(self.handle))

    def close(self) -> None:
        """Free the estimator."""
        self.library.endo_close(self.handle)
        self.handle = c_void_p()

    def _check(self, status: int) -> None:
        if status != 0:
            raise CError(status, self.library)


class CError(Exception):
    """A failed call: its status and the text that belongs to it."""

    def __init__(self, status: int, library: ctypes.CDLL) -> None:
        self.name = library.endo_status_name(status).decode()
        super().__init__(library.endo_last_error().decode())
