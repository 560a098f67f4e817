"""Run a stereo model. The only file of the run time that knows onnxruntime."""

from __future__ import annotations

import importlib.metadata
import warnings
from typing import Any

import numpy as np

from endosdk.errors import (
    InferenceFailed,
    InvalidArgument,
    ModelMetadata,
    ModelUnreadable,
    ProviderUnavailable,
    RuntimeConflict,
    RuntimeMissing,
)
from endosdk.runtime import telemetry
from endosdk.runtime.models import ModelFile, ModelInfo, parse_metadata

PROVIDERS = {
    "cpu": "CPUExecutionProvider",
    "cuda": "CUDAExecutionProvider",
    "tensorrt": "TensorrtExecutionProvider",
}

# Where the runtime may look for weights that a model keeps in another file: in no folder that can exist. The hash of a
# model would not cover them, and they would be read from whatever directory is the current one.
NO_FOLDER = "/dev/null/weights outside the model"


def load_runtime() -> Any:
    """Import onnxruntime with its telemetry off, or say which extra is missing or in conflict."""
    installed = [name for name in ("onnxruntime", "onnxruntime-gpu") if _is_installed(name)]
    if len(installed) == 2:
        raise RuntimeConflict(
            "onnxruntime",
            "only one runtime may be installed: uninstall both, then install endosdk[cpu] or endosdk[gpu]",
            " and ".join(installed),
        )
    telemetry.disable()
    try:
        import onnxruntime
    except ImportError as error:
        raise RuntimeMissing(
            "onnxruntime", "install the extra: pip install 'endosdk[cpu]' or 'endosdk[gpu]'", str(error)
        ) from error
    if telemetry.started_by_host():
        warnings.warn(
            "onnxruntime was imported before endosdk with its telemetry on; import endosdk first or set "
            f"{telemetry.VARIABLE}=1 in the environment",
            RuntimeWarning,
            stacklevel=2,
        )
    return onnxruntime


class Buffers:
    """The memory that one run reads and writes, bound to its session.

    Write planar RGB into ``left`` and ``right``, uint8 [3, H, W]; after the run read ``disparity`` and ``confidence``,
    float32 [H / stride, W / stride].
    """

    def __init__(self, binding: Any, height: int, width: int, stride: int) -> None:
        # Zeros, not empty: the memory is touched here, so that the first frame does not pay for it.
        self.left = np.zeros((3, height, width), np.uint8)
        self.right = np.zeros((3, height, width), np.uint8)
        self.disparity = np.zeros((height // stride, width // stride), np.float32)
        self.confidence = np.zeros_like(self.disparity)
        self.binding = binding
        for name, array in (("left", self.left), ("right", self.right)):
            binding.bind_input(name, "cpu", 0, np.uint8, (1, *array.shape), array.ctypes.data)
        for name, output in (("disparity", self.disparity), ("confidence", self.confidence)):
            binding.bind_output(name, "cpu", 0, np.float32, (1, 1, *output.shape), output.ctypes.data)


class StereoSession:
    """One loaded model and the call that runs it on `Buffers`; runs on different buffers may overlap."""

    def __init__(self, model: ModelFile, *, provider: str = "cpu", threads: int = 0, spinning: bool = True) -> None:
        runtime = load_runtime()
        self._model, self._threads = model, threads
        self.runtime_version: str = runtime.__version__
        self.provider = _installed(provider_name(provider), runtime.get_available_providers())
        options = _session_options(runtime, self.provider, threads, spinning)
        try:
            self._session = runtime.InferenceSession(model.data, options, providers=[self.provider])
        except Exception as error:  # the runtime has its own exception types, one per status code, with no common base
            if NO_FOLDER in str(error) or "external" in str(error).lower():  # its words differ from case to case
                raise ModelMetadata("model", f"{model.origin} must hold its weights itself", error) from error
            raise ModelUnreadable("model", f"{model.origin} must be an ONNX file that runs here", error) from error
        used = self._session.get_providers()
        if used[0] != self.provider:
            raise ProviderUnavailable("provider", f"{self.provider} must start on this machine", ", ".join(used))
        self.info: ModelInfo = parse_metadata(self._session.get_modelmeta().custom_metadata_map, model.sha256)
        _check_interface(self._session)

    def buffers(self, height: int, width: int) -> Buffers:
        """Allocate and bind memory for inputs of this size, px; both must be multiples of ``input_multiple``."""
        multiple = self.info.input_multiple
        for name, value in (("height", height), ("width", width)):
            if value <= 0 or value % multiple:
                raise InvalidArgument(name, f"must be a positive multiple of {multiple}", value)
        return Buffers(self._session.io_binding(), height, width, self.info.output_stride)

    @property
    def input_shapes(self) -> dict[str, list[int | str | None]]:
        """Shape of each input; sides that may be any are names or None."""
        return {node.name: list(node.shape) for node in self._session.get_inputs()}

    @property
    def output_shapes(self) -> dict[str, list[int | str | None]]:
        """Shape of each output, likewise."""
        return {node.name: list(node.shape) for node in self._session.get_outputs()}

    @property
    def is_on_processor(self) -> bool:
        """Whether the model runs on the processor's cores, and on no accelerator."""
        return self.provider == PROVIDERS["cpu"]

    def for_one_thread_each(self) -> StereoSession:
        """Return a session whose runs stay on the thread that calls, so that several frames can run at a time."""
        if not self.is_on_processor or self._threads == 1:
            return self
        return StereoSession(self._model, provider=self.provider, threads=1)

    def run(self, buffers: Buffers) -> None:
        """Compute ``disparity`` and ``confidence`` from ``left`` and ``right``; the GIL is released meanwhile."""
        try:
            self._session.run_with_iobinding(buffers.binding)
        except Exception as error:  # as above: no common base class to catch
            raise InferenceFailed("session", f"{self.info.name} must run on {self.provider}", error) from error


def padded(size: int, multiple: int) -> int:
    """Round a side length up to the next multiple, px."""
    return -(-size // multiple) * multiple


def _is_installed(distribution: str) -> bool:
    try:
        importlib.metadata.distribution(distribution)
    except importlib.metadata.PackageNotFoundError:
        return False
    return True


def provider_name(provider: str) -> str:
    """Return the runtime's own name of a provider; both kinds of name are taken, in capitals or not."""
    if not isinstance(provider, str):
        raise InvalidArgument("provider", "must be the name of a provider", repr(provider))
    own = {name.lower(): name for name in PROVIDERS.values()}
    return PROVIDERS.get(provider.lower()) or own.get(provider.lower(), provider)


def _installed(name: str, available: list[str]) -> str:
    if name not in available:
        known = ", ".join([*PROVIDERS, *(p for p in available if p not in PROVIDERS.values())])
        raise ProviderUnavailable(
            "provider", f"must be one of {known} and be installed here (installed: {', '.join(available)})", name
        )
    return name


def _session_options(runtime: Any, provider: str, threads: int, spinning: bool) -> Any:
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
    # Waiting threads must not burn the cores that rectification and post-processing need between two runs.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    options.add_session_config_entry("session.model_external_initializers_file_folder_path", NO_FOLDER)
    if provider != PROVIDERS["cpu"]:
        # A node that cannot run on the accelerator is an error, never a silent move to the processor.
        options.add_session_config_entry("session.disable_cpu_ep_fallback", "1")
    return options


def _check_interface(session: Any) -> None:
    inputs = {node.name: node for node in session.get_inputs()}
    outputs = {node.name: node for node in session.get_outputs()}
    if set(inputs) != {"left", "right"}:
        raise ModelMetadata("inputs", "must be left and right", ", ".join(sorted(inputs)))
    if set(outputs) != {"disparity", "confidence"}:
        raise ModelMetadata("outputs", "must be disparity and confidence", ", ".join(sorted(outputs)))
    for name, node in inputs.items():
        if node.type != "tensor(uint8)" or len(node.shape) != 4 or node.shape[1] != 3:
            raise ModelMetadata(name, "must be uint8 [N, 3, H, W]", f"{node.type} {node.shape}")
    for name, node in outputs.items():
        if node.type != "tensor(float)" or len(node.shape) != 4:
            raise ModelMetadata(name, "must be float32 [N, 1, H/s, W/s]", f"{node.type} {node.shape}")
