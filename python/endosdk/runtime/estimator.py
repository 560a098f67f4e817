"""The object users hold: it owns the model and the buffers, and turns pairs of frames into depth."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from endosdk import _core
from endosdk.calibration.rig import RectifiedGeometry, StereoCalibration
from endosdk.errors import InvalidArgument
from endosdk.runtime import telemetry
from endosdk.runtime.arguments import check_order, check_range, check_share, check_size, check_threads
from endosdk.runtime.models import ModelInfo, read_model
from endosdk.runtime.postprocess import Limits, Maps, postprocess
from endosdk.runtime.rectify import Frame, RectifyStage, check_pair
from endosdk.runtime.result import DepthResult, Timings, status_of
from endosdk.runtime.session import PROVIDERS, Buffers, StereoSession, padded, provider_name
from endosdk.runtime.stream import InFlight

# Frames in flight on an accelerator: one is rectified while the network works on another.
ACCELERATOR_LANES = 2


@dataclass(frozen=True)
class _Slot:
    """What one frame in work needs: maps of the lens, which slots share, and the network's memory."""

    stage: RectifyStage
    buffers: Buffers


@dataclass(frozen=True)
class _Rectified:
    """What is known of a frame whose pictures lie ready for the network."""

    milliseconds: float
    same_frames: bool  # both cameras gave the same bytes


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
        threads: processor threads for every stage, 1 to 256; default is the number of cores this process may use, but
            at most 8.
        channel_order: ``rgb`` or ``bgr``, the order of colour frames. Gray frames need none.
        network_size: (width, height) the network works at, px; smaller is faster and widens the range of disparities in
            px of the frame. Default: at most as wide as the model's ``inference_width``. For a model that names
            none: the size of the frames up to a width of 960, and 720 px wide for wider frames, whose disparities
            would lie beyond the range. All outputs keep the size of the frame.
        min_confidence: below it a pixel has no answer, 0..1. With 0 every pixel counts as trusted, those of a covered
            camera too: `Status` then tells nothing.
        depth_range_mm: (nearest, farthest) depth that counts as an answer; needs a calibration.
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
        if calibration is not None and not isinstance(calibration, StereoCalibration):
            raise InvalidArgument("calibration", "must be a StereoCalibration", type(calibration).__name__)
        self._order = check_order(channel_order)
        limits = (check_share("min_confidence", min_confidence), *check_range(depth_range_mm, calibration is not None))
        self._network_size = None if network_size is None else check_size(network_size)
        self._threads = check_threads(threads)
        self._calibration = calibration
        self._geometry = None if calibration is None else calibration.rectification()
        provider = provider_name(provider)
        integer_units = provider == PROVIDERS["cpu"] and _core.has_integer_units()
        self._session = StereoSession(
            read_model(model, integer_units=integer_units), provider=provider, threads=self._threads, spinning=spinning
        )
        self._limits = Limits(*limits, self._session.info.max_candidate_disparity)
        self._slot: _Slot | None = None  # of predict
        self._latest: _Slot | None = None
        self._full_stage: RectifyStage | None = None  # of rectify
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
            _core.set_threads(self._threads)
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
        the stream and leaves the estimator usable. Leaving the loop, or closing the iterator, ends the stream too: what
        is being computed is waited for, a source that does not answer is not.

        Raises:
            InvalidArgument: ``source`` is neither, or its frames are no pairs of one size.
        """
        if callable(source):
            return self._stream(_drawn_from(source), reuse)
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

        def take(number: int, pair: tuple[Any, Any]) -> _Rectified:
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

        def compute(number: int, rectified: _Rectified) -> _Answer:
            slot = ring[number % len(ring)]
            own = maps[number % len(maps)] if reuse else self._new_maps(slot.stage.frame_size)
            return self._infer(session, slot, own, rectified)

        for answer in InFlight(pairs, lanes, take, compute).results():
            with self._lock:
                result = self._result(answer)
            yield result

    def _rectify(self, slot: _Slot, left: Frame, right: Frame) -> _Rectified:
        """Write the network's pictures."""
        started = time.perf_counter()
        slot.stage(left, right, slot.buffers.left, slot.buffers.right, self._order)
        same = _core.same_pixels(left, right)
        return _Rectified(1e3 * (time.perf_counter() - started), same)

    def _infer(self, session: StereoSession, slot: _Slot, maps: Maps, rectified: _Rectified) -> _Answer:
        """Run the network on rectified pictures and fill the maps."""
        started = time.perf_counter()
        session.run(slot.buffers)
        inferred = time.perf_counter()
        answered = postprocess(slot.buffers, slot.stage, self._geometry, self._limits, maps, rectified.same_frames)
        finished = time.perf_counter()
        timings = Timings(rectified.milliseconds, 1e3 * (inferred - started), 1e3 * (finished - inferred))
        return _Answer(slot, maps, answered, timings)

    def rectify(self, left: Any, right: Any) -> tuple[Frame, Frame]:
        """Return a pair's rectified pictures at the size of the frame: RGB uint8 [H, W, 3] each.

        Every map of the pair's result lies over the left one. Frames as `predict` takes them; what the network is shown
        is smaller as a rule, see `rectified_pair`.
        """
        left, right = check_pair(left, right)
        height, width = left.shape[:2]
        views = np.empty((2, 3, height, width), np.uint8)
        with self._lock:
            _core.set_threads(self._threads)
            if self._full_stage is None or self._full_stage.frame_size != (width, height):
                self._full_stage = RectifyStage((width, height), self._calibration, (width, height))
            self._full_stage(left, right, views[0], views[1], self._order)
        rectified_left, rectified_right = (np.ascontiguousarray(view.transpose(1, 2, 0)) for view in views)
        return rectified_left, rectified_right

    def rectified_pair(self) -> tuple[Frame, Frame]:
        """Return copies of the latest frame's rectified pictures, as the network saw them: RGB uint8 [h, w, 3] each.

        The right view of a rectified rig with positive doffs lies doffs further left than it came, here and in
        `rectify`; disparities are those of the pictures that came.
        """
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
        inference_width = self._session.info.inference_width or 0
        network_size = self._network_size or _core.usual_network_size(width, height, inference_width)
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
        if not isinstance(out, DepthResult):
            raise InvalidArgument("out", "must be a DepthResult of this estimator", type(out).__name__)
        width, height = size
        if out.disparity.shape != (height, width):
            raise InvalidArgument("out", f"must be of frames of this size, {height, width}", out.disparity.shape)
        if (out.depth_map is None) != (self._geometry is None):
            has = "with" if self._geometry is not None else "without"
            raise InvalidArgument("out", f"must be of an estimator {has} a calibration, as this one", "the other kind")
        maps = Maps(out.disparity, out.confidence, out.reasons, out.depth_map, out.sigma_map)
        if not maps.writeable:
            raise InvalidArgument("out", "must have maps that can be written", "read-only maps")
        return maps

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


def _drawn_from(function: Callable[[], tuple[Any, Any] | None]) -> Iterator[tuple[Any, Any]]:
    # Not iter(function, None), which would compare what the function returns, an array perhaps, with None.
    while (pair := function()) is not None:
        yield pair
