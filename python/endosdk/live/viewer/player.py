"""Plays a source through an estimator on a thread of its own; may be paused, stepped and recorded."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from endosdk.errors import EndoError, InvalidArgument
from endosdk.io.bounded_read import is_there
from endosdk.live.answers import answers
from endosdk.live.frames import Frame, Picture
from endosdk.live.recording.recorder import Recorder
from endosdk.live.sources.source import Source, log
from endosdk.runtime.estimator import DepthEstimator
from endosdk.runtime.result import DepthResult
from endosdk.runtime.threads import start_thread

RATE_WINDOW = 20  # frames whose times give the rate
CLOSING_PATIENCE_S = 5.0


@dataclass(frozen=True, eq=False)
class Shown:
    """The latest answer."""

    frame: Frame
    result: DepthResult
    turn: int  # counts answers, those after a restart too
    delay_ms: float  # from drawing the frame to its answer
    frames_per_second: float


class Player:
    """Computes depth of ``source`` as fast as it comes: a file no faster than it was taken.

    ``temporal`` is that of `DepthEstimator.stream`. `latest` is the newest answer. ``error`` is what ended the source
    or a recording, also what a listener or a tagger raised, None again after a restart; ``ended`` says that there are
    no more frames.
    """

    def __init__(
        self, estimator: DepthEstimator, source: Source, *, playing: bool = True, temporal: bool = False
    ) -> None:
        self.estimator = estimator
        self.source = source
        self._temporal = temporal
        self.latest: Shown | None = None
        self.error: Exception | None = None
        self.ended = False
        self.listeners: list[Callable[[Shown], None]] = []  # called with every answer, on the player's thread
        self._change = threading.Condition()  # guards what follows, up to the answers done
        self._playing = playing
        self._steps = 0
        self._begun = False
        self._closed = False
        self._restart = False
        self._done: deque[float] = deque(maxlen=RATE_WINDOW)  # when the latest answers came
        self._waiting_since = time.perf_counter()  # for an answer
        self._drawn: dict[int, float] = {}  # when a frame in work was drawn; single operations, each atomic
        self._adding = threading.Lock()  # guards the recorder: none is taken away while it adds an answer
        self._recorder: Recorder | None = None
        self._thread = threading.Thread(target=self._play, name="endosdk-player", daemon=True)

    def start(self) -> None:
        """Begin, if that was not done before."""
        with self._change:
            if not self._begun:
                self._waiting_since = time.perf_counter()
                start_thread(self._thread)
                self._begun = True

    @property
    def playing(self) -> bool:
        """Whether frames are drawn without being asked for one by one."""
        return self._playing

    @property
    def recording(self) -> Path | None:
        """Where the answers are being recorded, None where they are not."""
        recorder = self._recorder
        return None if recorder is None else recorder.out

    @property
    def problem(self) -> str | None:
        """What `error` says, for people; None where there is none."""
        error = self.error
        if error is None:
            return None
        return str(error) if isinstance(error, EndoError) else f"{type(error).__name__}: {error}"

    @property
    def silent_s(self) -> float:
        """How long no answer has come, s, although frames are drawn: a source that stands still shows nothing new."""
        with self._change:
            drawing = self._begun and self._playing and not self.ended
            return time.perf_counter() - self._waiting_since if drawing else 0.0

    def play(self) -> None:
        """Go on."""
        self._set(playing=True)

    def pause(self) -> None:
        """Draw no further frame. Those in work are finished."""
        self._set(playing=False)

    def step(self) -> None:
        """Pause, and draw one more frame."""
        with self._change:
            self._steps += 1
        self._set(playing=False)

    def restart(self) -> None:
        """Begin again at the first frame, where the source can.

        A recording that has frames ends here: its time cannot run backwards. Raises what `Recorder.close` raises, and
        InvalidArgument where the source can be read once only.
        """
        if not self.source.again:
            raise InvalidArgument("restart", "must be of a source that can be read again", self.source.word)
        with self._adding:
            over = self._recorder if self._recorder is not None and self._recorder.begun else None
            if over is not None:
                self._recorder = None
            with self._change:
                self._restart = True
        self._set(playing=True)
        self._finish(over, source_ended=False)

    def record(self, out: Path | None) -> None:
        """Record every answer from now on into a new folder; None ends it. Raises what `Recorder` raises."""
        recorder = None
        if out is not None:
            if is_there(out):
                raise InvalidArgument("out", "must not exist yet", out)
            recorder = Recorder(out, self.estimator, self.source, temporal=self._temporal)
        with self._adding:
            self._recorder, before = recorder, self._recorder
        whole = before is not None and before.first_number == 0 and self.ended and self.error is None
        self._finish(before, source_ended=whole)

    def close(self) -> None:
        """End the thread, the recording and the source."""
        with self._change:
            self._closed = True
            self._change.notify_all()
        if self._begun:
            self._thread.join(CLOSING_PATIENCE_S)
        self.record(None)
        self.source.close()

    def left_view(self, shown: Shown) -> Picture:
        """Return the left view of an answer, rectified: what its maps belong to."""
        return self.estimator.rectify(shown.frame.left, shown.frame.right)[0]

    def _set(self, playing: bool) -> None:
        with self._change:
            self._playing = playing
            self._done.clear()  # the time of a pause is no rate
            self._waiting_since = time.perf_counter()
            self._change.notify_all()

    def _play(self) -> None:
        turn = 0
        while not self._closed:
            self.ended, self._restart, self.error = False, False, None
            try:
                for frame, result in answers(self.estimator, self._gated(), temporal=self._temporal):
                    turn += 1
                    self._show(frame, result, turn)
            except EndoError as error:
                self.error = error
            except Exception as error:  # listeners and taggers are the user's, and may raise anything
                log.exception("the player ends")
                self.error = error
            self.ended = not self._closed  # a player that is closed has not seen the end
            with self._change:
                self._change.wait_for(lambda: self._restart or self._closed)

    def _show(self, frame: Frame, result: DepthResult, turn: int) -> None:
        now = time.perf_counter()
        with self._change:
            self._waiting_since = now
            self._done.append(now)
            span = self._done[-1] - self._done[0]
            rate = (len(self._done) - 1) / span if span > 0 else 0.0
        delay = 1e3 * (now - self._drawn.pop(frame.number, now))
        self.latest = Shown(frame, result, turn, delay, rate)
        for listener in self.listeners:
            listener(self.latest)
        with self._adding:
            if self._recorder is not None and not self._restart:  # else it was in work before the restart
                self._add(self._recorder, frame, result)

    def _add(self, recorder: Recorder, frame: Frame, result: DepthResult) -> None:
        """Record an answer. A full disk ends the recording, and neither what it holds nor the view."""
        try:
            recorder.add(frame, result)
        except EndoError as error:
            self.error = error
            self._recorder = None
            recorder.stop()

    def _gated(self) -> Iterator[Frame]:
        """Yield the frames of the source when it is their time."""
        started: tuple[float, int] | None = None  # clock and stamp that belong together
        frames, frame = iter(self.source), None
        while True:
            with self._change:
                waited = not (self._playing or self._steps)
                self._change.wait_for(lambda: self._playing or self._steps or self._over)
                if self._over:
                    return
                stepped = self._steps > 0
                self._steps = max(0, self._steps - 1)
            if frame is None:  # drawn now, not before a pause: the newest of a camera would be as old as the pause
                frame = next(frames, None)
            if frame is None:
                return
            with self._change:
                if started is None or waited or stepped:
                    started = time.perf_counter(), frame.stamp_ns
                early = started[0] + (frame.stamp_ns - started[1]) / 1e9 - time.perf_counter()
                if not self.source.live and early > 0:
                    self._change.wait_for(lambda: self._over or not self._playing, early)
                    if self._over or not self._playing:
                        continue
            self._drawn[frame.number] = time.perf_counter()
            yield frame
            frame = None

    @property
    def _over(self) -> bool:
        return self._closed or self._restart

    def _finish(self, recorder: Recorder | None, *, source_ended: bool) -> None:
        """Complete a recording. What fails is the `error` too: whoever asked may not see what is raised."""
        if recorder is None:
            return
        try:
            with recorder:
                recorder.close(source_ended=source_ended)
        except EndoError as error:
            self.error = error
            raise
