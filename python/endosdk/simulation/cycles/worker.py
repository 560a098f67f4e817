"""Draws with Blender Cycles. Runs as a script under a Python that has bpy and knows nothing else of this package.

It reads one JSON request a line from standard input and answers each by one line on standard output:
``{"load": FOLDER}`` replaces the scene by the one described in FOLDER/scene.json; ``{"view": {...}, "out": FILE.npy}``
draws it, as linear light [H,W,3] float32, or as planar depth [H,W] when the view asks for ``depth``. Lengths are mm in
the rig's frame (x right, y down, z forward).
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

BACKENDS = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
BOUNCES = 1  # what bounces further is the lamp's ambient share
SUBSURFACE_MM = (1.6, 0.55, 0.4)  # how far red, green and blue travel under the surface
EMITTER_MM = 0.7
FILM_IOR = 1.33
AMBIENT_LEFT = 0.35  # of the rasteriser's ambient light, most of which is the bounce that is traced here
LINGERING = 0.5  # of what the lamp's slow falloff adds to the light far away, for the same reason
PALE = 0.12  # share of white light that tissue returns without colouring it, or bounces would end in one hue
INDIRECT_CLAMP = 4.0  # of the brightness of a matt white wall at the lamp's reach


class Nodes:
    """Adds shader nodes to one tree, each wired to its inputs as it is made."""

    def __init__(self, tree: Any) -> None:
        tree.nodes.clear()
        self.tree = tree

    def add(self, kind: str, inputs: dict[Any, Any] | None = None, **settings: Any) -> Any:
        """Add a node; return it."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        for name, value in (inputs or {}).items():
            self.wire(node.inputs[name], value)
        return node

    def wire(self, socket: Any, value: Any) -> None:
        """Give an input a constant, or the output of another node."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *values: Any) -> Any:
        """Calculate with numbers."""
        return self.add("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def vector(self, operation: str, *values: Any) -> Any:
        """Calculate with vectors."""
        node = self.add("ShaderNodeVectorMath", dict(enumerate(values)), operation=operation)
        return node.outputs["Value" if operation in ("LENGTH", "DOT_PRODUCT") else "Vector"]

    def scaled(self, vector: Any, factor: Any) -> Any:
        """Multiply a vector by a number."""
        return self.add("ShaderNodeVectorMath", {0: vector, "Scale": factor}, operation="SCALE").outputs[0]

    def attribute(self, name: str) -> Any:
        """Read what the mesh stores at its vertices."""
        return self.add("ShaderNodeAttribute", attribute_name=name).outputs["Vector"]

    def picture(self, path: Path, place: Any) -> tuple[Any, Any]:
        """Read colour and alpha of a texture at a place."""
        image = bpy.data.images.load(str(path))
        image.colorspace_settings.name = "Non-Color"
        image.alpha_mode = "CHANNEL_PACKED"
        node = self.add("ShaderNodeTexImage", {"Vector": place}, image=image)
        return node.outputs["Color"], node.outputs["Alpha"]


def tissue_material(folder: Path, part: dict[str, Any], lamp: dict[str, Any]) -> Any:
    """Return the material of one surface: what lies under it, its relief, and the film of water over it."""
    material = bpy.data.materials.new("tissue")
    material.use_nodes = True
    material.cycles.emission_sampling = "NONE"
    n = Nodes(material.node_tree)
    place = n.attribute("place")
    skin, wet = n.picture(folder / part["albedo"], n.vector("MULTIPLY", place, (*part["albedo_scale"], 0.0)))
    tiled = n.vector("MULTIPLY", place, (*part["detail_scale"], 0.0))
    fine, fine_gloss = n.picture(folder / part["detail"], tiled)
    coarse, _ = n.picture(folder / part["swell"], tiled)
    contrast, along, across = _signed(n, fine)
    full = n.scaled(n.vector("MULTIPLY", skin, skin), n.math("EXPONENT", contrast))
    grey = n.math("MULTIPLY", n.vector("DOT_PRODUCT", full, (1.0, 1.0, 1.0)), PALE / 3.0)
    base = n.vector(
        "ADD", n.scaled(full, 1.0 - PALE), n.add("ShaderNodeCombineXYZ", {0: grey, 1: grey, 2: grey}).outputs[0]
    )
    relief = _tilted(n, along, across)
    _, swell_along, swell_across = _signed(n, coarse)
    calm = n.math("SUBTRACT", 1.0, n.math("MULTIPLY", wet, 0.4))
    film = _tilted(n, n.math("MULTIPLY", swell_along, calm), n.math("MULTIPLY", swell_across, calm))
    uneven = n.math("ADD", 0.5, fine_gloss)  # 1 where neutral
    dry = n.math("SUBTRACT", 1.0, n.math("MULTIPLY", wet, 0.35))
    rough = n.math("MULTIPLY", part["roughness"], n.math("MULTIPLY", uneven, dry))
    rough = n.math("MINIMUM", 0.9, n.math("MAXIMUM", 0.2, rough))
    metal = 1.0 if part["metallic"] else 0.0
    shader = n.add(
        "ShaderNodeBsdfPrincipled",
        {
            "Base Color": base,
            "Metallic": metal,
            "Roughness": rough,
            "Normal": relief,
            "Specular IOR Level": min(1.0, 0.5 * part["gloss"]),
            "Subsurface Weight": part["subsurface"],
            "Subsurface Radius": SUBSURFACE_MM,
            "Subsurface Scale": 1.0,
            "Coat Weight": n.math("MINIMUM", 1.0, n.math("MULTIPLY", part["gloss"], n.math("ADD", 0.35, wet))),
            "Coat Roughness": n.math("MAXIMUM", 0.16, n.math("MULTIPLY", 0.55, rough)),
            "Coat IOR": FILM_IOR,
            "Coat Normal": film,
            "Emission Color": n.vector("MULTIPLY", n.vector("MULTIPLY", base, base), tuple(lamp["tint"])),
            "Emission Strength": _ambient(n, lamp),
        },
        subsurface_method="BURLEY",
    )
    n.add("ShaderNodeOutputMaterial", {"Surface": shader.outputs["BSDF"]})
    return material


def _signed(n: Nodes, colour: Any) -> list[Any]:
    """Return the three channels stretched to -1..1."""
    parts = n.add("ShaderNodeSeparateColor", {"Color": colour})
    return [n.math("SUBTRACT", n.math("MULTIPLY", parts.outputs[k], 2.0), 1.0) for k in range(3)]


def _tilted(n: Nodes, along: Any, across: Any) -> Any:
    """Return the surface's normal tilted by slopes along its texture's two directions."""
    up = n.vector("NORMALIZE", n.attribute("up"))
    raw = n.attribute("along")
    tangent = n.vector("NORMALIZE", n.vector("SUBTRACT", raw, n.scaled(up, n.vector("DOT_PRODUCT", up, raw))))
    other = n.vector("CROSS_PRODUCT", up, tangent)
    slope = n.vector("ADD", n.scaled(tangent, along), n.scaled(other, across))
    return n.vector("NORMALIZE", n.vector("SUBTRACT", up, slope))


def _ambient(n: Nodes, lamp: dict[str, Any]) -> Any:
    """Return the light that has bounced more often than is traced: it fades slowly with distance."""
    far = n.vector("LENGTH", n.add("ShaderNodeNewGeometry").outputs["Position"])
    fade = n.math("SQRT", n.math("DIVIDE", lamp["reach"], n.math("MAXIMUM", far, 1.0)))
    return n.math("MULTIPLY", AMBIENT_LEFT * lamp["ambient"], fade)


def depth_material() -> Any:
    """Return a material that glows with its planar depth."""
    material = bpy.data.materials.new("depth")
    material.use_nodes = True
    n = Nodes(material.node_tree)
    planar = n.add("ShaderNodeCameraData").outputs["View Z Depth"]
    glow = n.add("ShaderNodeEmission", {"Color": (1.0, 1.0, 1.0, 1.0), "Strength": planar})
    n.add("ShaderNodeOutputMaterial", {"Surface": glow.outputs[0]})
    return material


def add_mesh(folder: Path, part: dict[str, Any], material: Any) -> None:
    """Add one surface."""
    with np.load(folder / part["mesh"]) as file:
        arrays = {name: file[name] for name in file.files}
    positions, triangles = arrays["positions"], arrays["triangles"].astype(np.int32)
    mesh = bpy.data.meshes.new("part")
    mesh.vertices.add(len(positions))
    mesh.vertices.foreach_set("co", positions.ravel())
    mesh.loops.add(triangles.size)
    mesh.loops.foreach_set("vertex_index", triangles.ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, triangles.size, 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(triangles), bool))
    for name in ("up", "along", "place"):
        mesh.attributes.new(name, "FLOAT_VECTOR", "POINT").data.foreach_set("vector", arrays[name].ravel())
    mesh.update(calc_edges=True)
    mesh.materials.append(material)
    bpy.context.collection.objects.link(bpy.data.objects.new("part", mesh))


def add_lamp(lamp: dict[str, Any]) -> None:
    """Add the emitters; at the lamp's reach, both together light a matt white wall to 1."""
    for place in lamp["emitters"]:
        light = bpy.data.lights.new("emitter", "POINT")
        light.energy = 0.5 * 4.0 * np.pi**2 * lamp["reach"] ** 2
        light.color = lamp["tint"]
        light.shadow_soft_size = EMITTER_MM
        light.use_nodes = True
        n = Nodes(light.node_tree)
        # Free space takes the square of distance; the lamp may fade less, since light lingers in a lumen.
        far = n.add("ShaderNodeLightPath").outputs["Ray Length"]
        lingering = n.math("POWER", n.math("DIVIDE", far, lamp["reach"]), LINGERING * (2.0 - lamp["falloff"]))
        toward = n.vector("DOT_PRODUCT", n.add("ShaderNodeNewGeometry").outputs["Incoming"], (0.0, 0.0, 1.0))
        beam = n.math("POWER", n.math("MAXIMUM", n.math("ABSOLUTE", toward), 1e-4), lamp["beam"])
        glow = n.add("ShaderNodeEmission", {"Strength": n.math("MULTIPLY", lingering, beam)})
        n.add("ShaderNodeOutputLight", {"Surface": glow.outputs[0]})
        holder = bpy.data.objects.new("emitter", light)
        holder.location = place
        holder.visible_camera = False
        bpy.context.collection.objects.link(holder)


def use_graphics_card() -> str:
    """Let Cycles draw on a graphics card where it finds one; return the device's name."""
    settings = bpy.context.preferences.addons["cycles"].preferences
    for backend in BACKENDS:
        try:
            settings.compute_device_type = backend
        except TypeError:
            continue  # this build of Blender does not know it
        settings.refresh_devices()
        found = [device for device in settings.devices if device.type == backend]
        if found:
            for device in settings.devices:
                device.use = device.type == backend
            return f"{found[0].name} ({backend})"
    settings.compute_device_type = "NONE"
    return "CPU"


def prepare(settings: dict[str, Any], device: str) -> Any:
    """Set up an empty scene for the samples and the device asked for; return its camera."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.image_settings.color_mode = "RGB"
    scene.world = bpy.data.worlds.new("dark")
    scene.world.use_nodes = True
    Nodes(scene.world.node_tree).add("ShaderNodeOutputWorld")
    cycles = scene.cycles
    cycles.device = "CPU" if device == "CPU" else "GPU"
    cycles.samples = settings["samples"]
    cycles.use_adaptive_sampling = False
    cycles.use_light_tree = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = BOUNCES
    cycles.sample_clamp_indirect = INDIRECT_CLAMP
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = cycles.denoising_quality = "FAST"
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(scene.camera)
    return scene.camera


def load(folder: Path, device: str) -> Any:
    """Replace everything by the scene in a folder; return the camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    description = json.loads((folder / "scene.json").read_text())
    camera = prepare(description, device)
    for part in description["parts"]:
        add_mesh(folder, part, tissue_material(folder, part, description["lamp"]))
    add_lamp(description["lamp"])
    return camera


def aim(camera: Any, view: dict[str, Any]) -> None:
    """Place the camera: an exact pinhole whose pixel centres have whole coordinates."""
    width, height, focal = view["width"], view["height"], view["focal_px"]
    lens = camera.data
    lens.sensor_fit, lens.sensor_width, lens.lens = "HORIZONTAL", 36.0, 36.0 * focal / width
    lens.shift_x = -(view["centre"][0] + 0.5 - 0.5 * width) / width
    lens.shift_y = (view["centre"][1] + 0.5 - 0.5 * height) / width
    lens.clip_start, lens.clip_end = 1.0, 20000.0
    pose = np.eye(4)
    rotation = np.asarray(view["rotation"])
    pose[:3, :3] = rotation.T @ np.diag([1.0, -1.0, -1.0])  # Blender's camera looks along -z, with y up
    pose[:3, 3] = -rotation.T @ np.asarray(view["translation"])
    camera.matrix_world = [list(column) for column in pose.T]
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100


def draw(camera: Any, view: dict[str, Any]) -> np.ndarray:
    """Draw one view: linear light [H,W,3], or depth [H,W] along one ray through each pixel's centre."""
    aim(camera, view)
    scene = bpy.context.scene
    depth = bool(view["depth"])
    samples = scene.cycles.samples
    scene.cycles.seed = view["seed"]
    scene.cycles.use_denoising = not depth
    # A box filter averages over exactly one pixel.
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = ("GAUSSIAN", 0.01) if depth else ("BOX", 1.0)
    layer = scene.view_layers[0]
    if depth:
        scene.cycles.samples, layer.material_override = 1, depth_material()
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder) / "view.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        pixels = np.empty(view["width"] * view["height"] * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    scene.cycles.samples, layer.material_override = samples, None
    rows = pixels.reshape(view["height"], view["width"], -1)[::-1]
    return np.ascontiguousarray(rows[..., 0] if depth else rows[..., :3])


def main() -> None:
    """Answer requests until standard input ends."""
    # Blender writes to standard output as it pleases; the answers keep it for themselves.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    device = use_graphics_card()
    camera = None
    print(json.dumps({"version": f"Cycles {bpy.app.version_string}; {device}"}), file=answers, flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            if "load" in request:
                camera = load(Path(request["load"]), device)
            else:
                np.save(request["out"], draw(camera, request["view"]))
            answer: dict[str, Any] = {"done": True}
        except Exception as error:  # the driver reports it; the worker stays usable
            answer = {"error": repr(error)}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
