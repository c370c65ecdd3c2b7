"""Blender renders an exported mesh with its map beside our displaced mesh: `pip install bpy`, then `python bench/blender.py PLANISH FOLDER`.

Both are seen by the same camera; what is told is how far the one silhouette lies from the other, in pixels, and `FOLDER` keeps both pictures.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np

SIZE = 600


def waves(path: Path, cuts: int = 160) -> None:
    """A ball of radius 10 with waves of .25, as OBJ: latitudes and longitudes."""
    rows = []
    for j in range(cuts + 1):
        for i in range(2 * cuts):
            a, b = math.pi * i / cuts, math.pi * j / cuts
            r = 10 + 0.25 * math.sin(9 * b) ** 2 * math.sin(12 * a) * math.sin(b)
            rows.append((r * math.sin(b) * math.cos(a), r * math.sin(b) * math.sin(a), r * math.cos(b)))
    at = lambda i, j: j * 2 * cuts + i % (2 * cuts) + 1  # noqa: E731
    with path.open("w") as out:
        for p in rows:
            out.write("v %.9f %.9f %.9f\n" % p)
        for j in range(cuts):
            for i in range(2 * cuts):
                a, b, c, d = at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j)
                if j < cuts - 1:
                    out.write(f"f {a} {b} {c}\n")
                if j > 0:
                    out.write(f"f {a} {c} {d}\n")


def scene() -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    world = bpy.context.scene
    world.render.engine = "CYCLES"
    world.cycles.device = "CPU"
    world.cycles.samples = 4
    world.cycles.use_denoising = False
    world.cycles.pixel_filter_type = "BOX"
    world.render.film_transparent = True
    world.render.resolution_x = world.render.resolution_y = SIZE
    camera = bpy.data.cameras.new("camera")
    camera.type = "ORTHO"
    camera.ortho_scale = 24
    eye = bpy.data.objects.new("camera", camera)
    eye.location = (0, -40, 0)
    eye.rotation_euler = (math.pi / 2, 0, 0)
    world.collection.objects.link(eye)
    world.camera = eye
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy = 3
    sun.rotation_euler = (math.radians(50), 0, math.radians(-35))
    world.collection.objects.link(sun)


def displaced(maps: Path) -> None:
    """The base mesh with the map as Vector Displacement in tangent space."""
    bpy.ops.wm.obj_import(filepath=str(maps / "base.obj"), forward_axis="Y", up_axis="Z")
    thing = bpy.context.selected_objects[0]
    first = sorted(maps.glob("*.1001.exr"))[0]
    image = bpy.data.images.load(str(first))
    image.source = "TILED"
    for tile in sorted(maps.glob("*.1???.exr"))[1:]:
        image.tiles.new(tile_number=int(tile.suffixes[-2][1:]))
    image.filepath = str(first).replace("1001", "<UDIM>")
    image.colorspace_settings.name = "Non-Color"
    material = bpy.data.materials.new("relief")
    material.use_nodes = True
    material.displacement_method = "DISPLACEMENT"
    nodes, links = material.node_tree.nodes, material.node_tree.links
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = image
    moved = nodes.new("ShaderNodeVectorDisplacement")
    moved.space = "TANGENT"
    moved.inputs["Midlevel"].default_value = 0
    moved.inputs["Scale"].default_value = 1
    output = next(n for n in nodes if n.type == "OUTPUT_MATERIAL")
    links.new(texture.outputs["Color"], moved.inputs["Vector"])
    links.new(moved.outputs["Displacement"], output.inputs["Displacement"])
    thing.data.materials.clear()
    thing.data.materials.append(material)


def picture(path: Path) -> np.ndarray:
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(SIZE, SIZE, 4)
    return pixels[:, :, 3]


def away(a: np.ndarray, b: np.ndarray) -> tuple[float, float]:
    """Largest and mean distance of two silhouettes along rows, pixels: areas of alpha from the middle outward."""
    rows = np.flatnonzero((a.max(axis=1) > 0.5) & (b.max(axis=1) > 0.5))
    half = SIZE // 2
    sides = [np.abs(x[rows, :half].sum(axis=1) - y[rows, :half].sum(axis=1)) for x, y in ((a, b), (a[:, ::-1], b[:, ::-1]))]
    all_sides = np.concatenate(sides)
    return float(all_sides.max()), float(all_sides.mean())


def main(program: str, folder: str) -> None:
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    run = lambda *args: subprocess.run([program, *args, "-q", "--force"], cwd=out, check=True)  # noqa: E731
    waves(out / "waves.obj")
    run("fit", "waves.obj", "-o", "waves.planish", "--patches", "24", "--control", "6x6")
    run("relief", "export", "waves.planish", "-o", "maps", "--preset", "blender", "--base")
    run("export", "waves.planish", "-o", "ours.ply")
    scene()
    displaced(out / "maps")
    theirs = picture(out / "blender.png")
    scene()
    bpy.ops.wm.ply_import(filepath=str(out / "ours.ply"), forward_axis="Y", up_axis="Z")
    ours = picture(out / "ours.png")
    scene()
    bpy.ops.wm.obj_import(filepath=str(out / "maps/base.obj"), forward_axis="Y", up_axis="Z")
    smooth = picture(out / "smooth.png")
    largest, mean = away(theirs, ours)
    without, _ = away(smooth, ours)
    print(json.dumps({"blender": bpy.app.version_string, "pixels": SIZE, "silhouette_max": round(largest, 3),
                      "silhouette_mean": round(mean, 4), "without_map_max": round(without, 3)}))


if __name__ == "__main__":
    main(*sys.argv[1:])
