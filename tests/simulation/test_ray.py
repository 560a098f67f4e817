"""A set rendered on a Ray cluster is the same set, even when a worker is killed on the way."""

from __future__ import annotations

from pathlib import Path

from endosdk.commands.cli import main
from endosdk.datasets.layouts import open_dataset
from endosdk.datasets.verifier import verify_dataset
from tests.ray_cluster import a_worker_killed, ray_cluster, ray_quiet

WORDS = (
    *("--organ", "stomach", "--seed", "3", "--width", "64", "--height", "48", "--focal", "27", "--max-disparity", "6"),
    *("--min-disparity", "0.2", "--pairs", "3"),
)


@ray_quiet
def test_a_killed_worker_loses_nothing(renderer: object, tmp_path: Path) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    assert main(["simulate", "--out", str(here), *WORDS]) == 0
    with ray_cluster(), a_worker_killed(there, "train/*"):
        assert main(["simulate", "--out", str(there), "--ray", "--workers", "2", *WORDS]) == 0
    assert open_dataset(there, "train").sha256 == open_dataset(here, "train").sha256
    assert all(fault is None for _, fault in verify_dataset(there))
