"""What a run does about the process it is in: the others that torchrun started, and the signal that ends it."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import torch
import torch.distributed as dist


@contextmanager
def stop_signal() -> Iterator[None]:
    """Let a polite kill end the run as Ctrl-C does: with a checkpoint. A host that answers it keeps its answer."""
    main = threading.current_thread() is threading.main_thread()  # only it may set signals
    if not main or signal.getsignal(signal.SIGTERM) != signal.SIG_DFL:
        yield
        return

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


class process_group:
    """Join the processes that torchrun started, and leave them at the end; alone when there are none."""

    def __enter__(self) -> tuple[int, int]:
        self.joined = int(os.environ.get("WORLD_SIZE", "1")) > 1
        if not self.joined:
            return 0, 1
        dist.init_process_group("nccl" if torch.cuda.is_available() else "gloo")
        return dist.get_rank(), dist.get_world_size()

    def __exit__(self, *_: object) -> None:
        if self.joined:
            dist.destroy_process_group()
