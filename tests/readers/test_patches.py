"""OBJ and GLB as trimesh reads them: a part per patch whose texture coordinates fit its displacement map."""

import maps
import numpy as np
import pytest
from conftest import planish

trimesh = pytest.importorskip("trimesh")

# Displacement maps and GLB have single precision: largest distance in diagonals.
SINGLE = 1e-6


def free_form(path):
    """The surfaces of an OBJ file by its own rules: the first control points along u."""
    points, found = [], []
    for line in path.read_text().splitlines():
        word, *rest = line.split()
        if word == "v":
            points.append([float(x) for x in rest])
        elif word == "surf":
            bounds, control = [float(x) for x in rest[:4]], [points[int(k) - 1] for k in rest[4:]]
        elif word == "parm":
            knots = [float(x) for x in rest[1:]]
            if rest[0] == "u":
                knots_u = knots
            else:
                shape = len(knots) - 4, len(knots_u) - 4, 3
                assert bounds == [knots_u[3], knots_u[shape[1]], knots[3], knots[shape[0]]]
                found.append(maps.Patch(knots_u, knots, np.reshape(control, shape)))
    return found


@pytest.fixture(scope="module")
def exports(demo, tmp_path_factory):
    folder = tmp_path_factory.mktemp("patches")
    for name, surface in (("spline.obj", "spline"), ("out.obj", "displaced"), ("out.glb", "displaced"), ("base.obj", "base")):
        planish("export", demo / "model.planish", "-o", folder / name, "--surface", surface)
    return folder


@pytest.fixture(scope="module")
def patches(exports):
    return free_form(exports / "spline.obj")


def groups(path):
    """The groups of an OBJ file: for each its name, the points of its corners and their texture coordinates."""
    values, found = {"v": [], "vt": []}, []
    for line in path.read_text().splitlines():
        word, *rest = line.split()
        if word in values:
            values[word].append([float(x) for x in rest])
        elif word == "g":
            found.append((rest[0], []))
        elif word == "f":
            found[-1][1].extend([int(k) - 1 for k in corner.split("/")[:2]] for corner in rest)
    points, uv = np.array(values["v"]), np.array(values["vt"])
    return [(name, points[np.array(corners)[:, 0]], uv[np.array(corners)[:, 1]]) for name, corners in found]


def test_free_form_surfaces_of_obj_are_those_of_step_to_rounding(patches, demo):
    from test_step import faces_of

    theirs = faces_of(demo / "surface.step", "CM")
    assert len(patches) == len(theirs)
    t = np.linspace(0, 1, 7)
    u, v = (g.ravel() for g in np.meshgrid(t, t))
    for patch, face in zip(patches, theirs):
        want = np.array([[(p := face.Value(a, b)).X(), p.Y(), p.Z()] for a, b in zip(u, v)])
        assert np.abs(patch.at(u, v) - want).max() <= 1e-12 * np.abs(want).max()


def test_every_corner_of_obj_lies_where_its_surface_and_the_map_at_its_texel_put_it(exports, patches, demo):
    found = groups(exports / "out.obj")
    assert [name for name, _, _ in found] == [f"patch_{p:04}" for p in range(len(patches))]
    points = np.concatenate([points for _, points, _ in found])
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    maps.check(patches, maps.images(demo / "relief"), [g[1:] for g in found], diagonal, SINGLE)
    # Upside down it would not fit.
    wrong = [(points, np.stack([uv[:, 0], 1 - uv[:, 1]], 1)) for _, points, uv in found]
    with pytest.raises(AssertionError):
        maps.check(patches, maps.images(demo / "relief"), wrong, diagonal, SINGLE)


def test_every_corner_of_glb_lies_where_its_surface_and_the_map_at_its_texel_put_it(exports, patches, demo):
    # trimesh turns texture coordinates over, to the lower left corner.
    parts = trimesh.load(exports / "out.glb", process=False)
    names = {part.visual.material.name: name for name, part in parts.geometry.items()}
    assert sorted(names) == [f"patch_{p:04}" for p in range(len(patches))]
    found = []
    for name in sorted(names):
        part = parts.geometry[names[name]]
        np.testing.assert_allclose(np.linalg.norm(part.vertex_normals, axis=1), 1, atol=1e-6)
        found.append((np.asarray(part.vertices), np.asarray(part.visual.uv, float)))
    points = np.concatenate([points for points, _ in found])
    # The numbers in the file are centimetres, the node makes metres of them.
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    maps.check(patches, maps.images(demo / "relief"), found, diagonal, SINGLE)
    assert np.linalg.norm(parts.extents) == pytest.approx(diagonal / 100)


def test_the_smooth_surface_carries_coordinates_of_the_same_maps(exports, patches, demo):
    sizes = [image.shape for image in maps.images(demo / "relief")]
    for patch, (height, width, _), (_, points, uv) in zip(patches, sizes, groups(exports / "base.obj")):
        u, v = (uv[:, 0] * width - 0.5) / (width - 1), (uv[:, 1] * height - 0.5) / (height - 1)
        size = np.linalg.norm(np.ptp(points, axis=0))
        # Texture coordinates have single precision.
        assert np.linalg.norm(patch.at(u.clip(0, 1), v.clip(0, 1)) - points, axis=1).max() < 1e-5 * size


def test_obj_of_patches_is_closed_and_the_same_mesh_as_ply(exports, demo, tmp_path):
    planish("export", demo / "model.planish", "-o", tmp_path / "out.ply")
    want = trimesh.load(tmp_path / "out.ply", process=False)
    values = [line.split() for line in (exports / "out.obj").read_text().splitlines()]
    points = np.array([v[1:] for v in values if v[0] == "v"], float)
    faces = np.array([[c.split("/")[0] for c in v[1:]] for v in values if v[0] == "f"], int) - 1
    assert np.array_equal(points, want.vertices) and np.array_equal(faces, want.faces)
    assert trimesh.Trimesh(points, faces, process=False).is_watertight


def test_splines_in_a_format_of_triangles_are_refused_before_the_work(demo, tmp_path):
    done = planish("export", demo / "model.planish", "-o", tmp_path / "a.glb", "--surface", "spline", status=2)
    assert ".glb holds no splines" in done.stderr and "write .obj" in done.stderr
