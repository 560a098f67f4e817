"""What a renderer must do; there are two, and a sample is made by either in the same way."""

from __future__ import annotations

from typing import Protocol

from endosdk.simulation.camera import Pose, View
from endosdk.simulation.meshes import Mesh
from endosdk.simulation.noise import Array
from endosdk.simulation.scene import Lamp
from endosdk.simulation.shapes import Vector
from endosdk.simulation.texture import TissueTexture
from endosdk.simulation.tissue import Tissue


class Renderer(Protocol):
    """Draws meshes from any view."""

    casts_shadows: bool

    @property
    def version(self) -> str:
        """Names and versions of all that decides the bits of a picture."""

    def add(self, mesh: Mesh, tissue: Tissue | None = None, texture: TissueTexture | None = None) -> None:
        """Add a mesh; without tissue and texture it has depth but no colour."""

    def clear(self) -> None:
        """Forget all meshes."""

    def close(self) -> None:
        """Free everything; the object cannot be used afterwards."""

    def depth(self, view: View, pose: Pose, scale: float) -> Array:
        """Return planar depth in mm [H,W] at the pixel centres, infinite where there is no surface."""

    def colour(self, view: View, pose: Pose, scale: float, lamp: Lamp, middle: Vector, reach: float) -> Array:
        """Return linear light [H,W,3]; the lamp hangs at ``middle`` (rig mm) and has unit strength at ``reach`` mm."""
