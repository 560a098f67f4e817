"""The quick renderer: OpenGL through EGL, in software or on a graphics card; the same code and the same truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from endosdk.errors import DependencyMissing, RendererUnavailable
from endosdk.io.extras import must_install
from endosdk.simulation.camera import Pose, View
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.noise import Array
from endosdk.simulation.scene import Lamp
from endosdk.simulation.shaders import COLOUR_FRAGMENT, COLOUR_VERTEX, DEPTH_FRAGMENT, DEPTH_VERTEX
from endosdk.simulation.shapes import Vector
from endosdk.simulation.texture import TissueTexture
from endosdk.simulation.tissue import Tissue

EGL: dict[str, Any] = {"standalone": True, "backend": "egl", "require": 330}
SUPERSAMPLING = 1.5  # samples per pixel along each side; multisampling is several times slower in software
NEAR_MM, FAR_MM = 1.0, 20000.0


@dataclass
class _Drawable:
    colour: Any  # vertex arrays of the two programs
    depth: Any
    owned: list[Any]
    albedo: Any = None
    detail: Any = None
    look: dict[str, Any] | None = None


class Rasteriser:
    """Draws meshes from any view. Holds one OpenGL context; use it from one thread."""

    casts_shadows = False

    def __init__(self) -> None:
        """Start OpenGL without a screen. Raises DependencyMissing or RendererUnavailable, saying what to install."""
        try:
            import moderngl
        except ImportError as error:
            raise DependencyMissing("moderngl", must_install("simulate"), "nothing") from error
        try:
            self._gl: Any = moderngl.create_context(**EGL)
        except Exception as error:
            rule = "needs EGL; on Debian: apt-get install libegl1 libgl1-mesa-dri"
            raise RendererUnavailable("renderer", rule, error) from error
        self._gl.enable(moderngl.DEPTH_TEST)
        self._gl.depth_func = "<="
        self._mipmapped = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._colour_program = self._gl.program(vertex_shader=COLOUR_VERTEX, fragment_shader=COLOUR_FRAGMENT)
        self._depth_program = self._gl.program(vertex_shader=DEPTH_VERTEX, fragment_shader=DEPTH_FRAGMENT)
        self._items: list[_Drawable] = []
        self._targets: dict[tuple[int, int, int], Any] = {}

    @property
    def version(self) -> str:
        """Name and version of the OpenGL in use: with one such version samples are the same to rounding."""
        info = self._gl.info
        return f"{info['GL_RENDERER']}; {info['GL_VERSION']}"

    def add(self, mesh: Mesh, tissue: Tissue | None = None, texture: TissueTexture | None = None) -> None:
        """Add a mesh; without tissue and texture it has depth but no colour."""
        self._take_over()
        vertices = np.concatenate([mesh.positions, mesh.normals, mesh.tangents, mesh.uv, mesh.shade[:, None]], 1)
        buffer = self._gl.buffer(np.ascontiguousarray(vertices, np.float32).tobytes())
        index = self._gl.buffer(mesh.triangles.tobytes())
        depth = self._gl.vertex_array(self._depth_program, [(buffer, "3f 36x", "position")], index)
        item = _Drawable(None, depth, [depth, buffer, index])
        if tissue is not None and texture is not None:
            layout = [(buffer, "3f 3f 3f 2f 1f", "position", "normal", "tangent", "uv", "shade")]
            item.colour = self._gl.vertex_array(self._colour_program, layout, index)
            item.albedo = self._texture(texture.albedo)
            item.detail = self._texture(texture.detail)
            item.owned += [item.colour, item.albedo, item.detail]
            repeats = [max(1, round(s / texture.detail_mm)) / s for s in texture.size_mm]
            item.look = {
                "albedo_scale": (1.0 / texture.size_mm[0], 1.0 / texture.size_mm[1]),
                "detail_scale": tuple(repeats),
                "roughness": tissue.roughness,
                "gloss": tissue.gloss,
                "metallic": 1.0 if tissue.metallic else 0.0,
            }
        self._items.append(item)

    def _texture(self, pixels: np.ndarray) -> Any:
        texture = self._gl.texture((pixels.shape[1], pixels.shape[0]), 4, np.ascontiguousarray(pixels).tobytes())
        texture.build_mipmaps()
        texture.filter = self._mipmapped
        return texture

    def clear(self) -> None:
        """Forget all meshes and free what they hold."""
        self._take_over()
        for item in self._items:
            for resource in item.owned:
                resource.release()
        self._items = []

    def close(self) -> None:
        """Free everything; the object cannot be used afterwards."""
        self.clear()
        for target in self._targets.values():
            parts = (*target.color_attachments, target.depth_attachment)
            for resource in (target, *parts):
                resource.release()
        for program in (self._colour_program, self._depth_program):
            program.release()
        # One that is still current would outlive its release, until the process is torn down around it.
        self._gl.__exit__(None, None, None)
        self._gl.release()

    def depth(self, view: View, pose: Pose, scale: float) -> Array:
        """Return planar depth in mm [H,W] at the pixel centres, infinite where there is no surface.

        ``scale`` enlarges the organ about the rig.
        """
        self._take_over()
        target = self._target(view.width, view.height, 1)
        target.use()
        target.clear(red=0.0, depth=1.0)
        self._aim(self._depth_program, view, pose, scale)
        for item in self._items:
            item.depth.render()
        values = np.frombuffer(target.read(components=1, dtype="f4"), np.float32).reshape(view.height, view.width)
        return np.where(values > 0.0, values, np.float32(np.inf)).astype(np.float32)

    def colour(self, view: View, pose: Pose, scale: float, lamp: Lamp, middle: Vector, reach: float) -> Array:
        """Return linear light [H,W,3]; the lamp hangs at ``middle`` (rig mm) and has unit strength at ``reach`` mm."""
        import cv2

        self._take_over()
        size = (round(view.width * SUPERSAMPLING), round(view.height * SUPERSAMPLING))
        target = self._target(*size, 4)
        target.use()
        target.clear(0.0, 0.0, 0.0, 1.0, depth=1.0)
        # Depth first: then only what is seen is lit, which is most of the cost.
        target.color_mask = (False, False, False, False)
        self._aim(self._depth_program, view, pose, scale)
        for item in self._items:
            item.depth.render()
        target.color_mask = (True, True, True, True)
        self._aim(self._colour_program, view, pose, scale)
        self._light(lamp, middle, reach)
        for item in self._items:
            if item.colour is None or item.look is None:
                continue
            item.albedo.use(0)
            item.detail.use(1)
            for name, value in item.look.items():
                self._colour_program[name] = value
            item.colour.render()
        raw = np.frombuffer(target.read(components=4, dtype="f4"), np.float32).reshape(size[1], size[0], 4)
        return np.asarray(cv2.resize(raw, (view.width, view.height), interpolation=cv2.INTER_AREA)[..., :3], np.float32)

    def _take_over(self) -> None:
        """Make this renderer's context the current one, which another of this process may have been since."""
        self._gl.__enter__()

    def _target(self, width: int, height: int, components: int) -> Any:
        key = (width, height, components)
        if key not in self._targets:
            pixels = self._gl.renderbuffer((width, height), components, dtype="f4")
            self._targets[key] = self._gl.framebuffer([pixels], self._gl.depth_renderbuffer((width, height)))
        return self._targets[key]

    def _aim(self, program: Any, view: View, pose: Pose, scale: float) -> None:
        """Set the matrices: organ -> rig -> view -> clip. Rows of the picture run downwards in memory."""
        rig = np.eye(4)
        rig[:3, :3] = scale * pose.axes
        rig[:3, 3] = -scale * (pose.axes @ pose.position)
        camera = np.eye(4)
        camera[:3, :3] = view.rotation
        camera[:3, 3] = view.translation
        fx, fy, cx, cy = view.matrix[0, 0], view.matrix[1, 1], view.matrix[0, 2], view.matrix[1, 2]
        span = FAR_MM - NEAR_MM
        clip = np.array(
            [
                [2 * fx / view.width, 0, 2 * (cx + 0.5) / view.width - 1, 0],
                [0, 2 * fy / view.height, 2 * (cy + 0.5) / view.height - 1, 0],
                [0, 0, (FAR_MM + NEAR_MM) / span, -2 * FAR_MM * NEAR_MM / span],
                [0, 0, 1, 0],
            ]
        )
        program["view"].write(np.ascontiguousarray((camera @ rig).T, np.float32).tobytes())
        program["clip"].write(np.ascontiguousarray(clip.T, np.float32).tobytes())
        if "rig" in program:
            program["rig"].write(np.ascontiguousarray(rig.T, np.float32).tobytes())
            eye = -view.rotation.T @ view.translation
            program["eye"] = tuple(float(v) for v in eye)

    def _light(self, lamp: Lamp, middle: Vector, reach: float) -> None:
        program = self._colour_program
        program["albedo"] = 0
        program["detail"] = 1
        program["emitter"] = [tuple(a + b for a, b in zip(middle, emitter, strict=True)) for emitter in lamp.emitters]
        program["tint"] = lamp.tint
        program["falloff"] = lamp.falloff
        program["beam"] = lamp.beam
        program["ambient"] = lamp.ambient
        program["reach"] = reach
