"""The stages, each against a closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import on_ball

import planish


def test_samples_of_a_noisy_ball_lie_on_it_within_a_third_of_the_noise() -> None:
    noise = 0.01
    points = on_ball(8_000) + noise * np.random.default_rng(1).normal(size=(8_000, 3))
    samples = planish.Cloud(points).clean()
    assert abs(samples.noise / noise - 1.0) < 0.15
    off = np.abs(np.linalg.norm(samples.points, axis=1) - 1.0)
    assert np.sqrt(np.mean(off**2)) < noise / 3
    assert np.all(np.einsum("ij,ij->i", samples.normals, samples.points) > 0.95)
    assert samples.closed == [True] and len(samples.radius) == len(samples)


def test_a_scan_gives_a_closed_mesh_and_samples_the_same_one(scan: planish.Cloud, samples: planish.Samples) -> None:
    mesh = samples.mesh()
    facts = mesh.diagnose()
    assert facts["watertight"] and facts["manifold"]
    whole = scan.mesh()
    assert np.array_equal(mesh.points, whole.points) and np.array_equal(mesh.triangles, whole.triangles)
    assert mesh.facts["voxel"] == pytest.approx(samples.voxel)
    assert mesh.feature_edges is not None and len(mesh.feature_edges) > 100


def test_a_coarser_voxel_gives_a_coarser_mesh(samples: planish.Samples) -> None:
    voxel = 2.0 * samples.voxel
    mesh = samples.mesh(voxel=voxel, plain=True)
    assert mesh.facts["voxel"] == pytest.approx(voxel) and len(mesh.triangles) < 12_000
    assert mesh.feature_edges is not None and len(mesh.feature_edges) == 0


def test_projected_points_leave_outliers_out_and_carry_their_figures(samples: planish.Samples) -> None:
    cloud = samples.project()
    assert {"normal", "noise", "segment", "confidence"} <= set(cloud.attributes)
    assert cloud.facts["outliers"] > 0 and cloud.facts["moved_rms"] > 0.0
    thin = samples.project(spacing=4.0 * samples.spacing)
    assert len(thin) < len(cloud) / 4


def test_a_field_of_samples_is_negative_inside(samples: planish.Samples) -> None:
    field = samples.field()
    inward = samples.points - 0.5 * samples.spacing * samples.normals
    outward = samples.points + 0.5 * samples.spacing * samples.normals
    assert np.mean(field.values(inward) < 0.0) > 0.97 and np.mean(field.values(outward) > 0.0) > 0.97


def test_tiles_are_the_mesh_with_its_edges_and_sides_that_are_none_are_refused(box: planish.Mesh) -> None:
    size = float(np.ptp(box.points, axis=0).max()) / 2.0
    tiles = box.tiles(size)
    assert sum(len(tile.triangles) for tile in tiles.values()) == len(box.triangles) and len(tiles) > 4
    for place, tile in tiles.items():
        middles = tile.points[tile.triangles].mean(axis=1)
        assert np.array_equal(np.floor(middles / size).astype(int), np.tile(place, (len(middles), 1)))
    with pytest.raises(ValueError, match="side 0: a length above 0"):
        box.tiles(0.0)


def test_smoothing_takes_noise_off_a_ball(ball: planish.Mesh) -> None:
    rough = ball.points + 0.02 * np.random.default_rng(2).normal(size=ball.points.shape)
    smooth = planish.Mesh(rough, ball.triangles).smooth()

    def spread(points: np.ndarray) -> float:
        return float(np.std(np.linalg.norm(points, axis=1)))

    assert spread(smooth.points) < spread(rough) / 2 and smooth.facts["noise"] > 0.0


def test_decimation_keeps_the_sharp_edges_of_a_box(box: planish.Mesh) -> None:
    small = box.decimate(triangles=12)
    assert len(small.triangles) <= 16 and small.diagnose()["volume"] == pytest.approx(24.0)


def test_repair_welds_a_soup_and_tells_what_it_did(box: planish.Mesh) -> None:
    soup = planish.Mesh(box.points[box.triangles].reshape(-1, 3), np.arange(3 * len(box.triangles)).reshape(-1, 3))
    mended = soup.repair()
    assert mended.facts["welded_vertices"] == len(soup.points) - len(box.points)
    assert mended.diagnose()["watertight"]


def test_tatters_of_a_border_are_cut_off_and_closed_meshes_stay(box: planish.Mesh) -> None:
    n = 40
    ij = np.array([(i, j) for j in range(n) for i in range(n)])
    cell = ij[:, 0] + ij[:, 1] * (n + 1)
    quads = np.stack([cell, cell + 1, cell + n + 2, cell + n + 1], 1)
    # A square of 20 by 40 cells with a strip of 4 by 20 beside it.
    kept = (ij[:, 0] < 20) | (abs(ij[:, 1] - 20) < 2)
    points = np.array([(i / n, j / n, 0.0) for j in range(n + 1) for i in range(n + 1)])
    faces = np.concatenate([quads[kept][:, [0, 1, 2]], quads[kept][:, [0, 2, 3]]]).astype(np.uint32)
    ragged = planish.Mesh(points, faces).repair()
    even = ragged.even_borders(0.1)
    assert even.bounds[1][0] < 0.55
    assert abs(even.facts["cut_share"] - (1 - even.diagnose()["area"] / ragged.diagnose()["area"])) < 1e-9
    assert box.even_borders(0.1).facts["cut_share"] == 0
    with pytest.raises(ValueError, match="radius=0"):
        box.even_borders(0)


def test_remeshing_a_box_keeps_its_volume_and_its_edges(box: planish.Mesh) -> None:
    made = box.remesh(resolution=21)
    assert made.diagnose()["volume"] == pytest.approx(24.0, rel=1e-9)
    assert np.allclose(made.bounds, box.bounds)


def test_comparing_a_ball_with_a_larger_one_finds_the_difference(ball: planish.Mesh) -> None:
    larger = planish.Mesh(1.01 * ball.points, ball.triangles)
    found = ball.compare(larger, samples=2_000)
    assert found["both"]["mean"] == pytest.approx(0.1, rel=0.02)
    assert found["flipped_share"] == 0.0


def test_closest_places_on_a_ball_and_its_curvature(ball: planish.Mesh) -> None:
    found = ball.closest(on_ball(500, 12.0))
    assert np.allclose(found["distance"], 2.0, atol=0.02) and found["bary"].shape == (500, 3)
    corners = ball.points[ball.triangles[found["face"]]]
    assert np.allclose(np.einsum("nk,nkd->nd", found["bary"], corners), found["position"])
    bent = ball.curvature()
    assert np.allclose([np.median(np.abs(bent[k])) for k in ("most", "least")], 0.1, rtol=0.02)


def test_the_plane_of_symmetry_of_a_box_is_one_of_three(box: planish.Mesh) -> None:
    found = box.symmetry()
    assert found["miss"] < 1e-6 and max(abs(x) for x in found["normal"]) == pytest.approx(1.0)


def test_a_shortest_way_on_a_ball_is_a_great_circle(ball: planish.Mesh) -> None:
    way = ball.geodesic([10.0, 0, 0], [0, 10.0, 0])
    assert way.length == pytest.approx(10.0 * np.pi / 2, rel=0.01)
    assert np.allclose(np.linalg.norm(way.points, axis=1), 10.0, rtol=2e-3)
    assert len(way.resampled(30)) == 30 and len(way.spaced(1.0)) == pytest.approx(17, abs=2)


def test_a_snake_on_a_ball_shrinks_and_pinned_points_stay(ball: planish.Mesh) -> None:
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    picks = 10.0 * np.column_stack([np.cos(angles), np.sin(angles), 0.3 * (-1.0) ** np.arange(12)])
    stroke = ball.paint(picks, closed=True, mode="geodesic").resampled(60)
    fair = stroke.relax(sweeps=20)
    assert stroke.closed and fair.length < stroke.length
    assert fair.facts["energy"][1]["fairness"] < fair.facts["energy"][0]["fairness"]
    held = stroke.relax(pinned=[0, 30], sweeps=20)
    assert np.allclose(held.points[[0, 30]], stroke.points[[0, 30]])
    again = planish.Curve(ball, stroke.faces, stroke.bary, closed=True)
    assert again.length == pytest.approx(stroke.length)


def test_sections_and_lines_of_a_box(box: planish.Mesh) -> None:
    cut = box.section([2.0, 0.0, 0.1], normal=[0.0, 0.0, 1.0])
    assert cut.closed and cut.length == pytest.approx(14.0)
    assert sum(line.length for line in box.sharp_lines()) == pytest.approx(4 * (4 + 3 + 2))
    assert box.boundaries() == []


def test_the_network_of_a_box_has_its_corners_and_reads_back(box: planish.Mesh, tmp_path: Path) -> None:
    network = box.layout(patches=6)
    assert network.diagnose() == {"finished": True, "faults": [], "patches": 6}
    found = {tuple(np.round(c, 9)) for c in network.corners}
    assert found == {(x, y, z) for x in (-2, 2) for y in (-1.5, 1.5) for z in (-1, 1)}
    assert set(network.curve_kinds) == {"feature"} and network.patch_corners.shape == (6, 4)
    assert len(np.unique(network.chords)) == 3
    assert planish.Network.from_json(network.to_json(), box).to_json() == network.to_json()
    network.write(tmp_path / "n.json")
    assert len(planish.Network.read(tmp_path / "n.json", box).curves) == 12
    with pytest.raises(planish.FileError, match="was made for a mesh of"):
        planish.Network.from_json(network.to_json(), planish.sphere())
    with pytest.raises(planish.NetworkError, match="made for another mesh"):
        planish.sphere().fit(network)


def test_a_model_of_a_box_is_exact_and_its_parts_fit_together(model: planish.Model, box: planish.Mesh) -> None:
    assert model.quality["patches.count"] == 6 and model.quality["surface.max_rel"] < 1e-9
    for surface, grid, relief in zip(model.surfaces, model.grids, model.reliefs, strict=True):
        assert np.allclose(surface.displace(relief), grid.points)
        assert np.allclose(surface.bake(grid).vectors, relief.vectors)
        assert surface.deviation(grid)["max"] < 1e-9 and len(relief.fold_over(surface)) == 0
    assert {s["curve"] for s in model.seams} == set(range(12))
    assert [s["name"] for s in model.stages][:2] == ["repair", "layout"]
    assert model.surface_mesh("base").diagnose()["volume"] == pytest.approx(24.0)
    angles = model.seam_angles(0.5)["angle_deg"]
    assert np.allclose(angles, 90.0)


def test_fits_on_grids_made_one_by_one_are_those_of_the_network(box: planish.Mesh) -> None:
    network = box.layout(patches=6)
    grids = network.grids(density=1.0)
    assert len(grids) == 6 and all(grid.points.shape[:2] == grid.shape for grid in grids)
    assert grids[0].places["face"].shape == (np.prod(grids[0].shape),)
    surface = planish.Surface.fit(grids[0].points, control=(5, 6))
    assert surface.control.shape == (5, 6, 3)
    assert network.fit(control=[6, 5]).quality["surface.max_rel"] < 1e-9


def test_a_box_is_divided_into_four_patches_a_side_and_fits_as_before(box: planish.Mesh) -> None:
    network = box.layout(patches=6)
    finer = network.divided()
    assert len(finer.patches) == 24 and finer.diagnose()["finished"] and finer.curve_kinds.count("feature") == 24
    assert np.allclose(network.divided(1).corners, network.corners)
    assert finer.fit(control=[4, 4]).quality["surface.max_rel"] < 1e-9
    with pytest.raises(ValueError, match="by=0: 1 to 128 are possible"):
        network.divided(0)


def test_a_project_keeps_figures_and_history_and_edits_can_be_taken_back(box: planish.Mesh, tmp_path: Path) -> None:
    drawn = box.model(units="cm")
    assert not drawn.diagnose()["finished"]
    drawn = drawn.edit("feature_lines", angle_deg=40).edit_all([{"edit": "complete", "patches": 6}])
    assert drawn.diagnose()["finished"] and drawn.facts["changed"]
    model = drawn.fit(control=[4, 4])
    model.save(tmp_path / "box.planish")
    again = planish.Model.read(tmp_path / "box.planish")
    assert again.units == "cm" and again.quality == {} and len(again.surfaces) == len(model.surfaces)
    assert again.assess().quality["surface.max"] == pytest.approx(model.quality["surface.max"], abs=1e-12)
    assert [h["command"] for h in again.history] == ["feature_lines", "complete", "fit"]
    back = again.undo(2)
    assert len(back.network.curves) == 0 and len(back.redo(2).network.curves) == len(model.network.curves)
    with pytest.raises(planish.EditError, match="nothing left to undo - hint: ask for fewer"):
        back.undo()
    with pytest.raises(TypeError, match="unknown field `corners`"):
        model.edit("drag_corner", corners=3)
    with pytest.raises(ValueError, match="unknown variant `no_such_edit`"):
        model.edit("no_such_edit")


def test_refitting_with_more_control_points_keeps_the_grids(ball: planish.Mesh) -> None:
    coarse = ball.fit(patches=6, control=[5, 5])
    fine = coarse.fit(control=[12, 12])
    assert np.array_equal(coarse.grids[0].points, fine.grids[0].points)
    assert fine.quality["surface.rms"] < coarse.quality["surface.rms"] / 10
    assert [h["command"] for h in fine.history] == ["fit", "refit"]
    denser = coarse.fit(density=4.0)
    assert denser.grids[0].points.size > coarse.grids[0].points.size


def test_every_export_is_read_back(model: planish.Model, tmp_path: Path) -> None:
    for name in ("a.ply", "a.obj", "a.stl", "a.glb"):
        model.export(tmp_path / name, surface="base")
        mesh = planish.read(tmp_path / name)
        assert isinstance(mesh, planish.Mesh)
        assert mesh.repair().diagnose()["volume"] == pytest.approx(24.0 if name != "a.glb" else 24.0e-9, rel=1e-5)
    model.export(tmp_path / "a.step")
    assert "B_SPLINE_SURFACE_WITH_KNOTS" in (tmp_path / "a.step").read_text()
    model.export(tmp_path / "maps")
    assert len(list((tmp_path / "maps").glob("*.exr"))) == 6
    with pytest.raises(planish.FileError, match="a.dxf"):
        model.export(tmp_path / "a.dxf")
    with pytest.raises(ValueError, match="surface"):
        model.export(tmp_path / "b.ply", surface="nothing")  # type: ignore[arg-type]


def test_files_are_read_by_their_extension(tmp_path: Path, scan: planish.Cloud) -> None:
    scan.write(tmp_path / "scan.e57")
    back = planish.read(tmp_path / "scan.e57")
    assert isinstance(back, planish.Cloud) and len(back) == len(scan)
    np.save(tmp_path / "points.npy", scan.points)
    assert isinstance(planish.read(tmp_path / "points.npy"), planish.Cloud)
    np.save(tmp_path / "volume.npy", np.zeros((4, 5, 6), dtype=np.float32))
    volume = planish.read(tmp_path / "volume.npy")
    assert isinstance(volume, planish.Volume) and volume.values.size == 120
    (tmp_path / "rows.txt").write_text("1 2 3 9\n4 5 6 9\n7 8 0 9\n")
    rows = planish.read(tmp_path / "rows.txt", columns="xyz_")
    assert isinstance(rows, planish.Cloud) and rows.points.tolist()[1] == [4.0, 5.0, 6.0]


def test_a_script_of_solids_is_a_field(tmp_path: Path) -> None:
    letters = Path(__file__).parents[3] / "examples" / "letters.toml"
    field = planish.read(letters)
    assert isinstance(field, planish.Field) and field.mesh(resolution=60).diagnose()["watertight"]


def test_pictures_have_their_size_and_show_something(ball: planish.Mesh, model: planish.Model) -> None:
    for shown in (ball, model, model.network):
        picture = shown.picture(120, 90)
        assert picture.shape == (90, 120, 4) and 0.1 < np.mean(picture[..., 3] > 0) <= 1.0
        assert 'src="data:image/png;base64,' in shown._repr_html_()


def test_a_moved_mesh_is_brought_back_onto_a_mesh_and_a_cloud() -> None:
    part = planish.demo_part(triangles=4_000)
    angle = 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    moved = planish.Mesh(part.points @ turn.T + [1.0, -2.0, 0.5], part.triangles)
    for other in (part, planish.Cloud(part.points)):
        back = moved.align(other)
        assert np.abs(back.points - part.points).max() < 0.02 * part.diagonal and back.facts["settled"]
        assert np.allclose(moved.points @ np.array(back.facts["linear"]).T + back.facts["shift"], back.points)
    with pytest.raises(TypeError, match="a Mesh or a Cloud"):
        moved.align(part.points)  # type: ignore[arg-type]


def test_a_model_moved_by_its_control_points_keeps_its_relief(model: planish.Model) -> None:
    away = np.array([0.0, 0.0, 5.0])
    moved = model.deform([planish.Surface(s.control + away, knots_u=s.knots_u, knots_v=s.knots_v) for s in model.surfaces])
    before, after = model.surface_mesh("displaced"), moved.surface_mesh("displaced")
    assert np.allclose(after.points, before.points + away, atol=1e-12)
    with pytest.raises(ValueError, match="1 are given"):
        model.deform(model.surfaces[:1])


def test_a_patch_gets_the_control_points_that_are_asked_for_by_its_number(box: planish.Mesh) -> None:
    model = box.fit(patches=6, control_at=[(0, 8, 6)])
    assert model.surfaces[0].control.shape == (6, 8, 3)
    with pytest.raises(planish.FitError, match="patch 99"):
        box.fit(patches=6, control_at=[(99, 8, 8)])
    with pytest.raises(TypeError, match=r"control_at=\[\[0,8\]\]"):
        box.fit(patches=6, control_at=[(0, 8)])  # type: ignore[list-item]
