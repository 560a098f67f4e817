"""What a real rig would see: rectification by its own calibration gives back the sample that has the truth."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from endosdk.calibration.rig import StereoCalibration
from endosdk.commands.cli import main
from endosdk.datasets.layouts import open_dataset
from endosdk.simulation.camera import StereoCamera
from endosdk.simulation.unrectified import draw_rig, straight_rays


@pytest.mark.parametrize("seed", range(5))
def test_rays_are_the_exact_inverse_of_the_lens(seed: int) -> None:
    rig = draw_rig(seed, StereoCamera())
    pixels = np.stack(np.meshgrid(np.linspace(0, 959, 25), np.linspace(0, 719, 19)), -1).reshape(-1, 2)
    for matrix, lens in ((rig.left_matrix, rig.left_distortion), (rig.right_matrix, rig.right_distortion)):
        rays = np.c_[straight_rays(pixels, matrix, lens), np.ones(len(pixels))]
        bent, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), matrix, lens)
        np.testing.assert_allclose(bent[:, 0], pixels, atol=1e-3)


def test_a_rig_is_misaligned_and_the_same_for_the_same_seed() -> None:
    rig = draw_rig(1, StereoCamera())
    assert rig == draw_rig(1, StereoCamera())
    assert rig != draw_rig(2, StereoCamera())
    assert not rig.is_rectified


def misfit(raw: np.ndarray, ideal: np.ndarray, shift: tuple[float, float]) -> float:
    """Median difference of fine structure between a rectified raw view and the ideal one moved by ``shift`` px."""
    height, width = ideal.shape[:2]
    moved = cv2.warpAffine(ideal, np.array([[1, 0, shift[0]], [0, 1, shift[1]]], np.float32), (width, height))
    fine = [cv2.GaussianBlur(i, (0, 0), 1.0) - cv2.GaussianBlur(i, (0, 0), 6.0) for i in (raw, moved)]
    return float(np.abs(fine[0] - fine[1])[30:-30, 30:-30].mean())


def test_rectified_raw_views_fall_onto_the_sample(renderer: object, tmp_path: Path) -> None:
    out = tmp_path / "set"
    size = ("--width", "480", "--height", "360", "--focal", "200", "--max-disparity", "35", "--min-disparity", "1")
    words = ["simulate", "--organ", "intestine", "--rig", "raw", "--pairs", "1", "--seed", "6", "--out", str(out)]
    assert main([*words, *size]) == 0
    sample = open_dataset(out, "train")[0]
    folder = out / "train" / sample.id
    rig = StereoCalibration.load(folder / "rig.json")
    geometry = rig.rectification()
    assert sample.focal_px == geometry.focal_px
    assert sample.baseline_mm == geometry.baseline_mm
    assert np.nanmax(sample.disparity) <= 35
    for name, ideal, matrix, lens, turn, view in (
        ("raw_left.png", sample.left, rig.left_matrix, rig.left_distortion, geometry.R1, geometry.P1),
        ("raw_right.png", sample.right, rig.right_matrix, rig.right_distortion, geometry.R2, geometry.P2),
    ):
        raw = cv2.imread(str(folder / name))[..., 1]
        maps = cv2.initUndistortRectifyMap(matrix, lens, turn, view[:, :3], (480, 360), cv2.CV_32FC1)
        flat = cv2.remap(raw, *maps, cv2.INTER_LINEAR).astype(np.float32)
        target = np.ascontiguousarray(ideal[..., 1]).astype(np.float32)
        errors = {s: misfit(flat, target, s) for s in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))}
        assert min(errors, key=lambda shift: errors[shift]) == (0, 0)
        assert misfit(raw.astype(np.float32), target, (0, 0)) > errors[0, 0]
