"""Meshes and clouds as other libraries have them, where those can be installed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import planish
from planish import neighbours


def colored() -> planish.Mesh:
    ball = planish.sphere(1.0, 2)
    return planish.Mesh(ball.points, ball.triangles, attributes={"color": 0.5 + 0.5 * ball.points, "heat": ball.points[:, 0]})


def same(a: planish.Mesh | planish.Cloud, b: planish.Mesh | planish.Cloud) -> None:
    assert np.allclose(a.points, b.points)
    if isinstance(a, planish.Mesh) and isinstance(b, planish.Mesh):
        assert np.array_equal(a.triangles, b.triangles)


def test_a_mesh_goes_to_trimesh_and_back_with_its_colours() -> None:
    pytest.importorskip("trimesh")
    mesh = colored()
    there = mesh.to_trimesh()
    assert there.is_watertight and there.volume == pytest.approx(mesh.diagnose()["volume"])
    back = neighbours.from_trimesh(there)
    same(back, mesh)
    assert np.allclose(back.attributes["color"][:, :3], mesh.attributes["color"], atol=1 / 255)
    assert len(planish.Cloud(mesh.points).to_trimesh().vertices) == len(mesh.points)


def test_a_mesh_goes_to_meshio_and_back_with_its_attributes_and_quads_are_cut() -> None:
    meshio = pytest.importorskip("meshio")
    mesh = colored()
    back = neighbours.from_meshio(mesh.to_meshio())
    same(back, mesh)
    assert np.array_equal(back.attributes["heat"], mesh.attributes["heat"])
    square = meshio.Mesh(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), [("quad", [[0, 1, 2, 3]])])
    assert neighbours.from_meshio(square).diagnose()["area"] == pytest.approx(1.0)
    with pytest.raises(ValueError, match="no triangles"):
        neighbours.from_meshio(meshio.Mesh(np.zeros((2, 3)), [("line", [[0, 1]])]))


def test_a_mesh_and_a_cloud_go_to_pyvista_and_back() -> None:
    pytest.importorskip("pyvista")
    mesh = colored()
    back = neighbours.from_pyvista(mesh.to_pyvista())
    assert isinstance(back, planish.Mesh)
    same(back, mesh)
    assert np.allclose(back.attributes["heat"], mesh.attributes["heat"])
    cloud = planish.Cloud(mesh.points, attributes={"heat": mesh.points[:, 0]})
    there = neighbours.from_pyvista(cloud.to_pyvista())
    assert isinstance(there, planish.Cloud) and np.allclose(there.attributes["heat"], mesh.points[:, 0])
    same(there, cloud)


def test_a_mesh_and_a_cloud_go_to_open3d_and_back() -> None:
    pytest.importorskip("open3d")
    mesh = colored()
    same(neighbours.from_open3d(mesh.to_open3d()), mesh)
    cloud = planish.Cloud(mesh.points, normals=mesh.points, colors=mesh.attributes["color"])
    back = neighbours.from_open3d(cloud.to_open3d())
    same(back, cloud)
    assert np.allclose(back.attributes["normal"], mesh.points)


def test_a_parquet_file_comes_in_pieces_and_is_meshed_in_bricks(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    ball = planish.sphere(level=5)
    x, y, z = ball.points.T
    file = tmp_path / "ball.parquet"
    parquet.write_table(pyarrow.table({"z": z, "east": x, "north": y.astype(np.float32), "who": ["me"] * len(x)}), file)
    columns = ("east", "north", "z")
    pieces = list(neighbours.from_parquet(file, columns, normals=columns, piece=4_000))
    assert [len(piece.points) for piece in pieces] == [4_000, 4_000, len(x) - 8_000]
    assert np.allclose(np.vstack([piece.points for piece in pieces]), ball.points, atol=1e-6)
    bricks = planish.Bricks.create(neighbours.from_parquet(file, columns, normals=columns), tmp_path / "bricks", most=6_000)
    assert (len(bricks), bricks.points) == (2, len(x))
    for k in range(2):
        bricks.clean(k)
    bricks.settle()
    for k in range(2):
        bricks.mesh(k)
    found = bricks.weld().diagnose()
    assert found["watertight"] and abs(found["volume"] / (4.0 / 3.0 * np.pi) - 1.0) < 0.01
    with pytest.raises(planish.FileError, match="no column x"):
        list(neighbours.from_parquet(file))
    with pytest.raises(planish.FileError, match="me"):
        list(neighbours.from_parquet(file, ("who", "north", "z")))
    with pytest.raises(planish.FileError, match="no column up"):
        planish.Bricks.create(neighbours.from_parquet(file, ("east", "north", "up")), tmp_path / "none")
