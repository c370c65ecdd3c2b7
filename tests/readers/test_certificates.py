"""What planish says of its meshes and scenes, checked by others: the Manifold library for meshes, USD's own validators for scenes."""

import numpy as np
from conftest import ROOT, planish
from meshes import ball, write_ply


def solid_of(path):
    """The mesh of a file as Manifold takes it, without any mending; its status tells whether it is one oriented manifold."""
    import manifold3d
    import trimesh

    mesh = trimesh.load(path, process=False)
    return manifold3d.Manifold(
        manifold3d.Mesh(np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32))
    )


def test_meshes_that_are_said_to_be_manifold_are_solids_of_the_right_volume_to_the_manifold_library(tmp_path):
    told = planish("mesh", ROOT / "examples" / "pocket.toml", "--resolution", 48, "-o", "pocket.ply", cwd=tmp_path).stdout
    assert "watertight, manifold" in told
    write_ply(tmp_path / "ball.ply", ball(12))
    planish("decimate", "ball.ply", "--ratio", 0.5, "-o", "less.ply", cwd=tmp_path)
    for name, least, most in [("pocket.ply", 0.0, np.inf), ("less.ply", 3.9, 4.19)]:
        solid = solid_of(tmp_path / name)
        assert solid.status().name == "NoError", (name, solid.status())
        assert least < solid.volume() < most and solid.genus() == 0, (name, solid.volume())


def test_a_mesh_with_a_face_less_is_no_solid_to_the_manifold_library(tmp_path):
    points, triangles = ball(6)
    write_ply(tmp_path / "open.ply", (points, triangles[1:]))
    assert solid_of(tmp_path / "open.ply").status().name == "NotManifold"
    assert "watertight" not in planish("info", "open.ply", cwd=tmp_path).stdout.replace("not watertight", "")


def faults_of(stage):
    """What the validators of USD find in a stage."""
    from pxr import UsdValidation

    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 10
    return [str(e.GetName()) for e in UsdValidation.ValidationContext(validators).Validate(stage)]


def test_a_scene_has_no_fault_to_the_validators_of_usd_and_an_empty_one_has(tmp_path):
    from pxr import Usd

    write_ply(tmp_path / "ball.ply", ball(6))
    planish("fit", "ball.ply", "-o", "ball.planish", cwd=tmp_path)
    planish("export", "ball.planish", "-o", "ball.usda", cwd=tmp_path)
    assert faults_of(Usd.Stage.Open(str(tmp_path / "ball.usda"))) == []
    assert faults_of(Usd.Stage.CreateInMemory()) != []
