"""The object users hold: it owns the model and the buffers, and turns pairs of frames into depth."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endosdk import _core, telemetry
from endosdk.calibration import RectifiedGeometry, StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.models import ModelInfo, read_model
from endosdk.postprocess import Limits, Maps, postprocess
from endosdk.rectify import CHANNEL_ORDERS, Frame, RectifyStage, check_pair
from endosdk.result import DepthResult, Timings, status_of
from endosdk.session import Buffers, StereoSession, padded
from endosdk.stream import InFlight

# Frames in flight on an accelerator: one is rectified while the network works on another.
ACCELERATOR_LANES = 2


@dataclass(frozen=True)
class _Slot:
    """What one frame in work needs: maps of the lens, which slots share, and the network's memory."""

    stage: RectifyStage
    buffers: Buffers


@dataclass(frozen=True)
class _Answer:
    """A frame that is done."""

    slot: _Slot
    maps: Maps
    answered: int  # pixels with an answer
    timings: Timings


class DepthEstimator:
    """Stereo depth from pairs of frames of one camera.

    Args:
        model: a shipped name (see ``endosdk doctor``), the path of an ``.onnx`` file, or its bytes. A shipped model of
            8-bit integers gives way to its float twin where the processor has no instructions for them, or on a
            graphics card; the log ``endosdk`` and ``estimator.model.name`` say so.
        calibration: the rig. Raw frames are then rectified inside and metric outputs are available; without it the
            frames must already be rectified and only disparity is returned.
        provider: ``cpu``, ``cuda``, ``tensorrt`` or the full name of an onnxruntime provider. One that is missing is an
            error; nothing falls back.
        threads: processor threads for every stage; default is the number of cores this process may use.
        channel_order: ``rgb`` or ``bgr``, the order of colour frames. Gray frames need none.
        network_size: (width, height) the network works at, px; smaller is faster and widens the range of disparities in
            px of the frame. Default: at most as wide as the model's ``usual_width``; for a model that names none, the
            size of the frames up to a width of 960, and 720 px wide for wider frames, whose disparities would lie
            beyond the range. All outputs keep the size of the frame.
        min_confidence: below it a pixel has no answer, 0..1.
        depth_range_mm: (nearest, farthest) depth that counts as an answer.
        spinning: let waiting threads of the network poll; False saves power and costs some latency.

    `predict` answers one pair with the least delay, `stream` a sequence of them at the highest rate. Both may be called
    from any thread; calls of `predict` on one estimator run one after the other. An error leaves the estimator usable.
    """

    def __init__(
        self,
        model: str | Path | bytes,
        *,
        calibration: StereoCalibration | None = None,
        provider: str = "cpu",
        threads: int | None = None,
        channel_order: str = "rgb",
        network_size: tuple[int, int] | None = None,
        min_confidence: float = 0.3,
        depth_range_mm: tuple[float, float] = (0.0, math.inf),
        spinning: bool = True,
    ) -> None:
        self._order = _check_order(channel_order)
        limits = (_check_share("min_confidence", min_confidence), *_check_range(depth_range_mm))
        self._network_size = None if network_size is None else _check_size(network_size)
        self._threads = _check_threads(threads)
        if calibration is not None and not isinstance(calibration, StereoCalibration):
            raise InvalidArgument("calibration", "must be a StereoCalibration", type(calibration).__name__)
        self._calibration = calibration
        self._geometry = None if calibration is None else calibration.rectification()
        integer_units = provider == "cpu" and _core.has_integer_units()
        self._session = StereoSession(
            read_model(model, integer_units=integer_units), provider=provider, threads=self._threads, spinning=spinning
        )
        self._limits = Limits(*limits, self._session.info.last_plane)
        self._slot: _Slot | None = None  # of predict
        self._latest: _Slot | None = None
        self._frames = 0
        self._lock = threading.Lock()

    @property
    def model(self) -> ModelInfo:
        """What the loaded model says of itself."""
        return self._session.info

    @property
    def calibration(self) -> StereoCalibration | None:
        """The rig this estimator was made for."""
        return self._calibration

    @property
    def geometry(self) -> RectifiedGeometry | None:
        """Focal length, principal point and baseline of the rectified pair."""
        return self._geometry

    def predict(self, left: Any, right: Any, *, out: DepthResult | None = None) -> DepthResult:
        """Estimate depth for one pair.

        Args:
            left: uint8 [H, W, 3], [H, W, 1] or [H, W]; any row pitch.
            right: the same shape as left.
            out: an earlier result of this estimator whose maps are overwritten and returned in a new result, so that
                no memory is allocated; by default every result has maps of its own.

        Raises:
            InvalidArgument: a frame is no uint8 picture, or the two differ in shape.
            CalibrationSizeMismatch: the calibration is for frames of another size.
            InferenceFailed: the runtime could not run the model.
        """
        left, right = check_pair(left, right)
        with self._lock:
            slot = self._prepared(left.shape[1], left.shape[0])
            maps = self._maps(out, slot.stage.frame_size)
            return self._result(self._infer(self._session, slot, maps, self._rectify(slot, left, right)))

    def stream(
        self, source: Iterable[tuple[Any, Any]] | Callable[[], tuple[Any, Any] | None], *, reuse: bool = False
    ) -> Iterator[DepthResult]:
        """Estimate depth for every (left, right) of ``source``, in order and with the answers of `predict`.

        As many frames are in flight as the estimator has threads, each on one thread from end to end: no core waits
        for another, so the rate is the highest there is, at the price of a delay of one frame's time on one thread.
        Those threads read ``source``, one at a time. All frames must have the size of the first.

        Args:
            source: yields pairs as `predict` takes them, or is a function that returns one, and None at the end. A
                frame may be overwritten once the next one is asked for.
            reuse: write all results into a fixed ring of maps, so that no memory is allocated per frame; each result is
                then good until the next one is drawn.

        An error in ``source`` or in a frame is raised in its turn, after the results of the frames before it; it ends
        the stream and leaves the estimator usable.

        Raises:
            InvalidArgument: ``source`` is neither, or its frames are no pairs of one size.
        """
        if callable(source):
            return self._stream(iter(source, None), reuse)
        if not isinstance(source, Iterable):
            raise InvalidArgument(
                "source", "must yield pairs, or be a function that returns them", type(source).__name__
            )
        return self._stream(iter(source), reuse)

    def _stream(self, pairs: Iterator[tuple[Any, Any]], reuse: bool) -> Iterator[DepthResult]:
        session = self._session.for_one_thread_each()
        lanes = self._threads if session.is_on_processor else ACCELERATOR_LANES
        ring: list[_Slot] = []  # one more than lanes: the consumer holds a result too
        maps: list[Maps] = []

        def take(number: int, pair: tuple[Any, Any]) -> float:
            left, right = _checked_item(pair)
            size = left.shape[1], left.shape[0]
            if not ring:
                with self._lock:
                    stage = self._prepared(*size).stage
                ring.extend(self._new_slot(stage, session) for _ in range(lanes + 1))
                maps.extend(self._new_maps(size) for _ in ring if reuse)
            slot = ring[number % len(ring)]
            if size != slot.stage.frame_size:
                raise InvalidArgument("source", f"must keep the frame size {slot.stage.frame_size}", size)
            return self._rectify(slot, left, right)

        def compute(number: int, rectify_ms: float) -> _Answer:
            slot = ring[number % len(ring)]
            own = maps[number % len(maps)] if reuse else self._new_maps(slot.stage.frame_size)
            return self._infer(session, slot, own, rectify_ms)

        for answer in InFlight(pairs, lanes, take, compute).results():
            with self._lock:
                result = self._result(answer)
            yield result

    def _rectify(self, slot: _Slot, left: Frame, right: Frame) -> float:
        """Write the network's pictures and return the time it took, ms."""
        started = time.perf_counter()
        slot.stage(left, right, slot.buffers.left, slot.buffers.right, self._order)
        return 1e3 * (time.perf_counter() - started)

    def _infer(self, session: StereoSession, slot: _Slot, maps: Maps, rectify_ms: float) -> _Answer:
        """Run the network on rectified pictures and fill the maps."""
        started = time.perf_counter()
        session.run(slot.buffers)
        inferred = time.perf_counter()
        answered = postprocess(slot.buffers, slot.stage, self._geometry, self._limits, maps)
        finished = time.perf_counter()
        timings = Timings(rectify_ms, 1e3 * (inferred - started), 1e3 * (finished - inferred))
        return _Answer(slot, maps, answered, timings)

    def rectified_pair(self) -> tuple[Frame, Frame]:
        """Return copies of the latest frame's rectified pictures, as the network saw them: RGB uint8 [h, w, 3] each."""
        with self._lock:
            if self._latest is None:
                raise InvalidArgument("estimator", "predict must be called before rectified_pair", "no frame yet")
            width, height = self._latest.stage.size
            left, right = (
                view[:, :height, :width].transpose(1, 2, 0).copy()
                for view in (self._latest.buffers.left, self._latest.buffers.right)
            )
            return left, right

    def diagnostics(self) -> dict[str, Any]:
        """Versions, model, provider and settings in use, for logs and support."""
        info = self._session.info
        return {
            "endosdk": _core.version,
            "onnxruntime": self._session.runtime_version,
            "onnxruntime_telemetry": "on: imported by the host first" if telemetry.started_by_host() else "off",
            "provider": self._session.provider,
            "threads": self._threads,
            "kernels": _core.isa(),
            "integer_units": _core.has_integer_units(),
            "model": {"name": info.name, "version": info.version, "sha256": info.sha256},
            "calibration_sha256": None if self._calibration is None else self._calibration.sha256,
            "network_size": self._network_size if self._slot is None else self._slot.stage.size,
            "frames": self._frames,
        }

    def _prepared(self, width: int, height: int) -> _Slot:
        """Return maps and buffers for this frame size; nothing changes when it is refused."""
        if self._slot is not None and self._slot.stage.frame_size == (width, height):
            return self._slot
        usual_width = self._session.info.usual_width or 0
        network_size = self._network_size or _core.usual_network_size(width, height, usual_width)
        self._slot = self._new_slot(RectifyStage((width, height), self._calibration, network_size), self._session)
        return self._slot

    def _new_slot(self, stage: RectifyStage, session: StereoSession) -> _Slot:
        multiple = session.info.input_multiple
        width, height = stage.size
        return _Slot(stage, session.buffers(padded(height, multiple), padded(width, multiple)))

    def _new_maps(self, size: tuple[int, int]) -> Maps:
        return Maps.allocate(*size, metric=self._geometry is not None)

    def _maps(self, out: DepthResult | None, size: tuple[int, int]) -> Maps:
        """Return the maps of an earlier result, or new ones."""
        if out is None:
            return self._new_maps(size)
        width, height = size
        if out.disparity.shape != (height, width) or (out.depth_map is None) != (self._geometry is None):
            raise InvalidArgument("out", f"must be a result of this estimator, {height, width}", out.disparity.shape)
        return Maps(out.disparity, out.confidence, out.reasons, out.depth_map, out.sigma_map)

    def _result(self, answer: _Answer) -> DepthResult:
        """Count a frame that is done and give its maps to the user."""
        maps = answer.maps
        share = answer.answered / maps.reasons.size
        self._frames += 1
        self._latest = answer.slot
        return DepthResult(
            disparity=maps.disparity,
            confidence=maps.confidence,
            reasons=maps.reasons,
            status=status_of(share),
            valid_share=share,
            timings=answer.timings,
            frame=self._frames,
            model=self._session.info,
            geometry=self._geometry,
            calibration_sha256=None if self._calibration is None else self._calibration.sha256,
            depth_map=maps.depth,
            sigma_map=maps.sigma,
        )


def _checked_item(item: Any) -> tuple[Frame, Frame]:
    if not isinstance(item, tuple | list) or len(item) != 2:
        raise InvalidArgument("source", "must yield (left, right)", type(item).__name__)
    return check_pair(*item)


def _check_order(order: str) -> str:
    if order not in CHANNEL_ORDERS:
        raise InvalidArgument("channel_order", f"must be one of {', '.join(CHANNEL_ORDERS)}", repr(order))
    return order


def _check_share(name: str, value: float) -> float:
    if not 0.0 <= value <= 1.0:
        raise InvalidArgument(name, "must lie in 0..1", value)
    return float(value)


def _check_range(depth_range_mm: tuple[float, float]) -> tuple[float, float]:
    low, high = depth_range_mm
    if not 0.0 <= low < high:
        raise InvalidArgument("depth_range_mm", "must be (nearest, farthest) with 0 <= nearest < farthest", (low, high))
    return float(low), float(high)


def _check_size(size: tuple[int, int]) -> tuple[int, int]:
    width, height = size
    if width < 1 or height < 1 or int(width) != width or int(height) != height:
        raise InvalidArgument("network_size", "must be (width, height) in whole pixels", size)
    return int(width), int(height)


def _check_threads(threads: int | None) -> int:
    if threads is None:
        return _core.threads()
    if int(threads) != threads or threads < 1:
        raise InvalidArgument("threads", "must be a positive whole number", threads)
    _core.set_threads(int(threads))
    return int(threads)
