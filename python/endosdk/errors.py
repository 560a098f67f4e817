"""Every error endosdk raises: a stable code, the argument, the rule and the value seen.

Each class also derives from the built-in exception that fits, so ``except ValueError`` keeps working. The numbers
are the status codes of the C library; they are appended to, never reused.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import IntEnum


class ErrorCode(IntEnum):
    """Stable numbers shared by Python and C."""

    OK = 0
    INVALID_ARGUMENT = 1
    INVALID_CALIBRATION = 2
    CALIBRATION_REQUIRED = 3
    CALIBRATION_SIZE_MISMATCH = 4
    CALIBRATION_UNREADABLE = 5
    MODEL_NOT_FOUND = 6
    MODEL_UNREADABLE = 7
    MODEL_METADATA = 8
    MODEL_HASH_MISMATCH = 9
    RUNTIME_MISSING = 10
    RUNTIME_CONFLICT = 11
    PROVIDER_UNAVAILABLE = 12
    INFERENCE_FAILED = 13
    DATASET_INVALID = 14
    DEPENDENCY_MISSING = 15
    RENDERER_UNAVAILABLE = 16
    STORAGE_FAILED = 17
    CANCELLED = 18
    OUT_OF_MEMORY = 19
    SELF_TEST_FAILED = 20
    INTERNAL = 21
    # Only Python raises this one.
    SOURCE_FAILED = 22
    # Python and C share what follows.
    RUNTIME_HASH_MISMATCH = 23


class EndoError(Exception):
    """Base of all errors of this package.

    ``code`` is an `ErrorCode`, ``argument`` the name of what was wrong, ``rule`` what it must satisfy, ``value`` what
    was seen instead. Where no argument was wrong, ``argument`` is empty and ``rule`` says what happened.
    """

    code: ErrorCode = ErrorCode.INVALID_ARGUMENT

    def __init__(self, argument: str, rule: str, value: object) -> None:
        self.argument = argument
        self.rule = rule
        self.value = value
        said = f"{argument}: {rule}; got {_shortened(value)}" if argument else rule
        super().__init__(f"{said} [{self.code.name}]")

    def __reduce__(self) -> tuple[type[EndoError], tuple[str, str, object]]:
        """Keep the three parts when the error crosses a process boundary."""
        return type(self), (self.argument, self.rule, self.value)


# What was seen may come from a file that somebody else made. It must fit a log line and a terminal.
LONGEST_VALUE = 400


def _shortened(value: object) -> str:
    text = str(value)
    middle = f" ... ({len(text)} characters) ... "
    half = LONGEST_VALUE // 2
    return text if len(text) <= LONGEST_VALUE + len(middle) else text[:half] + middle + text[-half:]


class InvalidArgument(EndoError, ValueError):
    """An argument has the wrong type, shape, size or range. Correct the argument that the error names."""


class InvalidCalibration(EndoError, ValueError):
    """The numbers of a calibration cannot describe a stereo rig.

    Calibrate again, or correct the field that the error names.
    """

    code = ErrorCode.INVALID_CALIBRATION


class CalibrationRequired(EndoError, RuntimeError):
    """Metric output was asked for without a calibration. Give a calibration, or do not ask for depth."""

    code = ErrorCode.CALIBRATION_REQUIRED


class CalibrationSizeMismatch(EndoError, ValueError):
    """The calibration belongs to another image size.

    Use frames of the calibrated size, or `StereoCalibration.scaled`.
    """

    code = ErrorCode.CALIBRATION_SIZE_MISMATCH


class CalibrationUnreadable(EndoError, ValueError):
    """A calibration file is missing, broken or in no known layout. Check the path and the layout of the file."""

    code = ErrorCode.CALIBRATION_UNREADABLE


class ModelNotFound(EndoError, FileNotFoundError):
    """No shipped model has this name and no file has this path.

    Use a name that `endosdk doctor` lists, or the path of a file.
    """

    code = ErrorCode.MODEL_NOT_FOUND


class ModelUnreadable(EndoError, ValueError):
    """The bytes are not an ONNX model that the runtime accepts.

    Copy the file again: it is damaged, or no ONNX model.
    """

    code = ErrorCode.MODEL_UNREADABLE


class ModelMetadata(EndoError, ValueError):
    """The model lacks, or contradicts, what its metadata must say. Export the model with `endosdk export`."""

    code = ErrorCode.MODEL_METADATA


class ModelHashMismatch(EndoError, ValueError):
    """The bytes of a model are not those that were released or pinned.

    Install the package again, or correct the hash that you pinned.
    """

    code = ErrorCode.MODEL_HASH_MISMATCH


class RuntimeMissing(EndoError, ImportError):
    """No onnxruntime is installed. Run the command that the error names."""

    code = ErrorCode.RUNTIME_MISSING


class RuntimeConflict(EndoError, ImportError):
    """onnxruntime and onnxruntime-gpu are installed over each other. Uninstall both, then install one of them."""

    code = ErrorCode.RUNTIME_CONFLICT


class RuntimeHashMismatch(EndoError, ValueError):
    """The file of ONNX Runtime is not the one that was pinned. Use the file that you pinned, or pin this one."""

    code = ErrorCode.RUNTIME_HASH_MISMATCH


class ProviderUnavailable(EndoError, RuntimeError):
    """The execution provider that was asked for is not there.

    Install an ONNX Runtime that has it, or choose another provider.
    """

    code = ErrorCode.PROVIDER_UNAVAILABLE


class InferenceFailed(EndoError, RuntimeError):
    """The runtime reported an error while running the model. Read the rule: it holds the message of ONNX Runtime."""

    code = ErrorCode.INFERENCE_FAILED


class DatasetInvalid(EndoError, ValueError):
    """A data set on disk does not follow its layout. Render or download the data set again."""

    code = ErrorCode.DATASET_INVALID


class DependencyMissing(EndoError, ImportError):
    """An optional dependency is not installed; the rule names the command that installs it.

    Run the command that the error names.
    """

    code = ErrorCode.DEPENDENCY_MISSING


class RendererUnavailable(EndoError, RuntimeError):
    """The renderer cannot start on this machine; the rule says what it needs. Install what the error names."""

    code = ErrorCode.RENDERER_UNAVAILABLE


class StorageFailed(EndoError, OSError):
    """A file could not be written: full disk, read-only folder. Free some space, or choose another folder."""

    code = ErrorCode.STORAGE_FAILED


class SourceFailed(EndoError, OSError):
    """A source of frames cannot be read, or not any further: a broken video, a camera that is gone.

    Check the camera, the cable or the file.
    """

    code = ErrorCode.SOURCE_FAILED


class Cancelled(EndoError, RuntimeError):
    """Another thread cancelled the call. Call again."""

    code = ErrorCode.CANCELLED


class OutOfMemory(EndoError, MemoryError):
    """Memory, or the number of threads this process may have, is used up.

    Use fewer threads or smaller frames, or raise the limits of the process.
    """

    code = ErrorCode.OUT_OF_MEMORY


@contextmanager
def typed_memory_errors() -> Iterator[None]:
    """Give a MemoryError of Python or NumPy its code; also a decorator of functions, but not of generators."""
    try:
        yield
    except EndoError:
        raise
    except MemoryError as error:
        raise OutOfMemory("", "out of memory", "") from error


class SelfTestFailed(EndoError, RuntimeError):
    """The model does not give the known answer of a built-in pair.

    Do not use this installation. Install it again, and report the error if it stays.
    """

    code = ErrorCode.SELF_TEST_FAILED


class InternalError(EndoError, RuntimeError):
    """A bug in endosdk. Please report it with `DepthEstimator.diagnostics()`."""

    code = ErrorCode.INTERNAL


def error_of(code: int, argument: str, rule: str, value: object) -> EndoError:
    """Return the error that has this code, as the compiled core reports it."""
    kinds = {kind.code: kind for kind in EndoError.__subclasses__()}
    return kinds.get(ErrorCode(code), InternalError)(argument, rule, value)
