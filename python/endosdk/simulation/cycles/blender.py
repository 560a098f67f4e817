"""The renderer to trust: Blender Cycles in a process of its own, behind the same face as the rasteriser."""

from __future__ import annotations

import json
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from endosdk.errors import RendererUnavailable, StorageFailed
from endosdk.simulation.camera import Pose, View
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.noise import Array
from endosdk.simulation.rasteriser import Rasteriser
from endosdk.simulation.scene import Lamp
from endosdk.simulation.shapes import Vector
from endosdk.simulation.texture import TissueTexture
from endosdk.simulation.tissue import TISSUES, Tissue

SAMPLES = 4  # 8 take twice the time and change the denoised picture less than the sensor's own noise does
LOOK = 2  # version of the materials and the lamp in worker.py; another is another picture
SUBSURFACE = 0.12  # share of the diffuse light of tissue that travels under its surface
PALE = 0.12  # share of white light that tissue returns without colouring it, or bounces would end in one hue
SWELL = 8  # texels of relief over which the film of water is even
WORKER = Path(__file__).with_name("worker.py")


class CyclesRenderer:
    """Draws meshes with Cycles. Poses and truth come from the rasteriser, whose depth at pixel centres is the same."""

    casts_shadows = True

    def __init__(self, python: Path, samples: int = SAMPLES) -> None:
        """Start Blender under ``python``, which must have bpy. Raises RendererUnavailable, saying what it lacks."""
        self._rasteriser = Rasteriser()
        self._samples = samples
        self._parts: list[tuple[Mesh, Tissue, TissueTexture]] = []
        self._loaded: tuple[Any, ...] | None = None
        self._folder = tempfile.TemporaryDirectory(prefix="endosdk-cycles-")
        # Blender talks a lot; what it last said is shown when it fails.
        self._said = tempfile.TemporaryFile("w+")
        try:
            self._worker = subprocess.Popen(
                [str(python), "-E", "-s", str(WORKER)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._said,
                text=True,
            )
        except OSError as error:
            self._rasteriser.close()
            self._folder.cleanup()
            raise RendererUnavailable("cycles_python", "must be a Python that can be started", error) from error
        try:
            self._cycles: str = self._answer()["version"]
        except RendererUnavailable:
            self.close()
            raise

    @property
    def version(self) -> str:
        """Names and versions of Cycles, its device, and the OpenGL that finds poses and truth."""
        return f"{self._cycles}; look {LOOK}; {self._samples} samples; truth by {self._rasteriser.version}"

    def add(self, mesh: Mesh, tissue: Tissue | None = None, texture: TissueTexture | None = None) -> None:
        """Add a mesh; without tissue and texture it has depth but no colour."""
        self._rasteriser.add(mesh)
        if tissue is not None and texture is not None:
            self._parts.append((mesh, tissue, texture))
        self._loaded = None

    def clear(self) -> None:
        """Forget all meshes."""
        self._rasteriser.clear()
        self._parts = []
        self._loaded = None

    def close(self) -> None:
        """Stop Blender and free everything; the object cannot be used afterwards."""
        self._worker.terminate()
        if self._worker.stdin is not None:
            with suppress(BrokenPipeError):  # it may have stopped by itself
                self._worker.stdin.close()
        self._worker.wait()
        if self._worker.stdout is not None:
            self._worker.stdout.close()
        self._said.close()
        self._rasteriser.close()
        self._folder.cleanup()

    def depth(self, view: View, pose: Pose, scale: float) -> Array:
        """Return planar depth in mm [H,W] at the pixel centres, infinite where there is no surface."""
        return self._rasteriser.depth(view, pose, scale)

    def colour(self, view: View, pose: Pose, scale: float, lamp: Lamp, middle: Vector, reach: float) -> Array:
        """Return linear light [H,W,3]; the lamp hangs at ``middle`` (rig mm) and has unit strength at ``reach`` mm."""
        self._load(pose, scale, lamp, middle, reach)
        return self._draw(view, depth=False)

    def _draw(self, view: View, depth: bool) -> Array:
        path = Path(self._folder.name) / "view.npy"
        wanted = {
            "width": view.width,
            "height": view.height,
            "focal_px": float(view.matrix[0, 0]),
            "centre": [float(view.matrix[0, 2]), float(view.matrix[1, 2])],
            "rotation": view.rotation.tolist(),
            "translation": view.translation.tolist(),
            "depth": depth,
            # Noise must differ between the views, as it does between two chips.
            "seed": int(abs(float(view.translation[0])) * 1000) % 2**31,
        }
        self._ask({"view": wanted, "out": str(path)})
        return np.asarray(np.load(path), np.float32)

    def _load(self, pose: Pose, scale: float, lamp: Lamp, middle: Vector, reach: float) -> None:
        """Hand the scene over, unless Blender holds it already: both views of a pair need it once."""
        state = (pose.position.tobytes(), pose.axes.tobytes(), scale, lamp, middle, reach)
        if state == self._loaded:
            return
        folder = Path(self._folder.name)
        try:
            self._write_scene(folder, pose, scale, lamp, middle, reach)
        except OSError as error:
            rule = "the folder for temporary files must be writable; $TMPDIR names another"
            raise StorageFailed("cycles", rule, f"{folder}: {error}") from error
        self._ask({"load": str(folder)})
        self._loaded = state

    def _write_scene(self, folder: Path, pose: Pose, scale: float, lamp: Lamp, middle: Vector, reach: float) -> None:
        emitters = [[a + b for a, b in zip(middle, emitter, strict=True)] for emitter in lamp.emitters]
        description = {
            "samples": self._samples,
            "parts": [self._write_part(folder, k, part, pose, scale) for k, part in enumerate(self._parts)],
            "lamp": {
                "emitters": emitters,
                "tint": lamp.tint,
                "falloff": lamp.falloff,
                "beam": lamp.beam,
                "ambient": lamp.ambient,
                "reach": reach,
            },
        }
        (folder / "scene.json").write_text(json.dumps(description))

    def _write_part(
        self, folder: Path, number: int, part: tuple[Mesh, Tissue, TissueTexture], pose: Pose, scale: float
    ) -> dict[str, Any]:
        """Write one surface in the rig's frame; return its place in the scene's description."""
        mesh, tissue, texture = part
        along = mesh.tangents - mesh.normals * np.sum(mesh.tangents * mesh.normals, 1, keepdims=True)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-6)
        place = np.concatenate([mesh.uv, np.zeros((len(mesh.uv), 1))], 1)
        np.savez(
            folder / f"{number}.npz",
            positions=(scale * (mesh.positions - pose.position) @ pose.axes.T).astype(np.float32),
            up=(mesh.normals @ pose.axes.T).astype(np.float32),
            along=(along @ pose.axes.T).astype(np.float32),
            place=place.astype(np.float32),
            triangles=mesh.triangles,
        )
        repeats = [max(1, round(s / texture.detail_mm)) / s for s in texture.size_mm]
        return {
            "mesh": f"{number}.npz",
            "albedo": _write_texture(folder / f"{number}-albedo.png", _paler(texture.albedo)),
            "detail": _write_texture(folder / f"{number}-detail.png", texture.detail),
            "swell": _write_texture(folder / f"{number}-swell.png", _coarser(texture.detail)),
            "albedo_scale": [1.0 / s for s in texture.size_mm],
            "detail_scale": repeats,
            "roughness": tissue.roughness,
            "gloss": tissue.gloss,
            "metallic": tissue.metallic,
            "subsurface": SUBSURFACE if tissue.kind in TISSUES else 0.0,
        }

    def _ask(self, request: dict[str, Any]) -> None:
        assert self._worker.stdin is not None
        try:
            self._worker.stdin.write(json.dumps(request) + "\n")
            self._worker.stdin.flush()
        except OSError as error:
            raise self._failed(f"Blender has stopped: {error}") from error
        self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._worker.stdout is not None
        line = self._worker.stdout.readline()
        if not line:
            raise self._failed(f"Blender has stopped, status {self._worker.wait()}")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise self._failed(answer["error"])
        return answer

    def _failed(self, what: str) -> RendererUnavailable:
        self._said.seek(0)
        last = self._said.read().strip().splitlines()[-1:] or ["nothing"]
        rule = "needs a Python with bpy that can draw; `endosdk simulate --setup-cycles` makes one"
        return RendererUnavailable("cycles_python", rule, f"{what}; it last said: {last[0]}")


def _write_texture(path: Path, pixels: np.ndarray) -> str:
    import cv2

    # The first row of a texture is at v = 0, which for Blender is the last row of a picture.
    flipped = np.ascontiguousarray(pixels[::-1, :, [2, 1, 0, 3]])
    _, data = cv2.imencode(".png", flipped, [cv2.IMWRITE_PNG_COMPRESSION, 1])
    path.write_bytes(data.tobytes())
    return path.name


def _paler(albedo: np.ndarray) -> np.ndarray:
    """Mix colours, which are coded by their root, with their own grey."""
    light = (albedo[..., :3].astype(np.float32) / 255.0) ** 2
    light += np.float32(PALE) * (light.mean(-1, keepdims=True) - light)
    return np.concatenate([(255.0 * np.sqrt(light) + 0.5).astype(np.uint8), albedo[..., 3:]], -1)


def _coarser(detail: np.ndarray) -> np.ndarray:
    import cv2

    size = (detail.shape[1] // SWELL, detail.shape[0] // SWELL)
    return np.asarray(cv2.resize(detail, size, interpolation=cv2.INTER_AREA), np.uint8)
