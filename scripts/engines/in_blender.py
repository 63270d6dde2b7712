"""Render spheres in the material of an exported script; run by Blender's Python, not by homofact's.

    python in_blender.py REQUESTS.json       # a Python that has bpy
    blender --background --factory-startup --python in_blender.py -- REQUESTS.json

REQUESTS.json is a list of {"script", "out", "size", "radius", "samples", "lamps", …}: see `scene_of` and `main`. The
unit sphere about the origin is seen from -y by an orthographic camera as `render_sphere` frames it, and every pixel
shows its middle. The pixels (rows, columns, 4), linear, the first row on top, go to "out" as .npy.
"""

import json
import runpy
import sys
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy as np

# Blender's own Python has them.
bpy: Any = import_module("bpy")
mathutils: Any = import_module("mathutils")


def scene_of(request):
    """A camera, a smooth sphere and what the request asks for beside it; the sphere.

    "engine" (Cycles on the CPU), "osl", "rings" of the sphere, "world" (a grey level) or "sky" (a lat-long map as .npy,
    in Blender's layout), "blocker" (place, size and Euler angles of a square that the camera does not see) and "lamps",
    each with "kind", "matrix" (4 × 4) and settings of its data.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = request.get("engine", "CYCLES")
    rings = request.get("rings", 256)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=2 * rings, ring_count=rings, radius=1)
    sphere = bpy.context.object
    sphere.data.polygons.foreach_set("use_smooth", [True] * len(sphere.data.polygons))
    data = bpy.data.cameras.new("camera")
    data.type, data.ortho_scale = "ORTHO", 2 / request["radius"]
    camera = bpy.data.objects.new("camera", data)
    camera.location, camera.rotation_euler = (0, -5, 0), (np.pi / 2, 0, 0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    for number, each in enumerate(request["lamps"]):
        made = lamp(f"lamp {number}", **each)
        scene.collection.objects.link(made)
    if "blocker" in request:
        bpy.ops.mesh.primitive_plane_add(size=request["blocker"][1], location=request["blocker"][0])
        bpy.context.object.rotation_euler = request["blocker"][2]
        for way in ("camera", "diffuse", "glossy"):
            setattr(bpy.context.object, f"visible_{way}", False)
    if "world" in request:
        scene.world = bpy.data.worlds.new("world")
        background = scene.world.node_tree.nodes["Background"]
        background.inputs["Color"].default_value = (*[request["world"]] * 3, 1)
    if "sky" in request:
        scene.world = surroundings(np.load(request["sky"]))
    scene.render.resolution_x = scene.render.resolution_y = request["size"]
    scene.view_settings.view_transform = "Raw"
    scene.render.film_transparent = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.cycles.samples, scene.cycles.device, scene.cycles.use_denoising = request["samples"], "CPU", False
    scene.cycles.use_adaptive_sampling = False
    # Nothing is clamped.
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0
    # A pixel shows its middle.
    scene.cycles.pixel_filter_type, scene.cycles.filter_width, scene.render.filter_size = "BOX", 0.01, 0.01
    scene.cycles.shading_system = request.get("osl", False)
    scene.eevee.taa_render_samples = request["samples"]
    return sphere


def surroundings(radiance):
    """A world of radiance (rows, columns, 3), the top row first."""
    made = bpy.data.worlds.new("sky")
    rows, columns, _ = radiance.shape
    image = bpy.data.images.new("sky", columns, rows, alpha=False, float_buffer=True, is_data=True)
    texels = np.ones((rows, columns, 4), np.float32)
    texels[..., :3] = radiance[::-1]
    image.pixels.foreach_set(texels.ravel())
    image.update()
    image.pack()
    node = made.node_tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    made.node_tree.links.new(node.outputs["Color"], made.node_tree.nodes["Background"].inputs["Color"])
    # Where the world is a map, this is how finely Cycles samples it; EEVEE would take bright texels for a sun.
    made.cycles.sampling_method, made.cycles.sample_map_resolution = "MANUAL", columns
    made.sun_threshold, made.probe_resolution = 0, "2048"
    return made


def lamp(name, kind, matrix, **settings):
    """A lamp, placed; `settings` are its data's."""
    data = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(data, key, value)
    made = bpy.data.objects.new(name, data)
    made.matrix_world = mathutils.Matrix(matrix)
    return made


def script_of(path):
    """The exported script's functions."""
    return SimpleNamespace(**runpy.run_path(path))


def rendered(path):
    """The picture's pixels (rows, columns, 4), by way of a file."""
    bpy.context.scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path, check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    columns, rows = image.size
    bpy.data.images.remove(image)
    return pixels.reshape(rows, columns, 4)[::-1]


def white(sphere):
    """A white matte surface in place of the material, lit by Blender's own lamps."""
    made = bpy.data.materials.new("white")
    nodes = made.node_tree.nodes
    nodes.clear()
    diffuse, out = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    made.node_tree.links.new(diffuse.outputs[0], out.inputs[0])
    sphere.data.materials.append(made)


def main(request):
    """One picture: of the script's material, or of a "white" matte one under Blender's own lamps.

    The script runs twice with "again"; the file is saved and opened anew with "reopened"; "moved" and "set" change
    lamps, by their number, once the material is there. "closures" shows what reflects the world under Blender's own
    lamps.
    """
    sphere = scene_of(request)
    if request.get("white"):
        white(sphere)
    else:
        script = script_of(request["script"])
        if request.get("closures"):
            sphere.data.materials.append(script.material([]))
        else:
            script.apply([sphere])
        if request.get("again"):
            # A second run changes nothing: neither what there is nor what is seen.
            count = {name: len(getattr(bpy.data, name)) for name in ("materials", "node_groups", "images", "texts")}
            script.apply([sphere])
            assert count == {name: len(getattr(bpy.data, name)) for name in count}, count
        if request.get("reopened"):
            bpy.ops.wm.save_as_mainfile(filepath=request["out"] + ".blend")
            bpy.ops.wm.open_mainfile(filepath=request["out"] + ".blend")
        for number, matrix in request.get("moved", {}).items():
            bpy.data.objects[f"lamp {number}"].matrix_world = mathutils.Matrix(matrix)
        for number, settings in request.get("set", {}).items():
            for key, value in settings.items():
                setattr(bpy.data.objects[f"lamp {number}"].data, key, value)
    np.save(request["out"], rendered(request["out"] + ".exr"))


if __name__ == "__main__":
    with open(sys.argv[-1], encoding="utf-8") as file:
        for each in json.load(file):
            main(each)
