"""Where stereo frames come from: folders, videos, cameras, standard input, recordings and ROS bags."""

from __future__ import annotations

from pathlib import Path

from endosdk.live.sources.source import Layout, Queue, Scan, Source, SourceOptions

__all__ = ["Layout", "Queue", "Scan", "Source", "open_source"]


def open_source(
    word: str | Path | tuple[str | Path, str | Path],
    *,
    layout: Layout = "side-by-side",
    queue: Queue = "auto",
    scan: Scan = "auto",
    rate: float | None = None,
    raw: str | None = None,
    bits: int | None = None,
    swap: bool = False,
    gap: int = 0,
) -> Source:
    """Open a source of stereo frames by one word.

    Args:
        word: what to read. A folder that holds ``left`` and ``right``, or ``LEFT,RIGHT``: two folders of pictures. One
            folder of pictures whose names differ in the side alone, such as ``f7_left.png`` and ``f7_right.png``. A
            video file, or two. ``/dev/video0``: a camera or capture card, or two. ``-``: standard input, Y4M or (with
            ``raw``) bare pixels. A recording of ``endosdk run``. A ``.mcap`` file, or a ROS 1 or 2 bag. A tuple of two
            is the same as two words with a comma.
        layout: how one picture holds two views: ``side-by-side``, ``top-bottom``, ``rows`` (the left view has the even
            rows, counted from 0), or the same with ``-half``: each view is squeezed to half its width or height, and is
            stretched again. Two files hold one view each.
        queue: ``every`` frame, or the ``newest`` alone while the reader is busy; `Source.dropped` counts the others.
            ``auto`` is ``newest`` for a camera and ``every`` for all else.
        scan: ``auto`` deinterlaces the frames that say they are interlaced, ``interlaced`` all, ``progressive`` none.
        rate: frames a second, where the source has no time stamps of its own: pictures in folders, and bare pixels.
            25 by default. A camera is asked for this rate.
        raw: pixels of standard input that has no header: ``FORMAT:WxH``, such as ``uyvy422:1920x1080``, ``nv12:...`` or
            ``gray:...``, with FFmpeg's names.
        bits: how many of their 16 bits picture files in folders use, 10, 12 or 16; see `read_frame`. None: they have 8.
        swap: exchange the views of every frame: the right eye is on the left, on top, or named first.
        gap: columns or rows between the views of a picture, px, such as 45 of HDMI frame packing at 1920x2205.

    Raises:
        InvalidArgument: the word names no source, or an option does not fit it.
        SourceFailed: the source is there and cannot be read.
        DependencyMissing: the extra ``live`` is not installed.
    """
    from endosdk.live.sources.words import opened

    options = SourceOptions(layout=layout, queue=queue, scan=scan, rate=rate, raw=raw, bits=bits, swap=swap, gap=gap)
    return opened(word, options)
