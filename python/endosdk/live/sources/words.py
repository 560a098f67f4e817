"""What a source's word means: the table from words to readers."""

from __future__ import annotations

from pathlib import Path

from endosdk.errors import EndoError, InvalidArgument, SourceFailed
from endosdk.io.bounded_read import is_there
from endosdk.io.picture_pairs import has_pictures
from endosdk.live.recording.recording import Recording, is_recording
from endosdk.live.sources.bag import Bag, is_bag
from endosdk.live.sources.newest import Newest
from endosdk.live.sources.source import Source, SourceOptions

VIDEO_DEVICE = "/dev/video"
RULE = (
    "must be a folder with left and right, LEFT,RIGHT, a video, /dev/videoN, - (standard input), "
    "a recording or a ROS bag"
)


STREAM_RULE = (
    "must come through standard input where it is a stream of the network: "
    "ffmpeg -i ADDRESS -f yuv4mpegpipe - | endosdk view -"
)


def opened(word: str | Path | tuple[str | Path, str | Path], options: SourceOptions) -> Source:
    """Return the source that ``word`` names."""
    try:
        source = _opened(_parts(word), options)
    except EndoError:
        raise
    except OSError as error:  # a folder that may not be read
        raise SourceFailed("source", "must be readable", f"{word} ({error.strerror or error})") from error
    if options.queue == "newest" or (options.queue == "auto" and source.live):
        return Newest(source)
    return source


def two_folders(word: str | Path) -> tuple[Path, Path] | None:
    """Return the folders of left and right views that a word names: LEFT,RIGHT, or one that holds both; else None.

    A folder that holds pictures itself is returned twice: `pair_pictures` finds the sides in their names.
    """
    return _folders_of(_parts(word))


def _folders_of(words: list[str]) -> tuple[Path, Path] | None:
    left, right = (Path(words[0], side) for side in ("left", "right")) if len(words) == 1 else map(Path, words)
    if _is_folder(left) and _is_folder(right):
        return left, right
    folder = Path(words[0])
    return (folder, folder) if len(words) == 1 and _is_folder(folder) and has_pictures(folder) else None


def _parts(word: object) -> list[str]:
    """Return the one or two names in a word. A file whose name has a comma is one, and so is an address."""
    words = [str(part) for part in word] if isinstance(word, tuple | list) else [str(word)]
    if not isinstance(word, str | Path | tuple | list) or not all(words):
        raise InvalidArgument("source", RULE, repr(word))
    if len(words) == 1 and words[0].count(",") == 1 and not (is_there(Path(words[0])) or "://" in words[0]):
        words = words[0].split(",")
    if len(words) > 2 or not all(words):
        raise InvalidArgument("source", RULE, repr(word))
    return words


def _opened(words: list[str], options: SourceOptions) -> Source:
    if options.raw is not None and words != ["-"]:
        raise InvalidArgument("raw", "describes the pixels of standard input, so the source must be -", words)
    if options.bits is not None and _folders_of(words) is None:
        raise InvalidArgument("bits", "is of picture files, so the source must be folders of pictures", words)
    if len(words) == 2:
        return _opened_two(words, options)
    (word,) = words
    path = Path(word)
    if word == "-":
        from endosdk.live.sources.video_input import standard_input

        return standard_input(options)
    if "://" in word:
        raise InvalidArgument("source", STREAM_RULE, repr(word))
    if word.startswith(VIDEO_DEVICE):
        from endosdk.live.sources.v4l2 import Camera

        return Camera(word, options)
    if is_there(path) and is_bag(path):
        return Bag(path, options)
    if _is_folder(path):
        return Recording(path, options) if is_recording(path) else _opened_folder(path, options)
    if not _is_file(path):
        raise InvalidArgument("source", RULE, repr(word))
    if is_recording(path):
        return Recording(path, options)
    from endosdk.live.sources.video_input import VideoFile

    return VideoFile(path, options)


def _opened_folder(path: Path, options: SourceOptions) -> Source:
    folders = two_folders(path)
    if folders is not None:
        from endosdk.live.sources.folders import Folders

        return Folders(*folders, options)
    raise InvalidArgument("source", f"{RULE}; this folder is none of them", repr(str(path)))


def _opened_two(words: list[str], options: SourceOptions) -> Source:
    left, right = (Path(word) for word in words)
    if _is_folder(left) and _is_folder(right):
        from endosdk.live.sources.folders import Folders

        return Folders(left, right, options)
    if all(word.startswith(VIDEO_DEVICE) for word in words):
        from endosdk.live.sources.v4l2 import TwoCameras

        return TwoCameras(words[0], words[1], options)
    if _is_file(left) and _is_file(right):
        from endosdk.live.sources.video_input import TwoVideos

        return TwoVideos(left, right, options)
    raise InvalidArgument("source", "two names must be two folders, two files or two video devices", words)


def _is_folder(path: Path) -> bool:
    return is_there(path) and path.is_dir()


def _is_file(path: Path) -> bool:
    return is_there(path) and path.is_file()
