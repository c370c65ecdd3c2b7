"""PLY and GLB as trimesh reads them."""

import numpy as np
import pytest
from conftest import planish

trimesh = pytest.importorskip("trimesh")


def test_mesh_ply_is_closed_and_has_the_reported_number_of_triangles(demo, report):
    mesh = trimesh.load(demo / "mesh.ply", process=False)
    assert len(mesh.faces) == report["quality"]["mesh.triangles"]
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0


def test_preview_glb_is_in_metres_with_y_up(demo):
    scene = trimesh.load(demo / "preview.glb")
    size = scene.extents
    want = trimesh.load(demo / "mesh.ply", process=False).extents / 100
    # The part stands on z in its own file.
    assert size == pytest.approx(want[[0, 2, 1]], rel=0.02)
    mesh = scene.to_mesh() if hasattr(scene, "to_mesh") else trimesh.util.concatenate(scene.dump())
    assert np.isfinite(mesh.vertices).all()
    assert mesh.volume > 0


@pytest.mark.parametrize("name", ["out.ply", "out.obj", "out.stl", "out.glb"])
def test_exports_are_the_displaced_surface(demo, tmp_path, name):
    planish("export", demo / "model.planish", "-o", tmp_path / name)
    mesh = trimesh.load(tmp_path / name, force="mesh")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    want = trimesh.load(demo / "mesh.ply", process=False).volume
    scale = 100**3 if name.endswith(".glb") else 1
    assert mesh.volume * scale == pytest.approx(want, rel=0.02)
