"""Run a stereo model. The only file of the run time that knows onnxruntime."""

from __future__ import annotations

import importlib.metadata
import warnings
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk import _core
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

Picture = npt.NDArray[np.uint8]
Map = npt.NDArray[np.float32]


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


class Run:
    """A model tied to the memory that it reads and writes."""

    def __init__(self, session: StereoSession, binding: Any, options: Any) -> None:
        self._session, self.binding, self._options = session, binding, options

    def run(self) -> None:
        """Compute disparity and confidence from left and right; the GIL is released meanwhile."""
        self._session.run_bound(self.binding, self._options)

    def stop(self) -> None:
        """Make this run, and later ones, fail soon; from any thread."""
        self._options.terminate = True

    def resume(self) -> None:
        """Let later runs run again."""
        self._options.terminate = False


class Buffers:
    """Memory of its own for one run, for studies: the frame path brings its own.

    Write planar RGB into ``left`` and ``right``, uint8 [3, H, W]; after the run read ``disparity`` and ``confidence``,
    float32 [H / stride, W / stride].
    """

    def __init__(self, session: StereoSession, height: int, width: int) -> None:
        stride = session.info.output_stride
        self.left = np.zeros((3, height, width), np.uint8)
        self.right = np.zeros((3, height, width), np.uint8)
        self.disparity = np.zeros((height // stride, width // stride), np.float32)
        self.confidence = np.zeros_like(self.disparity)
        self.bound = session.bind(self.left, self.right, self.disparity, self.confidence)


class StereoSession:
    """One loaded model and the call that runs it; runs on different memory may overlap."""

    def __init__(self, model: ModelFile, *, provider: str = "cpu", threads: int = 0, spinning: bool = True) -> None:
        self._runtime = load_runtime()
        self._model, self._threads = model, threads
        self.runtime_version: str = self._runtime.__version__
        self.provider = _installed(provider_name(provider), self._runtime.get_available_providers())
        _core.check_weights_are_inside(model.data, model.origin)
        options = _session_options(self._runtime, self.provider, threads, spinning)
        try:
            self._session = self._runtime.InferenceSession(model.data, options, providers=[self.provider])
        except Exception as error:  # the runtime has its own exception types, one per status code, with no common base
            raise ModelUnreadable("model", f"{model.origin} must be an ONNX file that runs here", error) from error
        used = self._session.get_providers()
        if used[0] != self.provider:
            raise ProviderUnavailable("provider", f"{self.provider} must start on this machine", ", ".join(used))
        self.info: ModelInfo = parse_metadata(self.metadata, model.sha256)
        _check_interface(self._session)

    @property
    def metadata(self) -> dict[str, str]:
        """What the model file says of itself."""
        return dict(self._session.get_modelmeta().custom_metadata_map)

    @property
    def sha256(self) -> str:
        """Hash of the model's bytes."""
        return self._model.sha256

    @property
    def telemetry_on(self) -> bool:
        """Whether the host imported onnxruntime before its telemetry could be switched off."""
        return telemetry.started_by_host()

    def bind(self, left: Picture, right: Picture, disparity: Map, confidence: Map) -> Run:
        """Tie the model to memory, which must outlive it: uint8 [3, H, W] twice, float32 [h, w] twice."""
        binding = self._session.io_binding()
        for name, array in (("left", left), ("right", right)):
            binding.bind_input(name, "cpu", 0, np.uint8, (1, *array.shape), array.ctypes.data)
        for name, output in (("disparity", disparity), ("confidence", confidence)):
            binding.bind_output(name, "cpu", 0, np.float32, (1, 1, *output.shape), output.ctypes.data)
        return Run(self, binding, self._runtime.RunOptions())

    def buffers(self, height: int, width: int) -> Buffers:
        """Allocate and bind memory for inputs of this size, px; both must be multiples of ``input_multiple``."""
        multiple = self.info.input_multiple
        for name, value in (("height", height), ("width", width)):
            if value <= 0 or value % multiple:
                raise InvalidArgument(name, f"must be a positive multiple of {multiple}", value)
        return Buffers(self, height, width)

    @property
    def input_shapes(self) -> dict[str, list[int | str | None]]:
        """Shape of each input; sides that may be any are names or None."""
        return {node.name: list(node.shape) for node in self._session.get_inputs()}

    @property
    def output_shapes(self) -> dict[str, list[int | str | None]]:
        """Shape of each output, likewise."""
        return {node.name: list(node.shape) for node in self._session.get_outputs()}

    def for_one_thread_each(self) -> StereoSession | None:
        """Return a session whose runs stay on the thread that calls; None where this one does as well."""
        if self.provider != _core.cpu_provider or self._threads == 1:
            return None
        return StereoSession(self._model, provider=self.provider, threads=1, spinning=False)

    def run(self, buffers: Buffers) -> None:
        """Compute ``disparity`` and ``confidence`` from ``left`` and ``right``."""
        buffers.bound.run()

    def run_bound(self, binding: Any, options: Any) -> None:
        """Run on memory that was bound before."""
        try:
            self._session.run_with_iobinding(binding, options)
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
    return _core.full_provider_name(provider)


def _installed(name: str, available: list[str]) -> str:
    if name not in available:
        names, installed = ", ".join(_core.providers), ", ".join(available)
        rule = f"must be one of {names}, or a full name, and be installed here (installed: {installed})"
        raise ProviderUnavailable("provider", rule, name)
    return name


def _session_options(runtime: Any, provider: str, threads: int, spinning: bool) -> Any:
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    options.add_session_config_entry("session.intra_op.allow_spinning", "1" if spinning else "0")
    # Waiting threads must not burn the cores that rectification and post-processing need between two runs.
    options.add_session_config_entry("session.force_spinning_stop", "1")
    if provider != _core.cpu_provider:
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
