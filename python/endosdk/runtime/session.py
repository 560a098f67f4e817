"""Run a stereo model. The only file of the run time that knows onnxruntime."""

from __future__ import annotations

import copy
import importlib.metadata
import sys
import threading
import warnings
from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from endosdk import _core
from endosdk.errors import (
    EndoError,
    InferenceFailed,
    InternalError,
    ModelMetadata,
    ModelUnreadable,
    OutOfMemory,
    ProviderUnavailable,
    RuntimeConflict,
    RuntimeMissing,
)
from endosdk.io.extras import must_install
from endosdk.runtime import runtime_file, telemetry
from endosdk.runtime.models import ModelFile, ModelInfo, parse_metadata
from endosdk.runtime.providers import checked_options, installed_provider
from endosdk.runtime.started_threads import ThreadHook, session_threads

Picture = npt.NDArray[np.uint8]
Map = npt.NDArray[np.float32]

# The packages that bring onnxruntime, by what they compute on.
RUNTIMES = ("onnxruntime", "onnxruntime-gpu", "onnxruntime-openvino", "onnxruntime-webgpu", "onnxruntime-directml")


def load_runtime(sha256: str | None = None) -> Any:
    """Import onnxruntime with its telemetry off, or say which extra is missing or in conflict.

    With ``sha256``, only where its file has this hash.
    """
    _check_for_conflict()
    if sha256 is not None:
        runtime_file.check_pin(sha256)
    telemetry.disable()
    if "onnxruntime" not in sys.modules:
        _core.require_memory_for_runtime()
    try:
        import onnxruntime
    except ImportError as error:
        raise RuntimeMissing("onnxruntime", must_install("cpu"), str(error)) from error
    if telemetry.started_by_host():
        warnings.warn(
            "onnxruntime was imported before endosdk with its telemetry on; import endosdk first or set "
            f"{telemetry.VARIABLE}=1 in the environment",
            RuntimeWarning,
            stacklevel=2,
        )
    return onnxruntime


class BoundRun:
    """A model tied to the memory that it reads and writes."""

    def __init__(self, session: StereoSession, binding: Any, inputs: Mapping[str, Picture], options: Any) -> None:
        self._session, self.binding, self._inputs, self._options = session, binding, inputs, options
        if not session.copies_inputs:
            self.bind_inputs()

    def bind_inputs(self) -> None:
        """Tie the inputs anew: a provider with memory of its own copies them there now, and not when it runs."""
        for name, array in self._inputs.items():
            self.binding.bind_input(name, "cpu", 0, np.uint8, (1, *array.shape), array.ctypes.data)
        self.binding.synchronize_inputs()

    def run(self) -> None:
        """Compute disparity and confidence from left and right; the GIL is released meanwhile."""
        self._session.run_bound(self, self._options)

    def stop(self) -> None:
        """Make this run, and later ones, fail soon; from any thread."""
        self._options.terminate = True

    def resume(self) -> None:
        """Let later runs run again."""
        self._options.terminate = False


class StereoSession:
    """One loaded model and the call that runs it; runs on different memory may overlap.

    On an accelerator the model is compiled for one size of input: `for_size` makes the session that runs, and this one
    only reads what the model says of itself, on the processor.
    """

    def __init__(
        self,
        model: ModelFile,
        *,
        provider: str = "cpu",
        provider_options: Mapping[str, str | int] | None = None,
        threads: int = 0,
        spinning: bool = False,
        runtime_sha256: str | None = None,
        thread_started: ThreadHook | None = None,
    ) -> None:
        self._runtime = load_runtime(runtime_sha256)
        self._thread_started = thread_started
        self._model, self._threads, self._spinning = model, threads or _core.default_threads(), spinning
        self.runtime_version: str = self._runtime.__version__
        file = runtime_file.runtime_file()
        self.runtime_library = "" if file is None else str(file)
        self.runtime_sha256 = "" if file is None else runtime_file.sha256_of(file)
        self.provider_options = checked_options(provider, provider_options)
        self.provider = installed_provider(provider, self._runtime)
        _core.check_weights_are_inside(model.data, model.origin)
        options = _session_options(self._runtime, self._threads, spinning)
        self._is_reader = self.copies_inputs
        if not self.copies_inputs:
            compute_functions(options)
        self._running = threading.Lock()
        if self._is_reader:
            options.intra_op_num_threads = 1
            options.graph_optimization_level = self._runtime.GraphOptimizationLevel.ORT_DISABLE_ALL
        rule = f"{model.origin} must be an ONNX file that runs here"
        self._session = self._started(options, _core.cpu_provider, {}, ModelUnreadable, "model", rule)
        self.info: ModelInfo = parse_metadata(self.metadata, model.sha256)
        _check_interface(self._session)

    def for_size(self, height: int, width: int) -> StereoSession | None:
        """Return a session for inputs of exactly this size, px; None where this one takes any.

        Raises ProviderUnavailable where the provider does not start, does not know an option, or leaves more of the
        model to the processor than the arithmetic of shapes.
        """
        if not self._is_reader:
            return None
        sized = copy.copy(self)
        sized._is_reader = False
        sized._running = threading.Lock()
        sized._session = self._compiled(height, width)
        return sized

    def _compiled(self, height: int, width: int) -> Any:
        if not hasattr(self._runtime.InferenceSession, "get_provider_graph_assignment_info"):
            rule = f"{self.provider} needs onnxruntime 1.24 or newer, which says where it computes each operation"
            raise ProviderUnavailable("provider", rule, f"onnxruntime {self.runtime_version}")
        options = _session_options(self._runtime, self._threads, self._spinning)
        # A graph whose sides are known holds no arithmetic of shapes, which the runtime would leave to the processor.
        for shape in self.input_shapes.values():
            for side, length in zip(shape, (1, 3, height, width), strict=True):
                if isinstance(side, str):
                    options.add_free_dimension_override_by_name(side, length)
        options.add_session_config_entry("session.record_ep_graph_assignment_info", "1")
        rule = f"{self.provider} must start on this machine"
        session = self._started(options, self.provider, self.provider_options, ProviderUnavailable, "provider", rule)
        if session.get_providers()[0] != self.provider:
            raise ProviderUnavailable("provider", rule, ", ".join(session.get_providers()))
        _core.check_placement(self.provider, _placed_nodes(session), self._model.data, self._model.origin)
        return session

    def _started(
        self,
        options: Any,
        provider: str,
        provider_options: dict[str, str],
        failure: type[EndoError],
        argument: str,
        rule: str,
    ) -> Any:
        """Return a session of the runtime, which must not try another provider, nor print that it does.

        Raises OutOfMemory where memory or threads are used up, otherwise this kind of failure.
        """
        # Where the system runs out of them meanwhile, the runtime hangs for want of threads and can end the process for
        # want of memory. So both are asked for first.
        _core.reserve_threads(self._threads)
        _core.require_memory_for_session(self._threads, len(self._model.data))
        providers = [(provider, provider_options)]
        with session_threads(self._thread_started):
            try:
                return self._runtime.InferenceSession(self._model.data, options, providers=providers, enable_fallback=0)
            except Exception as error:  # the runtime has a type for each status code, and they have no common base
                raise _kind_of(error, failure)(argument, rule, error) from error

    def placed_nodes(self) -> dict[str, list[tuple[str, str]]]:
        """Return operation and name of the nodes that run on each provider; of a session for one size."""
        return _placed_nodes(self._session)

    @property
    def metadata(self) -> dict[str, str]:
        """What the model file says of itself."""
        return dict(self._session.get_modelmeta().custom_metadata_map)

    @property
    def copies_inputs(self) -> bool:
        """Whether the provider may have memory of its own, to which each frame is copied."""
        return self.provider != _core.cpu_provider

    @property
    def sha256(self) -> str:
        """Hash of the model's bytes."""
        return self._model.sha256

    @property
    def telemetry_on(self) -> bool:
        """Whether the host imported onnxruntime before its telemetry could be switched off."""
        return telemetry.started_by_host()

    def bind(self, left: Picture, right: Picture, disparity: Map, confidence: Map) -> BoundRun:
        """Tie the model to memory, which must outlive it: uint8 [3, H, W] twice, float32 [h, w] twice.

        Raises InternalError for a session that only reads the model: `for_size` makes the one that runs.
        """
        if self._is_reader:
            raise InternalError("session", "must be one for a size", self.provider)
        binding = self._session.io_binding()
        for name, output in (("disparity", disparity), ("confidence", confidence)):
            binding.bind_output(name, "cpu", 0, np.float32, (1, 1, *output.shape), output.ctypes.data)
        options = self._runtime.RunOptions()
        # The errors of a run tell all. A line of log for which memory is missing would end the process.
        options.log_severity_level = 4
        return BoundRun(self, binding, {"left": left, "right": right}, options)

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
        return StereoSession(self._model, provider=self.provider, threads=1)

    def run_bound(self, bound: BoundRun, options: Any) -> None:
        """Run on memory that was bound before."""
        try:
            if not self.copies_inputs:
                self._session.run_with_iobinding(bound.binding, options)
                return
            # The runtime guards its own runs, but not the copies of one frame against the run of another.
            with self._running:
                bound.bind_inputs()
                self._session.run_with_iobinding(bound.binding, options)
        except Exception as error:  # as above: no common base class to catch
            rule = f"{self.info.name} must run on {self.provider}"
            raise _kind_of(error, InferenceFailed)("session", rule, error) from error


def _kind_of(error: Exception, otherwise: type[EndoError]) -> type[EndoError]:
    """Return what a failure of the runtime is here."""
    short = isinstance(error, MemoryError) or _core.is_out_of_resources(str(error))
    return OutOfMemory if short else otherwise


def padded(size: int, multiple: int) -> int:
    """Round a side length up to the next multiple, px."""
    return -(-size // multiple) * multiple


def _check_for_conflict() -> None:
    """Refuse two runtimes in one folder: all unpack into the same files."""
    found = defaultdict(list)
    for name in RUNTIMES:
        try:
            found[importlib.metadata.distribution(name).locate_file("onnxruntime")].append(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    for names in found.values():
        if len(names) > 1:
            rule = "only one runtime may be installed: uninstall all, then install one"
            raise RuntimeConflict("onnxruntime", rule, " and ".join(names))


def _placed_nodes(session: Any) -> dict[str, list[tuple[str, str]]]:
    """Return operation and name of the nodes on each provider."""
    nodes: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for part in session.get_provider_graph_assignment_info():
        nodes[part.ep_name] += [(node.op_type, node.name) for node in part.get_nodes()]
    return dict(nodes)


def _session_options(runtime: Any, threads: int, spinning: bool) -> Any:
    options = runtime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 3
    for key, value in _core.waiting_settings(spinning).items():
        options.add_session_config_entry(key, value)
    return options


def compute_functions(options: Any) -> None:
    """Let sessions with these options, on the processor, compute the functions of model files by our own loops."""
    options.register_custom_ops_library(_core.__file__)


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
