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
    """Return the material of one surface: what lies under it, its relief, and the film of water over it.

    Every node is worked through for every sample of every pixel, so nothing stands here that the textures or the
    vertices can bring along. Light that has bounced meets the colour alone: it is spread too widely to show more.
    """
    material = bpy.data.materials.new("tissue")
    material.use_nodes = True
    material.cycles.emission_sampling = "NONE"
    n = Nodes(material.node_tree)
    place = n.attribute("place")
    skin, wet = n.picture(folder / part["albedo"], n.vector("MULTIPLY", place, (*part["albedo_scale"], 0.0)))
    flat = n.vector("MULTIPLY", skin, skin)
    matt = n.add("ShaderNodeBsdfDiffuse", {"Color": flat}).outputs[0]
    tiled = n.vector("MULTIPLY", place, (*part["detail_scale"], 0.0))
    skin_shader = _wet_tissue(n, folder, part, lamp, (flat, wet, tiled))
    first = n.add("ShaderNodeLightPath").outputs["Is Camera Ray"]
    surface = n.add("ShaderNodeMixShader", {0: first, 1: matt, 2: skin_shader}).outputs[0]
    n.add("ShaderNodeOutputMaterial", {"Surface": surface})
    return material


def _wet_tissue(n: Nodes, folder: Path, part: dict[str, Any], lamp: dict[str, Any], under: tuple[Any, Any, Any]) -> Any:
    """Return what the camera sees of a surface, given its flat colour, its wetness and where its detail is read."""
    flat, wet, tiled = under
    fine, uneven = n.picture(folder / part["detail"], tiled)
    coarse, _ = n.picture(folder / part["swell"], tiled)
    # Codes of 0..1 mean contrast -1..1 and slopes 1..-1.
    contrast, along, across = _split(n, n.vector("MULTIPLY_ADD", fine, (2.0, -2.0, -2.0), (-1.0, 1.0, 1.0)))
    base = n.scaled(flat, n.math("EXPONENT", contrast))
    calm = n.math("MULTIPLY_ADD", wet, -0.4, 1.0)
    swell = n.vector("MULTIPLY_ADD", coarse, (0.0, -2.0, -2.0), (0.0, 1.0, 1.0))
    _, swell_along, swell_across = _split(n, n.scaled(swell, calm))
    up, tangent = n.attribute("up"), n.attribute("along")
    frame = up, tangent, n.vector("CROSS_PRODUCT", up, tangent)
    dry = n.math("MULTIPLY_ADD", wet, -0.35, 1.0)
    rough = n.math("MULTIPLY", n.math("MULTIPLY_ADD", uneven, part["roughness"], 0.5 * part["roughness"]), dry)
    rough = n.math("MINIMUM", 0.9, n.math("MAXIMUM", 0.2, rough))
    return n.add(
        "ShaderNodeBsdfPrincipled",
        {
            "Base Color": base,
            "Metallic": 1.0 if part["metallic"] else 0.0,
            "Roughness": rough,
            "Normal": _tilted(n, frame, along, across),
            "Tangent": tangent,  # or Blender works out one that is not used
            "Specular IOR Level": min(1.0, 0.5 * part["gloss"]),
            "Subsurface Weight": part["subsurface"],
            "Subsurface Radius": SUBSURFACE_MM,
            "Subsurface Scale": 1.0,
            "Coat Weight": n.math("MINIMUM", 1.0, n.math("MULTIPLY_ADD", wet, part["gloss"], 0.35 * part["gloss"])),
            "Coat Roughness": n.math("MAXIMUM", 0.16, n.math("MULTIPLY", 0.55, rough)),
            "Coat IOR": FILM_IOR,
            "Coat Normal": _tilted(n, frame, swell_along, swell_across),
            "Emission Color": n.vector("MULTIPLY", n.vector("MULTIPLY", base, base), tuple(lamp["tint"])),
            "Emission Strength": _ambient(n, lamp),
        },
        subsurface_method="BURLEY",
    ).outputs["BSDF"]


def _split(n: Nodes, vector: Any) -> list[Any]:
    """Return the three numbers of a vector."""
    return list(n.add("ShaderNodeSeparateXYZ", {0: vector}).outputs)


def _tilted(n: Nodes, frame: tuple[Any, Any, Any], along: Any, across: Any) -> Any:
    """Return the surface's normal, tilted toward its texture's two directions."""
    up, tangent, other = frame
    return n.vector("MULTIPLY_ADD", other, across, n.vector("MULTIPLY_ADD", tangent, along, up))


def _ambient(n: Nodes, lamp: dict[str, Any]) -> Any:
    """Return the light that has bounced more often than is traced: it fades slowly with distance."""
    far = n.vector("LENGTH", n.add("ShaderNodeNewGeometry").outputs["Position"])
    return n.math("MULTIPLY", AMBIENT_LEFT * lamp["ambient"] * lamp["reach"] ** 0.5, n.math("INVERSE_SQRT", far))


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
        light.cycles.use_multiple_importance_sampling = False  # no gloss is narrow enough to find so small a lamp
        # Free space takes the square of distance; the lamp may fade less, since light lingers in a lumen.
        power = LINGERING * (2.0 - lamp["falloff"])
        far = n.add("ShaderNodeLightPath").outputs["Ray Length"]
        toward = _split(n, n.add("ShaderNodeNewGeometry").outputs["Incoming"])[2]
        beam = n.math("POWER", n.math("ABSOLUTE", toward), lamp["beam"])
        lingering = n.math("MULTIPLY", n.math("POWER", far, power), lamp["reach"] ** -power)
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
    cycles.sampling_pattern = "TABULATED_SOBOL"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = BOUNCES
    cycles.sample_clamp_indirect = INDIRECT_CLAMP
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = cycles.denoising_quality = "FAST"
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(scene.camera)
    return scene.camera


def load(folder: Path) -> Any:
    """Replace everything by the scene in a folder; return the camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    description = json.loads((folder / "scene.json").read_text())
    camera = prepare(description, use_graphics_card())  # the factory settings know of no card
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
                camera = load(Path(request["load"]))
            else:
                np.save(request["out"], draw(camera, request["view"]))
            answer: dict[str, Any] = {"done": True}
        except Exception as error:  # the driver reports it; the worker stays usable
            answer = {"error": repr(error)}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    main()
