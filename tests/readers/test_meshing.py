"""Meshes with tagged edges, and volumes written by other libraries."""

import gzip
import json

import numpy as np
import pytest
from conftest import planish
from meshes import box, write_ply

trimesh = pytest.importorskip("trimesh")

PART = """
[solid.block]
box = { size = [4, 3, 2] }

[solid.bore]
cylinder = { radius = 0.8, height = 3 }

[solid.part]
difference = ["block", "bore"]
"""


def sphere(n=40, radius=1.0, half=1.3):
    """Distances from a sphere on n^3 nodes of a cube around it, indexed [x, y, z], and their spacing."""
    x = np.linspace(-half, half, n)
    grid = np.stack(np.meshgrid(x, x, x, indexing="ij"))
    return (np.sqrt((grid**2).sum(0)) - radius).astype(np.float32), x[1] - x[0]


def read_tagged(path):
    """Vertices, kinds, triangles and tagged edges of a PLY, by a reader that knows nothing of planish."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    assert b"format binary_little_endian 1.0" in head
    types = {"double": "<f8", "float": "<f4", "uchar": "u1", "int": "<i4", "uint": "<u4"}
    elements = {}
    for line in head.decode().splitlines():
        words = line.split()
        if words[0] == "element":
            elements[words[1]] = (int(words[2]), [])
            last = words[1]
        elif words[0] == "property":
            elements[last][1].append(words[1:])
    at, found = 0, {}
    for name, (count, properties) in elements.items():
        if properties[0][0] == "list":
            kind = np.dtype([("n", types[properties[0][1]]), ("v", types[properties[0][2]], 3)])
        else:
            kind = np.dtype([(p[1], types[p[0]]) for p in properties])
        found[name] = np.frombuffer(body, kind, count, at)
        at += kind.itemsize * count
    assert at == len(body)
    return found


def test_tagged_ply_marks_the_edges_of_a_bored_block(tmp_path):
    (tmp_path / "part.toml").write_text(PART)
    planish("mesh", tmp_path / "part.toml", "--resolution", 40, "-o", tmp_path / "part.ply")
    found = read_tagged(tmp_path / "part.ply")
    points = np.stack([found["vertex"][k] for k in "xyz"], 1)
    kinds = found["vertex"]["feature"]
    assert set(np.unique(kinds)) == {0, 1, 2} and (kinds == 2).sum() == 8
    edges = np.stack([found["edge"]["vertex1"], found["edge"]["vertex2"]], 1)
    assert (kinds[edges] > 0).all()
    length = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1).sum()
    assert length == pytest.approx(4 * (4 + 3 + 2) + 4 * np.pi * 0.8, rel=0.01)
    # Every tagged edge is an edge of two triangles.
    faces = found["face"]["v"]
    sides = {tuple(sorted(s)) for f in faces for s in ((f[0], f[1]), (f[1], f[2]), (f[2], f[0]))}
    assert all(tuple(sorted(e)) in sides for e in edges.tolist())
    mesh = trimesh.load(tmp_path / "part.ply", process=False)
    assert mesh.is_watertight and mesh.euler_number == 0
    assert mesh.volume == pytest.approx(24 - np.pi * 0.64 * 2, rel=2e-3)


def test_decimated_and_smoothed_meshes_keep_tags_and_stay_closed(tmp_path):
    (tmp_path / "part.toml").write_text(PART)
    planish("mesh", tmp_path / "part.toml", "--resolution", 40, "-o", tmp_path / "part.ply")
    planish("decimate", tmp_path / "part.ply", "--ratio", 0.1, "-o", tmp_path / "less.ply")
    planish("smooth", tmp_path / "part.ply", "--noise", 0.005, "-o", tmp_path / "smooth.ply")
    for name in ["less.ply", "smooth.ply"]:
        found = read_tagged(tmp_path / name)
        assert (found["vertex"]["feature"] == 2).sum() == 8, name
        mesh = trimesh.load(tmp_path / name, process=False)
        assert mesh.is_watertight and mesh.euler_number == 0, name
        assert mesh.volume == pytest.approx(24 - np.pi * 0.64 * 2, rel=5e-3), name


@pytest.mark.parametrize("encoding", ["raw", "gzip"])
def test_nrrd_of_pynrrd_becomes_a_sphere_where_it_says(tmp_path, encoding):
    nrrd = pytest.importorskip("nrrd")
    values, step = sphere()
    header = {"encoding": encoding, "space": "left-posterior-superior", "space directions": np.eye(3) * step}
    header["space origin"] = [5.0, -1.0, 2.0]
    nrrd.write(str(tmp_path / "ball.nrrd"), values, header)
    planish("mesh", tmp_path / "ball.nrrd", "-o", tmp_path / "ball.ply")
    mesh = trimesh.load(tmp_path / "ball.ply", process=False)
    assert mesh.is_watertight and mesh.volume == pytest.approx(4 / 3 * np.pi, rel=0.01)
    assert mesh.center_mass == pytest.approx([6.3, 0.3, 3.3], abs=1e-3)


@pytest.mark.parametrize("order", ["C", "F"])
def test_npy_is_indexed_x_y_z_in_either_order(tmp_path, order):
    values, step = sphere()
    np.save(tmp_path / "ball.npy", np.asarray(values[:, :, 8:], order=order))
    planish("mesh", tmp_path / "ball.npy", "--voxel", step, "-o", tmp_path / "ball.ply")
    mesh = trimesh.load(tmp_path / "ball.ply", process=False)
    # Eight layers are cut off along z, and the cut is closed.
    assert mesh.is_watertight
    assert mesh.extents[:2] == pytest.approx([2, 2], abs=0.01) and mesh.extents[2] < 1.95


def test_a_volume_whose_header_lies_is_refused(tmp_path):
    values, _ = sphere(12)
    header = "NRRD0004\ntype: float\ndimension: 3\nsizes: 12 12 13\nencoding: gzip\nendian: little\n\n"
    (tmp_path / "lies.nrrd").write_bytes(header.encode() + gzip.compress(values.tobytes(order="F")))
    done = planish("mesh", tmp_path / "lies.nrrd", "-o", tmp_path / "out.ply", status=3)
    assert done.stderr.startswith("error: ") and " - hint: " in done.stderr
    assert not (tmp_path / "out.ply").exists()


def test_layout_follows_the_tagged_edges(tmp_path):
    """Edges of 30 degrees are below the angle of the layout; tagged they are lines all the same."""
    roof = """
[solid.block]
box = { size = [4, 3, 2] }

[solid.left]
plane = { normal = [0.2588, 0, 0.9659], offset = 0.6 }

[solid.right]
plane = { normal = [-0.2588, 0, 0.9659], offset = 0.6 }

[solid.part]
intersection = ["block", "left", "right"]
"""
    (tmp_path / "roof.toml").write_text(roof)
    planish("mesh", tmp_path / "roof.toml", "--resolution", 30, "-o", tmp_path / "roof.ply")
    bare = trimesh.load(tmp_path / "roof.ply", process=False)
    write_ply(tmp_path / "bare.ply", (bare.vertices.tolist(), bare.faces.tolist()))
    sharp = {}
    for name in ["roof", "bare"]:
        planish("layout", tmp_path / f"{name}.ply", "--patches", 20, "-o", tmp_path / f"{name}.json")
        network = json.loads((tmp_path / f"{name}.json").read_text())
        sharp[name] = sum(len(c["points"]) - 1 for c in network["curves"] if c["kind"] == "feature")
    assert sharp["roof"] > sharp["bare"]


def test_slivers_and_cracks_of_a_cad_mesh_are_closed(tmp_path):
    points, triangles = box(4)
    # A crack: the triangles of one face get their own vertices, moved a little.
    moved = {}
    for t, triangle in enumerate(triangles[:32]):
        triangles[t] = tuple(moved.setdefault(v, len(points) + len(moved)) for v in triangle)
    points += [(x - 1e-4, y, z) for x, y, z in (points[v] for v in moved)]
    write_ply(tmp_path / "bad.ply", (points, triangles))
    planish("mesh", tmp_path / "bad.ply", "--voxel", 0.1, "-o", tmp_path / "good.ply")
    mesh = trimesh.load(tmp_path / "good.ply", process=False)
    assert mesh.is_watertight and mesh.volume == pytest.approx(24, rel=1e-3)
