"""Threads that the compiled parts start: how they are called, and the function of a host that is shown each of them.

Linux gives a new thread the name of the one that starts it. So a name that no other thread has tells, without a race,
which threads a call has started.
"""

from __future__ import annotations

import itertools
import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from endosdk.errors import InvalidArgument

ThreadHook = Callable[[int, str], object]  # called with the number of a thread and its name

SESSION = "endosdk-session"
# The compiled core names its threads itself, before the call that starts them returns.
KERNELS, STREAM, FOLLOW = "endosdk-kernels", "endosdk-stream", "endosdk-follow"

_TASKS = Path("/proc/self/task")
_marks = itertools.count()
_showing = threading.Lock()


def check_hook(hook: Any) -> ThreadHook | None:
    """Return a function that is to be shown threads. Raises InvalidArgument where it cannot be."""
    if hook is None:
        return None
    if not callable(hook):
        raise InvalidArgument("thread_started", "must be a function of a number and a name", repr(hook))
    if not os.access(_own_name(), os.W_OK):
        raise InvalidArgument("thread_started", "needs Linux with /proc/self/task", os.name)
    checked: ThreadHook = hook
    return checked


@contextmanager
def session_threads(hook: ThreadHook | None) -> Iterator[None]:
    """Name what starts meanwhile, from this thread, `SESSION`, and show it once all is done."""
    own, mark = _own_name(), f"endo{os.getpid() % 10**5}-{next(_marks) % 10**4}"
    name = _read(own)
    if not name or not _write(own, mark):
        yield  # a system that names no threads
        return
    try:
        yield
    finally:
        _write(own, name)
        started = [task for task in _TASKS.iterdir() if _read(task / "comm") == mark]
        for task in started:
            _write(task / "comm", SESSION)
    _show(hook, {int(task.name): SESSION for task in started})


@contextmanager
def shown(hook: ThreadHook | None, *names: str) -> Iterator[None]:
    """Show the threads of these names that start meanwhile, once all is done."""
    if hook is None:
        yield
        return
    with _showing:
        before = _threads_of(names)
        yield
        started = {number: name for number, name in _threads_of(names).items() if number not in before}
    _show(hook, started)


def show_this_thread(hook: ThreadHook | None, name: str) -> None:
    """Name this thread, which Python has started, and show it."""
    _write(_own_name(), name)
    _show(hook, {threading.get_native_id(): name})


def _show(hook: ThreadHook | None, threads: dict[int, str]) -> None:
    if hook is not None:
        for number, name in sorted(threads.items()):
            hook(number, name)


def _threads_of(names: tuple[str, ...]) -> dict[int, str]:
    found = {int(task.name): _read(task / "comm") for task in _TASKS.iterdir()}
    return {number: name for number, name in found.items() if name in names}


def _own_name() -> Path:
    return _TASKS / str(threading.get_native_id()) / "comm"


def _read(file: Path) -> str:
    try:
        return file.read_text().rstrip("\n")
    except (OSError, UnicodeDecodeError):  # the thread has ended meanwhile, or has another's name
        return ""


def _write(file: Path, name: str) -> bool:
    try:
        file.write_text(name)
    except OSError:
        return False
    return True
