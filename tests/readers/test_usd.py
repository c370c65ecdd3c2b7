"""USD as Pixar's own library reads it: valid, in its unit, with surfaces, mesh and maps that fit each other."""

import maps
import numpy as np
import pytest
from conftest import planish

Usd = pytest.importorskip("pxr.Usd")
from pxr import UsdGeom, UsdValidation  # noqa: E402

# Points have single precision, and the displacement another one of its own: largest distance in diagonals.
SINGLE = 1e-6


@pytest.fixture(scope="module")
def stage(demo, tmp_path_factory):
    path = tmp_path_factory.mktemp("usd") / "part 1.usda"
    planish("export", demo / "model.planish", "-o", path, "--up", "z")
    return Usd.Stage.Open(str(path))


def surfaces(stage):
    """The patches of the file, by its schema: u fastest."""
    found = []
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.NurbsPatch):
            nurbs = UsdGeom.NurbsPatch(prim)
            rows, cols = nurbs.GetVVertexCountAttr().Get(), nurbs.GetUVertexCountAttr().Get()
            assert (nurbs.GetUOrderAttr().Get(), nurbs.GetVOrderAttr().Get()) == (4, 4)
            control = np.asarray(nurbs.GetPointsAttr().Get()).reshape(rows, cols, 3)
            found.append(maps.Patch(nurbs.GetUKnotsAttr().Get(), nurbs.GetVKnotsAttr().Get(), control))
            for knots, count, bounds in (
                (found[-1].knots[0], cols, nurbs.GetURangeAttr().Get()),
                (found[-1].knots[1], rows, nurbs.GetVRangeAttr().Get()),
            ):
                assert len(knots) == count + 4 and tuple(bounds) == (knots[3], knots[count])
    return found


def mesh_of(stage):
    return UsdGeom.Mesh(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)))


def test_no_validator_of_usd_finds_an_error(stage):
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    assert [e.GetErrorAsString() for e in errors] == []


def test_unit_and_axis_are_told_and_the_default_prim_is_the_model(stage):
    # The run was in centimetres.
    assert UsdGeom.GetStageMetersPerUnit(stage) == 0.01
    assert UsdGeom.GetStageUpAxis(stage) == "Z"
    assert stage.GetDefaultPrim().GetDisplayName() == "model"


def test_every_patch_is_a_surface_and_a_subset_of_the_faces(stage, report):
    count = report["quality"]["patches.count"]
    assert len(surfaces(stage)) == count
    subsets = UsdGeom.Subset.GetAllGeomSubsets(mesh_of(stage))
    assert [s.GetPrim().GetName() for s in subsets] == [f"patch_{p:04}" for p in range(count)]


def test_surfaces_are_those_of_step_to_single_precision(stage, demo):
    from test_step import faces_of

    ours = surfaces(stage)
    theirs = faces_of(demo / "surface.step", "CM")
    assert len(ours) == len(theirs)
    t = np.linspace(0, 1, 7)
    u, v = (g.ravel() for g in np.meshgrid(t, t))
    size = np.ptp(np.concatenate([p.control.reshape(-1, 3) for p in ours]), axis=0)
    for patch, face in zip(ours, theirs):
        want = np.array([[(p := face.Value(a, b)).X(), p.Y(), p.Z()] for a, b in zip(u, v)])
        assert np.linalg.norm(patch.at(u, v) - want, axis=1).max() <= SINGLE * np.linalg.norm(size)


def test_every_corner_of_the_mesh_lies_where_its_surface_and_the_map_at_st_put_it(stage, demo):
    mesh = mesh_of(stage)
    assert mesh.GetSubdivisionSchemeAttr().Get() == "none"
    points = np.asarray(mesh.GetPointsAttr().Get(), float)
    corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    st = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert st.GetInterpolation() == "faceVarying"
    uv = np.asarray(st.ComputeFlattened(), float).reshape(-1, 3, 2)
    parts = []
    for subset in UsdGeom.Subset.GetAllGeomSubsets(mesh):
        faces = np.asarray(subset.GetIndicesAttr().Get())
        parts.append((points[corners[faces]].reshape(-1, 3), uv[faces].reshape(-1, 2)))
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    maps.check(surfaces(stage), maps.images(demo / "relief"), parts, diagonal, SINGLE)


def test_normals_are_units_and_those_of_the_faces(stage):
    mesh = mesh_of(stage)
    normals = np.asarray(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals").ComputeFlattened(), float).reshape(-1, 3, 3)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-5)
    a, b, c = np.moveaxis(np.asarray(mesh.GetPointsAttr().Get(), float)[np.asarray(mesh.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)], 1, 0)
    area = np.cross(b - a, c - a)
    assert (np.einsum("kd,kcd->kc", area, normals) > 0).mean() > 0.999


def test_a_model_without_surfaces_is_refused_in_one_line(tmp_path):
    from meshes import ball, write_ply

    script = tmp_path / "none.toml"
    script.write_text("")
    write_ply(tmp_path / "ball.ply", ball(8))
    planish("edit", tmp_path / "ball.ply", script, "-o", tmp_path / "a.planish", "--no-fit")
    done = planish("export", tmp_path / "a.planish", "-o", tmp_path / "a.usda", status=3)
    assert "has no surfaces" in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "a.usda").exists()
