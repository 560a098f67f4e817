"""The object users hold: checked arguments, a model on the compiled frame path, and results."""

from __future__ import annotations

import json
import logging
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from endosdk import _core
from endosdk.calibration.rectified_geometry import RectifiedGeometry
from endosdk.calibration.rig import StereoCalibration, check_calibration
from endosdk.errors import CalibrationRequired, InvalidArgument, typed_memory_errors
from endosdk.runtime.arguments import (
    Picture,
    check_frame_size,
    check_number,
    check_order,
    check_pair,
    check_queue,
    check_range,
    check_size,
    check_stamp,
    check_switch,
    check_threads,
)
from endosdk.runtime.drawn import StereoFrame, drawn_from
from endosdk.runtime.limits import EVERY_DEPTH, Limits
from endosdk.runtime.maps import MapMemory, Maps
from endosdk.runtime.models import ModelInfo, read_model
from endosdk.runtime.providers import checked_options, installed_provider
from endosdk.runtime.result import DepthResult, Timings
from endosdk.runtime.rig_error import rig_error
from endosdk.runtime.session import StereoSession, load_runtime
from endosdk.runtime.started_threads import (
    FOLLOW,
    KERNELS,
    STREAM,
    ThreadHook,
    check_hook,
    show_this_thread,
    shown,
)
from endosdk.runtime.stream import Feeder

# Lines about single frames are for hosts that set logging up; they must not fill a terminal unasked.
logging.getLogger("endosdk.frames").addHandler(logging.NullHandler())


class DepthEstimator:
    """Stereo depth from pairs of frames of one camera.

    Args:
        model: a shipped name (see ``endosdk doctor``), the path of an ``.onnx`` file, or its bytes. A shipped model of
            8-bit integers gives way to its float32 model where the processor or the provider has no fast arithmetic for
            them; the log ``endosdk`` and ``estimator.model.name`` say so.
        calibration: the rig. Raw frames are then rectified inside and metric outputs are available; without it the
            frames must already be rectified and only disparity is returned.
        provider: ``cpu``, ``cuda``, ``tensorrt``, ``openvino``, ``directml``, ``coreml``, ``xnnpack``, ``webgpu`` or
            the full name of an onnxruntime provider. One that is missing is an error; nothing falls back. Every one but
            ``cpu`` compiles the model once per frame size, and once when the estimator is made; the latest four sizes
            are kept.
        provider_options: settings of the provider, such as ``{"device_id": 1}``: see its own page. Passed on as
            texts, unchanged; ``use_tf32`` of CUDA is 0 unless it is given. What the provider refuses is a
            `ProviderUnavailable`.
        threads: processor threads for every stage, 1 to 256; default is the number of cores this process may use, but
            at most 8.
        channel_order: ``rgb`` or ``bgr``, the order of colour frames. Gray frames need none.
        network_size: (width, height) the network works at, px; smaller is faster and widens the range of disparities in
            px of the frame. Default: as wide as the model's ``inference_width``, narrower frames enlarged. For a model
            that names none: the size of the frames up to a width of 960, and 720 px wide for wider frames, whose
            disparities would lie beyond the range. All outputs keep the size of the frame.
        min_confidence: below it a pixel has no answer, 0..1.
        depth_range_mm: (nearest, farthest) depth that counts as an answer; needs a calibration.
        deadline_ms: a frame that takes longer, waiting for others included, is marked ``late``; 0: none is.
        max_age_ms: a pair that was taken longer ago, by the ``stamp_ns`` given with it, is `Cause.STALE`; every pair
            must then have a stamp. 0: none is.
        runtime_sha256: the hash that the file of ONNX Runtime must have, checked before anything of it runs, as
            ``diagnostics()["onnxruntime_sha256"]`` states it; None: any.
        spinning: let waiting threads of the network poll before they sleep. Faster on cores that nothing else uses,
            slower on others.
        thread_started: called with the number and the name of each thread that starts for this estimator: when it is
            opened, in `prepare`, and when a stream begins. ``os.sched_setscheduler`` and ``os.sched_setaffinity`` take
            the number. Linux only; see ``docs/device/real-time.md``.

    `predict` answers one pair with the least delay, `stream` a sequence of them at the highest rate. Both may be called
    from any thread; calls of `predict` on one estimator run one after the other, in the order in which they came. An
    error leaves the estimator usable. ``with DepthEstimator(...) as depth:`` closes it at the end.

    The log ``endosdk.frames`` says which frames were late or show two different scenes.
    """

    @typed_memory_errors()
    def __init__(
        self,
        model: str | Path | bytes,
        *,
        calibration: StereoCalibration | None = None,
        provider: str = "cpu",
        provider_options: Mapping[str, str | int] | None = None,
        threads: int | None = None,
        channel_order: str = "rgb",
        network_size: tuple[int, int] | None = None,
        min_confidence: float = _core.default_min_confidence,
        depth_range_mm: tuple[float, float] = EVERY_DEPTH,
        deadline_ms: float = 0.0,
        max_age_ms: float = 0.0,
        runtime_sha256: str | None = None,
        spinning: bool = False,
        thread_started: ThreadHook | None = None,
    ) -> None:
        if calibration is not None:
            check_calibration(calibration)
        limits = Limits(
            check_number("min_confidence", min_confidence, "must be a number in 0..1"), check_range(depth_range_mm)
        )
        settings = _core.FramePathSettings(
            check_order(channel_order),
            check_threads(threads),
            check_size(network_size),
            *limits,
            check_number("deadline_ms", deadline_ms, "must be finite and not negative"),
            check_number("max_age_ms", max_age_ms, "must be finite and not negative"),
        )
        if calibration is None and limits.depth_range_mm != EVERY_DEPTH:
            raise CalibrationRequired("depth_range_mm", _core.calibration_rule, "no calibration")
        self._thread_started = check_hook(thread_started)
        options = checked_options(provider, provider_options)
        # Before the model is read: which file that is, and what the log says of it, depends on the provider.
        provider = installed_provider(provider, load_runtime(runtime_sha256))
        file = read_model(model, integer_units=not _core.wants_float32_model(provider))
        session = StereoSession(
            file,
            provider=provider,
            provider_options=options,
            threads=settings.threads,
            spinning=check_switch("spinning", spinning),
            runtime_sha256=runtime_sha256,
            thread_started=self._thread_started,
        )
        self._info = session.info
        self._limits = limits
        self._channel_order = channel_order
        self._network_size = network_size
        self._provider, self._threads = provider, settings.threads or _core.default_threads()
        self._path = _core.FramePath(session, settings)
        self._calibration = calibration
        self._geometry = None
        if calibration is not None:
            self._geometry = calibration.rectification()
            self._path.set_calibration(calibration.numbers())
        self._memory = MapMemory(calibrated=self._geometry is not None)

    def __repr__(self) -> str:
        """One line for people."""
        rig = self._calibration
        known = "no calibration" if rig is None else f"calibrated for {rig.width}x{rig.height}"
        threads = f"{self._threads} thread{'' if self._threads == 1 else 's'}"
        return f"<DepthEstimator {self._info.name} {self._info.version}: {self._provider}, {threads}, {known}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Wait for the call that runs and free the frame memory; later calls are refused."""
        self._path.close()
        self._memory.close()

    @property
    def model(self) -> ModelInfo:
        """What the loaded model says of itself."""
        return self._info

    @property
    def limits(self) -> Limits:
        """Which answers count as valid: the least confidence, and the range of depth."""
        return self._limits

    @property
    def network_size(self) -> tuple[int, int] | None:
        """The network input (width, height) that was asked for, px; None where it follows from the model."""
        return self._network_size

    @property
    def calibration(self) -> StereoCalibration | None:
        """The rig this estimator was made for."""
        return self._calibration

    @property
    def geometry(self) -> RectifiedGeometry | None:
        """Focal length, principal point and baseline of the rectified pair."""
        return self._geometry

    def largest_disparity(self, width: int, height: int) -> float | None:
        """Disparity, px of frames of this size, at the near end of what the network finds; beyond is out of range.

        None where the model does not state its range.
        """
        return _number_or_none(self._path.largest_disparity(*check_frame_size(width, height)))

    @property
    def nearest_depth_mm(self) -> float | None:
        """Depth of a surface at the near end of what the network finds; nearer ones are out of range.

        None without a calibration, or where the model does not state its range.
        """
        return _number_or_none(self._path.nearest_depth_mm())

    @typed_memory_errors()
    def prepare(self, width: int, height: int) -> None:
        """Reserve what frames of this size need and run once, so that the first real frame is as fast as the others."""
        with shown(self._thread_started, KERNELS):
            self._path.prepare(*check_frame_size(width, height))

    @typed_memory_errors()
    def predict(
        self, left: Any, right: Any, *, out: DepthResult | None = None, stamp_ns: int | None = None
    ) -> DepthResult:
        """Estimate depth for one pair.

        Args:
            left: uint8 [H, W, 3], [H, W, 1] or [H, W]; any row pitch.
            right: the same shape as left.
            out: an earlier result of this estimator whose maps are overwritten and returned in a new result; by
                default every result has maps of its own. Their memory serves a later frame once nothing refers to it.
            stamp_ns: when the pair was taken, by the clock of ``time.monotonic_ns()``; the result says how old it is.

        Raises:
            InvalidArgument: a frame is no uint8 picture, or the two differ in shape.
            CalibrationSizeMismatch: the calibration is for frames of another size.
            InferenceFailed: the runtime could not run the model.
        """
        left, right = check_pair(left, right)
        maps = self._maps(out, left.shape)
        return self._result(self._path.predict(left, right, maps, check_stamp(stamp_ns)), maps)

    def stream(
        self,
        source: Iterable[tuple[Any, ...] | StereoFrame] | Callable[[], tuple[Any, ...] | None],
        *,
        queue: str = "every",
        reuse: bool = False,
        temporal: bool = False,
        follow_rig: bool = False,
    ) -> Iterator[DepthResult]:
        """Estimate depth for every (left, right) of ``source``, in order and with the answers of `predict`.

        Each frame is computed on one thread, and as many frames at a time as the estimator has threads. This gives the
        highest frame rate. The latency is one frame's time on one thread. Another thread reads ``source``.
        All frames must have the size of the first.

        Args:
            source: yields pairs as `predict` takes them, or is a function that returns one, and None at the end. A
                frame may be overwritten once the next one is asked for. A third item is the pair's ``stamp_ns``. A
                source of `open_source` is taken as it is; each result then has its frame as ``source_frame``.
            queue: ``every`` pair is computed; with ``newest``, ``source`` is read as fast as it yields, and the pairs
                that were not taken in time are dropped: ``dropped`` of the result says how many before this one. For a
                source that does not wait, such as a camera.
            reuse: write all results into a fixed ring of maps; each result is then good until the next one is drawn.
            temporal: filter against flicker. It moves the disparity of the frame before with the surfaces, and blends
                it with the new one where both images agree; see ``docs/live.md``.
            follow_rig: correct the rectification slowly, by at most 0.1 degree in 30 frames, where the frames show for
                certain that the right camera has turned against the calibration. The log ``endosdk`` says so, and
                each result's ``rig.corrected_deg`` says by how much. Needs a calibration. Answers then depend on the
                frames before.

        An error in ``source`` or in a frame is raised in its turn, after the results of the frames before it; it ends
        the stream and leaves the estimator usable. Leaving the loop, or closing the iterator, ends the stream too: what
        is being computed is waited for, a source that does not answer is not.

        Raises:
            InvalidArgument: ``source`` is neither, or its frames are no pairs of one size.
        """
        check_queue(queue)
        for name, value in (("reuse", reuse), ("temporal", temporal), ("follow_rig", follow_rig)):
            check_switch(name, value)
        if follow_rig and self._geometry is None:
            raise CalibrationRequired("follow_rig", _core.calibration_rule, "no calibration")
        if callable(source):
            return self._stream(drawn_from(source), queue, reuse, temporal, follow_rig)
        if not isinstance(source, Iterable):
            raise InvalidArgument(
                "source", "must yield pairs, or be a function that returns them", type(source).__name__
            )
        return self._stream(iter(source), queue, reuse, temporal, follow_rig)

    def _stream(
        self, pairs: Iterator[tuple[Any, ...] | StereoFrame], queue: str, reuse: bool, temporal: bool, follow_rig: bool
    ) -> Iterator[DepthResult]:
        ring: list[Maps] = []  # one more than frames in flight: the consumer holds a result too

        def maps_for(number: int, stream: _core.Stream, size: tuple[int, int]) -> Maps:
            if not reuse:
                return self._memory.maps(*size)
            if not ring:
                ring.extend(self._memory.maps(*size) for _ in range(stream.lanes + 1))
            return ring[number % len(ring)]

        def opened(width: int, height: int) -> _core.Stream:
            show_this_thread(self._thread_started, STREAM)
            with shown(self._thread_started, STREAM, FOLLOW, KERNELS):
                stream = self._path.stream(width, height, temporal)
                if follow_rig:
                    stream.follow_rig()
            return stream

        feeder = Feeder(pairs, opened, maps_for, self._channel_order, newest=queue == "newest")
        for report, maps, frame, dropped in feeder.answers():
            yield self._result(report, maps, frame, dropped)

    @typed_memory_errors()
    def rectify(self, left: Any, right: Any) -> tuple[Picture, Picture]:
        """Return a pair's rectified pictures at the size of the frame: RGB uint8 [H, W, 3] each.

        Every map of the pair's result lies over the left one; x_right = x_left - disparity. Frames are as `predict`
        takes them. The network usually sees smaller pictures, see `rectified_pair`.
        """
        return self._path.rectify(*check_pair(left, right))

    @typed_memory_errors()
    def rectified_pair(self) -> tuple[Picture, Picture]:
        """Return copies of the latest frame's rectified pictures, as the network saw them: RGB uint8 [h, w, 3] each.

        The right view of a rectified rig whose doffs is more than 0.5 px lies doffs further left here than it came;
        disparities are those of the pictures that came, and of `rectify`.
        """
        return self._path.rectified()

    def cancel(self) -> None:
        """Make the calls that are running, and the frames in flight, raise `Cancelled` soon; from any thread."""
        self._path.cancel()

    @typed_memory_errors()
    def self_test(self) -> None:
        """Send a built-in pair of known depth the whole way, twice; raises `SelfTestFailed` where one is wrong."""
        self._path.self_test()

    @typed_memory_errors()
    def diagnostics(self) -> dict[str, Any]:
        """Versions, model, provider, settings, frame counts and latencies, for logs and support; waits for no frame."""
        report: dict[str, Any] = json.loads(self._path.diagnostics())
        return {"endosdk": _core.version, **report}

    def _maps(self, out: DepthResult | None, shape: tuple[int, ...]) -> Maps:
        """Return the maps of an earlier result, or new ones."""
        height, width = shape[:2]
        if out is None:
            return self._memory.maps(width, height)
        if not isinstance(out, DepthResult):
            raise InvalidArgument("out", "must be a DepthResult of this estimator", type(out).__name__)
        if out.disparity.shape != (height, width):
            raise InvalidArgument("out", f"must be of frames of this size, {height, width}", out.disparity.shape)
        if (out.depth_map is None) != (self._geometry is None):
            has = "with" if self._geometry is not None else "without"
            raise InvalidArgument("out", f"must be of an estimator {has} a calibration, as this one", "the other kind")
        maps = out.maps
        if not maps.writeable:
            raise InvalidArgument("out", "must have maps that can be written", "read-only maps")
        return maps

    @typed_memory_errors()
    def _result(self, report: _core.FrameReport, maps: Maps, source_frame: Any = None, dropped: int = 0) -> DepthResult:
        return DepthResult(
            maps=maps,
            status=report.status,
            causes=report.causes,
            measures=report.measures,
            valid_share=report.valid_share,
            rig=rig_error(report, self._geometry is not None),
            timings=Timings(report.rectify_ms, report.session_ms, report.postprocess_ms),
            late=report.late,
            frame=report.frame,
            model=self._info,
            geometry=self._geometry,
            calibration_sha256=None if self._calibration is None else self._calibration.sha256,
            identity=report.identity,
            stamp_ns=report.stamp_ns or None,
            age_ms=_number_or_none(report.age_ms),
            source_frame=source_frame,
            dropped=dropped,
        )


def _number_or_none(value: float) -> float | None:
    return None if math.isnan(value) else value
