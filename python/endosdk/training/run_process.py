"""What a run does about the process it is in: it joins the others that torchrun started."""

from __future__ import annotations

import os

import torch
import torch.distributed as dist


class process_group:
    """Join the processes that torchrun started, and leave them at the end; alone when there are none."""

    def __init__(self, device: torch.device) -> None:
        self.device = device

    def __enter__(self) -> tuple[int, int]:
        self.joined = int(os.environ.get("WORLD_SIZE", "1")) > 1
        if not self.joined:
            return 0, 1
        dist.init_process_group("nccl" if self.device.type == "cuda" else "gloo")
        return dist.get_rank(), dist.get_world_size()

    def __exit__(self, *_: object) -> None:
        if self.joined:
            dist.destroy_process_group()
