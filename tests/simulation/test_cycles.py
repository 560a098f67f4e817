"""Cycles sees the scene of the rasteriser at the same depth; where Blender is missing, errors say how to get it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from endosdk.commands.cli import main
from endosdk.errors import RendererUnavailable
from endosdk.simulation.camera import RectifiedPair, StereoCamera, rectified_pair
from endosdk.simulation.cycles.blender import CyclesRenderer
from endosdk.simulation.cycles.environment import find_python
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.sample import DisparityLimits, Placed, draw_light, draw_truth, load_scene, place_camera
from endosdk.simulation.scene import draw_scene

CAMERA = StereoCamera(96, 72, 40.0, 10.0)
LIMITS = DisparityLimits(0.3, 7.0)


@pytest.fixture(scope="module")
def cycles(renderer: Rasteriser) -> Iterator[CyclesRenderer]:
    try:
        python = find_python()
    except RendererUnavailable as error:
        pytest.skip(f"no Blender: {error}")
    one = CyclesRenderer(python, samples=4)
    yield one
    one.close()


@pytest.fixture(scope="module")
def scene(cycles: CyclesRenderer) -> tuple[Placed, RectifiedPair, tuple[np.ndarray, np.ndarray]]:
    """A stomach without a tool, loaded by both renderers, with the truth of both views."""
    pair = rectified_pair(CAMERA)
    drawn = draw_scene(2, "stomach")
    load_scene(cycles, drawn, CAMERA)
    placed, truth = draw_truth(cycles, place_camera(cycles, drawn, CAMERA, LIMITS), pair, LIMITS)
    return placed, pair, truth


def test_both_renderers_agree_on_depth_at_pixel_centres(cycles: CyclesRenderer, scene: tuple) -> None:
    placed, pair, truth = scene
    middle = (0.5 * pair.baseline_mm, 0.0, 0.0)
    for view, disparity in zip((pair.left, pair.right), truth, strict=True):
        # What the renderer hands over for a picture, with the depth that Cycles itself finds asked for.
        cycles._load(placed.pose, placed.scale, placed.scene.lamp, middle, placed.reach)
        depth = cycles._draw(view, depth=True)
        assert np.quantile(np.abs(pair.disparity(depth) - disparity), 0.99) < 1e-3


def test_both_renderers_draw_the_same_picture_at_the_same_place(
    cycles: CyclesRenderer, renderer: Rasteriser, scene: tuple
) -> None:
    placed, pair, truth = scene
    load_scene(renderer, placed.scene, CAMERA)
    traced, drawn = (draw_light(one, pair.left, placed, pair, truth[0], (placed.pose,)) for one in (cycles, renderer))
    assert traced.shape == (72, 96, 3)
    assert np.isfinite(traced).all()
    red, green, blue = np.median(traced, (0, 1))
    assert red > 1.5 * max(green, blue)
    # Red is the tissue; what remains of it without the slow change of light is texture, and must lie at one place.
    fine = [np.log(np.clip(light[..., 0], 1e-3, 1.0)) for light in (traced, drawn)]
    fine = [(light - np.mean(light))[4:-4, 4:-4] for light in fine]
    likeness = {}
    for shift in (-2, -1, 0, 1, 2):
        likeness[shift] = np.corrcoef(np.diff(np.roll(fine[0], shift, 1)).ravel(), np.diff(fine[1]).ravel())[0, 1]
    assert max(likeness, key=lambda shift: likeness[shift]) == 0
    assert likeness[0] > 0.3


def test_a_stopped_blender_is_named(cycles: CyclesRenderer) -> None:
    other = CyclesRenderer(find_python(), samples=1)
    other._worker.kill()
    other._worker.wait()
    with pytest.raises(RendererUnavailable, match="Blender has stopped"):
        other._ask({"load": "/nowhere"})
    other.close()


@pytest.mark.parametrize(("python", "rule"), [("/nonexistent/python", "--setup-cycles"), (sys.executable, "bpy")])
def test_missing_blender_says_how_to_get_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], python: str, rule: str
) -> None:
    out = tmp_path / "set"
    words = ["simulate", "--renderer", "cycles", "--pairs", "1", "--cycles-python", python, "--out", str(out)]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert rule in said
    assert "RENDERER_UNAVAILABLE" in said
    assert not out.exists()


def test_a_program_that_is_no_python_is_refused(tmp_path: Path) -> None:
    strange = tmp_path / "python"
    strange.write_text("not a program")
    with pytest.raises(RendererUnavailable, match=r"^cycles_python: "):
        find_python(strange)
