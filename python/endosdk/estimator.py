"""The object users hold: it owns the model and the buffers, and turns pairs of frames into depth."""

from __future__ import annotations

import itertools
import math
import threading
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
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

    `predict` answers one pair with the least delay, `stream` a sequence of them. Both may be called from any thread;
    frames of one estimator are computed one after the other. Use one estimator per thread to run in parallel. An error
    leaves the estimator usable.
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
        self._limits = Limits(_check_share("min_confidence", min_confidence), *_check_range(depth_range_mm))
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
        self._frame_size: tuple[int, int] | None = None
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
            self._prepare(left.shape[1], left.shape[0])
            maps = self._maps(out)
            started = time.perf_counter()
            self._stage(left, right, self._buffers.left, self._buffers.right, self._order)
            rectify_ms = 1e3 * (time.perf_counter() - started)
            return self._infer(self._buffers, rectify_ms, maps)

    def stream(self, source: Iterable[tuple[Any, Any]], *, reuse: bool = False) -> Iterator[DepthResult]:
        """Estimate depth for every (left, right) of ``source``, in order, as `predict` would.

        While the network works on one pair, a second thread fetches the next one from ``source`` and rectifies it, so
        a camera is read without waiting and the stages overlap where there are cores to spare. No more than one pair is
        fetched ahead. All frames must have the size of the first.

        Args:
            source: yields pairs as `predict` takes them. A frame may be overwritten once the next one is asked for.
            reuse: give every result the same maps; each is then good until the next one is drawn, and no memory is
                allocated per frame.

        An error in ``source`` or in a frame is raised in its turn, after the results of the frames before it; it ends
        the stream and leaves the estimator usable. So does a frame of another size, here or given to `predict`.
        """
        pairs = iter(source)
        slots: list[Buffers] = []

        def rectify_next(number: int) -> float | None:
            pair = next(pairs, None)
            if pair is None:
                return None
            left, right = check_pair(*pair)
            size = left.shape[1], left.shape[0]
            if not slots:
                with self._lock:
                    self._prepare(*size)
                    slots.extend(self._new_buffers() for _ in range(2))
            if size != self._frame_size:
                raise InvalidArgument("source", f"must keep the frame size {self._frame_size}", size)
            started = time.perf_counter()
            slot = slots[number % 2]
            self._stage(left, right, slot.left, slot.right, self._order)
            return 1e3 * (time.perf_counter() - started)

        ahead = ThreadPoolExecutor(1, thread_name_prefix="endosdk-stream")
        try:
            result: DepthResult | None = None
            coming = ahead.submit(rectify_next, 0)
            for number in itertools.count():
                rectify_ms = coming.result()
                if rectify_ms is None:
                    return
                coming = ahead.submit(rectify_next, number + 1)
                with self._lock:
                    maps = self._maps(result if reuse else None)
                    result = self._infer(slots[number % 2], rectify_ms, maps)
                yield result
        finally:
            ahead.shutdown(wait=True, cancel_futures=True)

    def _infer(self, buffers: Buffers, rectify_ms: float, maps: Maps) -> DepthResult:
        """Run the network on rectified buffers and fill the maps."""
        started = time.perf_counter()
        self._session.run(buffers)
        inferred = time.perf_counter()
        answered = postprocess(buffers, self._stage, self._geometry, self._limits, maps)
        finished = time.perf_counter()
        self._frames += 1
        self._latest = buffers
        timings = Timings(rectify_ms, 1e3 * (inferred - started), 1e3 * (finished - inferred))
        return self._result(maps, answered, timings)

    def rectified_pair(self) -> tuple[Frame, Frame]:
        """Return copies of the latest frame's rectified pictures, as the network saw them: RGB uint8 [h, w, 3] each."""
        with self._lock:
            if self._frames == 0:
                raise InvalidArgument("estimator", "predict must be called before rectified_pair", "no frame yet")
            width, height = self._stage.size
            left, right = (
                view[:, :height, :width].transpose(1, 2, 0).copy() for view in (self._latest.left, self._latest.right)
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
            "network_size": self._network_size if self._frame_size is None else self._stage.size,
            "frames": self._frames,
        }

    def _prepare(self, width: int, height: int) -> None:
        """Build maps and buffers for this frame size; nothing changes when it is refused."""
        if self._frame_size == (width, height):
            return
        usual_width = self._session.info.usual_width or 0
        network_size = self._network_size or _core.usual_network_size(width, height, usual_width)
        stage = RectifyStage((width, height), self._calibration, network_size)
        self._stage = stage
        self._buffers = self._new_buffers()
        self._frame_size = (width, height)

    def _new_buffers(self) -> Buffers:
        multiple = self._session.info.input_multiple
        width, height = self._stage.size
        return self._session.buffers(padded(height, multiple), padded(width, multiple))

    def _maps(self, out: DepthResult | None) -> Maps:
        assert self._frame_size is not None
        width, height = self._frame_size
        if out is None:
            return Maps.allocate(width, height, metric=self._geometry is not None)
        if out.disparity.shape != (height, width) or (out.depth_map is None) != (self._geometry is None):
            raise InvalidArgument("out", f"must be a result of this estimator, {height, width}", out.disparity.shape)
        return Maps(out.disparity, out.confidence, out.reasons, out.depth_map, out.sigma_map)

    def _result(self, maps: Maps, answered: int, timings: Timings) -> DepthResult:
        share = answered / maps.reasons.size
        return DepthResult(
            disparity=maps.disparity,
            confidence=maps.confidence,
            reasons=maps.reasons,
            status=status_of(share),
            valid_share=share,
            timings=timings,
            frame=self._frames,
            model=self._session.info,
            geometry=self._geometry,
            calibration_sha256=None if self._calibration is None else self._calibration.sha256,
            depth_map=maps.depth,
            sigma_map=maps.sigma,
        )


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
