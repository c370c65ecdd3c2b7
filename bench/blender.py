#!/usr/bin/env python3
"""A model's maps on its base mesh as Blender displaces and renders them, beside the displaced mesh that planish exports.

    python3.11 -m pip install bpy numpy
    python3.11 bench/blender.py MODEL.planish [-o out/blender] [--program target/release/planish] [--pixels 800]

Both are rendered by Cycles from six directions with one camera and one light. Told are, of each view, the pixels by which the two outlines
are apart at most, and the share of pixels inside whose brightness differs by more than a tenth. An outline that moves by d pixels changes
the covered area of a square of three by three pixels around it by 3 d: so distances below a pixel are measured. `both.png` shows the first
view, planish on the left.
"""
import argparse
import pathlib
import subprocess
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

VIEWS = [(1, -1.2, 0.8), (0, 0, 1), (0, -1, 0), (1, 0, 0), (-1, 1, 0.3), (0.2, 1, -1)]
# Of a pixel: outlines are known to about a tenth of one.
SAMPLES = 64


def main():
    words = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    words.add_argument("model")
    words.add_argument("-o", "--output", default="out/blender", type=pathlib.Path)
    words.add_argument("--program", default="target/release/planish")
    words.add_argument("--pixels", default=800, type=int)
    args = words.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    maps, mesh = args.output / "maps", args.output / "displaced.ply"
    run = [args.program, "relief", "export", args.model, "-o", maps, "--preset", "blender", "--base", "--force", "-q"]
    subprocess.run(run, check=True)
    subprocess.run([args.program, "export", args.model, "--surface", "displaced", "-o", mesh, "--force", "-q"], check=True)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    ours = load(mesh)
    theirs = load(maps / "base.obj")
    ours.data.materials.clear()
    ours.data.materials.append(clay("ours"))
    theirs.data.materials.clear()
    theirs.data.materials.append(displaced(maps))
    low, high = [np.array([f(v.co[k] for v in ours.data.vertices) for k in range(3)]) for f in (min, max)]
    light_and_film(scene, args.pixels)
    worst = 0.0
    for k, view in enumerate(VIEWS):
        look(scene, (low + high) / 2, float(np.linalg.norm(high - low)), view)
        shots = []
        for one, other, name in [(ours, theirs, "planish"), (theirs, ours, "blender")]:
            one.hide_render, other.hide_render = False, True
            path = args.output / f"{name}-{k}.png"
            scene.render.filepath = str(path)
            bpy.ops.render.render(write_still=True)
            shots.append(pixels(path))
        apart, differ = compare(*shots)
        if k == 0:
            side_by_side(shots, args.output / "both.png")
        worst = max(worst, apart)
        print(f"view {k}: outlines {apart:.2f} pixels apart at most, {100 * differ:.2f} % of pixels differ in brightness")
    print(f"largest: {worst:.2f} pixels")


def load(path):
    """The object of a mesh file, in the axes of the file."""
    if path.suffix == ".ply":
        bpy.ops.wm.ply_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    else:
        bpy.ops.wm.obj_import(filepath=str(path), forward_axis="Y", up_axis="Z")
    return bpy.context.selected_objects[0]


def clay(name):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    surface = material.node_tree.nodes["Principled BSDF"]
    surface.inputs["Base Color"].default_value = (0.6, 0.6, 0.6, 1)
    surface.inputs["Roughness"].default_value = 0.6
    return material


def displaced(maps):
    """The material as `relief.json` tells to wire it."""
    material = clay("theirs")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    image = nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.load(str(sorted(maps.glob("relief.*.exr"))[0].resolve()))
    image.image.source = "TILED"
    image.image.colorspace_settings.name = "Non-Color"
    image.interpolation, image.extension = "Linear", "EXTEND"
    vectors = nodes.new("ShaderNodeVectorDisplacement")
    vectors.space = "TANGENT"
    vectors.inputs["Midlevel"].default_value, vectors.inputs["Scale"].default_value = 0, 1
    links.new(image.outputs["Color"], vectors.inputs["Vector"])
    links.new(vectors.outputs["Displacement"], nodes["Material Output"].inputs["Displacement"])
    material.displacement_method = "DISPLACEMENT"
    return material


def light_and_film(scene, size):
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", SAMPLES, False
    scene.cycles.seed, scene.cycles.pixel_filter_type = 0, "BOX"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"
    world = bpy.data.worlds.new("world")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.25, 0.25, 0.25, 1)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 3
    sun.rotation_euler = (0.7, 0.3, 0.4)
    scene.collection.objects.link(sun)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    scene.collection.objects.link(camera)
    scene.camera = camera


def look(scene, middle, size, view):
    """A camera that sees all from a direction, upright."""
    back = Vector(view).normalized()
    right = (Vector((0, 1, 0)) if abs(back.z) > 0.99 else Vector((0, 0, 1))).cross(back).normalized()
    turn = Matrix((right, back.cross(right), back)).transposed().to_4x4()
    camera = scene.camera
    camera.matrix_world = Matrix.Translation(Vector(middle.tolist()) + 2 * size * back) @ turn
    camera.data.ortho_scale, camera.data.clip_end = 1.02 * size, 5 * size


def pixels(path):
    image = bpy.data.images.load(str(path))
    found = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return found


def compare(ours, theirs):
    covered = [shot[..., 3] for shot in (ours, theirs)]
    if not all((one > 0.5).any() for one in covered):
        sys.exit("error: one of the pictures is empty")
    more = np.pad(covered[0] - covered[1], 1)
    height, width = covered[0].shape
    around = sum(more[i : i + height, j : j + width] for i in range(3) for j in range(3))
    both = (covered[0] > 0.99) & (covered[1] > 0.99)
    bright = np.abs(ours[..., :3].mean(-1) - theirs[..., :3].mean(-1))[both]
    return np.abs(around).max() / 3, (bright > 0.1).mean()


def side_by_side(shots, path):
    """The pictures on white, cut to what is on them."""
    used = np.argwhere(np.maximum(*[shot[..., 3] for shot in shots]) > 0)
    (top, left), (bottom, right) = used.min(0), used.max(0) + 1
    cut = [shot[top:bottom, left:right] for shot in shots]
    pixels = np.concatenate([shot[..., :3] + (1 - shot[..., 3:]) for shot in cut], 1).clip(0, 1)
    pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1)
    image = bpy.data.images.new("both", pixels.shape[1], pixels.shape[0])
    image.pixels = pixels.ravel().tolist()
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


if __name__ == "__main__":
    main()
