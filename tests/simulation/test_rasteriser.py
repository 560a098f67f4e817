"""Depth is planar, exact and taken at pixel centres; missing graphics are named with their remedy."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys

import numpy as np
import pytest

from endosdk.errors import DependencyMissing
from endosdk.simulation.camera import Pose, StereoCamera, View, aligned_pair, rectified_pair
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.rasteriser import Rasteriser

CAMERA = StereoCamera(width=160, height=120, focal_px=90.0, baseline_mm=8.0)
AT_ORIGIN = Pose(np.zeros(3), np.eye(3))


def plane(normal: tuple[float, float, float], distance: float) -> Mesh:
    """A large square in the plane ``normal . p = distance``."""
    axis = np.asarray(normal, float) / np.linalg.norm(normal)
    side = np.cross(axis, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side)
    other = np.cross(axis, side)
    corners = [axis * distance + 3000.0 * (a * side + b * other) for a in (-1, 1) for b in (-1, 1)]
    flat = np.zeros((4, 3), np.float32)
    triangles = np.array([[0, 1, 2], [1, 3, 2]], np.uint32)
    return Mesh(np.asarray(corners, np.float32), flat, flat, flat[:, :2], flat[:, 0], triangles, (1.0, 1.0))


def expected_depth(view: View, normal: tuple[float, float, float], distance: float) -> np.ndarray:
    """Planar depth of the plane along the ray through each pixel centre."""
    axis = np.asarray(normal, float) / np.linalg.norm(normal)
    columns, rows = np.meshgrid(np.arange(view.width), np.arange(view.height))
    rays = np.stack([columns, rows, np.ones_like(rows)], -1) @ np.linalg.inv(view.matrix).T
    return (distance + axis @ view.translation) / (rays @ axis)


@pytest.fixture
def empty(renderer: Rasteriser) -> Rasteriser:
    renderer.clear()
    return renderer


def test_a_plane_that_faces_the_camera_has_one_depth(empty: Rasteriser) -> None:
    empty.add(plane((0, 0, 1), 100.0))
    depth = empty.depth(rectified_pair(CAMERA).left, AT_ORIGIN, 1.0)
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, 100.0, rtol=1e-6)


@pytest.mark.parametrize("normal", [(0.5, 0.0, 1.0), (0.2, -0.6, 1.0)])
def test_a_tilted_plane_is_exact_at_pixel_centres_of_both_views(
    empty: Rasteriser, normal: tuple[float, float, float]
) -> None:
    empty.add(plane(normal, 100.0))
    pair = rectified_pair(CAMERA)
    for view in (pair.left, pair.right):
        depth = empty.depth(view, AT_ORIGIN, 1.0)
        error = np.abs(pair.disparity(depth) - pair.disparity(expected_depth(view, normal, 100.0).astype(np.float32)))
        assert error.max() < 1e-4


def test_an_off_centre_principal_point_is_respected(empty: Rasteriser) -> None:
    empty.add(plane((0.5, 0.3, 1.0), 100.0))
    matrix = np.array([[90.0, 0, 95.5], [0, 80.0, 41.0], [0, 0, 1]])
    view = aligned_pair(matrix, 160, 120, 8.0).left
    np.testing.assert_allclose(
        empty.depth(view, AT_ORIGIN, 1.0), expected_depth(view, (0.5, 0.3, 1.0), 100.0), rtol=1e-5
    )


def test_scale_enlarges_the_organ_about_the_left_camera(empty: Rasteriser) -> None:
    empty.add(plane((0, 0, 1), 100.0))
    pose = Pose(np.array([3.0, -2.0, 40.0]), np.eye(3))
    np.testing.assert_allclose(empty.depth(rectified_pair(CAMERA).left, pose, 2.5), 150.0, rtol=1e-6)


def test_nothing_is_infinitely_far(empty: Rasteriser) -> None:
    pair = rectified_pair(CAMERA)
    depth = empty.depth(pair.left, AT_ORIGIN, 1.0)
    assert np.isposinf(depth).all()
    assert np.isnan(pair.disparity(depth)).all()


def test_a_renderer_goes_on_after_another_came_and_went(empty: Rasteriser) -> None:
    empty.add(plane((0, 0, 1), 100.0))
    other = Rasteriser()
    other.close()
    np.testing.assert_allclose(empty.depth(rectified_pair(CAMERA).left, AT_ORIGIN, 1.0), 100.0, rtol=1e-6)


def test_a_closed_renderer_leaves_no_context_behind(renderer: Rasteriser) -> None:
    current = ctypes.CDLL("libEGL.so.1").eglGetCurrentContext
    current.restype = ctypes.c_void_p
    one = Rasteriser()
    one.add(plane((0, 0, 1), 100.0))
    one.depth(rectified_pair(CAMERA).left, AT_ORIGIN, 1.0)
    own = current()
    assert own is not None
    one.close()
    assert current() != own


def test_a_worker_that_ends_closes_its_renderer() -> None:
    program = (
        "from endosdk.simulation.render_processes import _renderers\n"
        "class Renderer:\n    def close(self):\n        print('closed')\n"
        "_renderers['one'] = Renderer()\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "closed\n"


def test_missing_graphics_say_what_to_install() -> None:
    # An empty list of drivers makes the real EGL loader find none.
    program = (
        "from endosdk.errors import RendererUnavailable\n"
        "from endosdk.simulation.rasteriser import Rasteriser\n"
        "try:\n    Rasteriser()\nexcept RendererUnavailable as error:\n    print(error)\n"
    )
    hidden = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent.json"}
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=hidden, check=False)
    assert done.returncode == 0, done.stderr
    assert "libegl1" in done.stdout
    assert "RENDERER_UNAVAILABLE" in done.stdout


def test_a_missing_package_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "moderngl", None)  # what the import system leaves for a module that is not there
    with pytest.raises(DependencyMissing, match=r"pip install .moderngl>="):
        Rasteriser()
