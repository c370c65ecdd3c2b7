"""Scans that planish writes, as laspy and pye57 read them, and theirs as planish reads them."""

import json

import numpy as np
import pytest
from conftest import planish


def ball(n=6000, noise=0.003):
    rng = np.random.default_rng(1)
    p = rng.normal(size=(n, 3))
    return p / np.linalg.norm(p, axis=1)[:, None] * (1 + rng.normal(size=(n, 1)) * noise) + [1000.0, 2000.0, 50.0]


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    path = tmp_path_factory.mktemp("scan") / "ball.xyz"
    np.savetxt(path, ball(), fmt="%.9f")
    return path


def check(points):
    assert len(points) > 5800
    radius = np.linalg.norm(points - [1000.0, 2000.0, 50.0], axis=1)
    assert abs(radius.mean() - 1) < 1e-3 and radius.std() < 2e-3


def test_las_is_read_by_laspy(text, tmp_path):
    laspy = pytest.importorskip("laspy")
    planish("clean", text, "-o", tmp_path / "out.las")
    check(np.array(laspy.read(tmp_path / "out.las").xyz))


def test_e57_is_read_by_pye57(text, tmp_path):
    pye57 = pytest.importorskip("pye57")
    planish("clean", text, "-o", tmp_path / "out.e57")
    data = pye57.E57(str(tmp_path / "out.e57")).read_scan(0, ignore_missing_fields=True)
    check(np.stack([data["cartesianX"], data["cartesianY"], data["cartesianZ"]], 1) * 1000.0)


def test_las_of_laspy_and_compressed_arrays_of_numpy_are_read(tmp_path):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = [1000, 2000, 50], [1e-6] * 3
    las = laspy.LasData(header)
    las.x, las.y, las.z = ball().T
    las.write(tmp_path / "a.las")
    np.savez_compressed(tmp_path / "a.npz", points=ball())
    for name in ["a.las", "a.npz"]:
        planish("clean", tmp_path / name, "-o", tmp_path / "out.xyz")
        check(np.loadtxt(tmp_path / "out.xyz", usecols=(0, 1, 2)))


def test_laz_is_read_by_laspy_and_is_smaller_than_las(text, tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    for name in ["out.laz", "out.las"]:
        planish("clean", text, "-o", tmp_path / name)
    check(np.array(laspy.read(tmp_path / "out.laz").xyz))
    assert (tmp_path / "out.laz").stat().st_size < 0.8 * (tmp_path / "out.las").stat().st_size
    # And by planish again.
    planish("clean", tmp_path / "out.laz", "-o", tmp_path / "again.xyz")
    check(np.loadtxt(tmp_path / "again.xyz", usecols=(0, 1, 2)))


def test_meshes_of_scans_far_from_the_origin_lie_in_their_place_or_tell_how_far_it_is(text, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    for name, middle in [("a.ply", [1000.0, 2000.0, 50.0]), ("a.obj", [1000.0, 2000.0, 50.0]), ("a.stl", [0.0] * 3)]:
        planish("mesh", text, "-o", tmp_path / name, "--report", tmp_path / "report.json")
        mesh = trimesh.load(tmp_path / name)
        assert np.abs(mesh.bounds.mean(axis=0) - middle).max() < 0.6, name
        told = [w for w in json.loads((tmp_path / "report.json").read_text())["warnings"] if w["code"] == "coordinates_moved"]
        assert [("1000 2000 50" in w["message"]) for w in told] == ([True] if name == "a.stl" else []), name


def test_only_the_wanted_classes_of_a_laz_are_read(tmp_path):
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets, header.scales = [1000, 2000, 50], [1e-6] * 3
    las = laspy.LasData(header)
    points = np.vstack([ball(), np.random.default_rng(2).uniform(-3, 3, (4000, 3)) + [1000, 2000, 50]])
    las.x, las.y, las.z = points.T
    las.classification = np.r_[np.full(6000, 2), np.full(4000, 7)].astype(np.uint8)
    las.write(tmp_path / "a.laz")
    planish("clean", tmp_path / "a.laz", "--classes", "2", "-o", tmp_path / "out.xyz")
    check(np.loadtxt(tmp_path / "out.xyz", usecols=(0, 1, 2)))
    done = planish("clean", tmp_path / "a.laz", "--classes", "9", "-o", tmp_path / "none.xyz", status=3)
    assert done.stderr.startswith("error: ") and " - hint: " in done.stderr


def test_stations_of_an_e57_come_back_with_their_positions(demo):
    pye57 = pytest.importorskip("pye57")
    file = pye57.E57(str(demo / "scan.e57"))
    assert file.scan_count == 20
    # E57 is in metres, the demonstration in centimetres.
    eyes = 100.0 * np.array([file.get_header(k).translation for k in range(20)])
    data = file.read_scan(3, ignore_missing_fields=True)
    points = 100.0 * np.stack([data["cartesianX"], data["cartesianY"], data["cartesianZ"]], 1)
    # The part is about two units across and the scanners stand 2.5 diagonals away.
    assert 1.0 < np.median(np.linalg.norm(points, axis=1)) + 0.5 < 2.5
    assert (np.linalg.norm(eyes, axis=1) > 5).all()


def test_pts_and_asc_and_named_columns_give_the_same_ball(tmp_path):
    points = ball()
    rows = [f"{x:.7f} {y:.7f} {z:.7f} {k % 300 - 100} {k % 256} 7 9" for k, (x, y, z) in enumerate(points)]
    (tmp_path / "a.pts").write_text(f"{len(rows)}\n" + "\n".join(rows) + "\n")
    (tmp_path / "b.csv").write_text("time;Z;X;Y\n" + "\n".join(f"{k};{z:.7f};{x:.7f};{y:.7f}" for k, (x, y, z) in enumerate(points)))
    (tmp_path / "c.asc").write_text("\n".join(f"{k} {y:.7f},{x:.7f},{z:.7f}" for k, (x, y, z) in enumerate(points)))
    for name, options in [("a.pts", []), ("b.csv", []), ("c.asc", ["--columns", "_yxz"])]:
        planish("clean", tmp_path / name, *options, "-o", tmp_path / "out.xyz")
        check(np.loadtxt(tmp_path / "out.xyz", usecols=(0, 1, 2)))
    done = planish("clean", tmp_path / "c.asc", "--columns", "qqq", "-o", tmp_path / "no.xyz", status=2)
    assert done.stderr.startswith("error: ") and " - hint: " in done.stderr


def test_segments_lines_and_spacing_are_written(tmp_path):
    rng = np.random.default_rng(3)
    faces = []
    for axis in range(3):
        for side in (0, 1):
            p = rng.random((3000, 3))
            p[:, axis] = side
            faces.append(p)
    box = np.vstack(faces) + rng.normal(size=(18000, 3)) * 0.002
    np.save(tmp_path / "a.npy", np.vstack([box, box * 0.5 + [3, 0, 0]]))
    planish("clean", tmp_path / "a.npy", "--segment", "--lines", tmp_path / "lines.obj", "--spacing", "0.02", "-o", tmp_path / "out.ply")
    import trimesh

    large, small = (np.asarray(trimesh.load(tmp_path / f"out-{k}.ply").vertices) for k in (0, 1))
    assert large[:, 0].max() < 1.1 and small[:, 0].min() > 2.9
    from scipy.spatial import cKDTree

    near = cKDTree(large).query(large, k=2)[0][:, 1]
    assert near.min() > 0.0199
    text = (tmp_path / "lines.obj").read_text()
    corners = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")], float)
    first = corners[corners[:, 0] < 2]
    # Every point of a line is on an edge of the box: two coordinates are 0 or 1.
    off = np.sort(np.minimum(abs(first), abs(first - 1)), axis=1)[:, 1]
    assert len(first) > 100 and np.percentile(off, 95) < 0.01


@pytest.mark.parametrize("name", ["equal", "line", "three", "nan"])
def test_points_that_are_no_surface_are_an_error_line(tmp_path, name):
    points = {
        "equal": np.ones((5000, 3)),
        "line": np.outer(np.arange(500.0), [1, 2, 3]),
        "three": np.eye(3),
        "nan": np.full((500, 3), np.nan),
    }[name]
    np.savetxt(tmp_path / "a.xyz", points)
    for command, output in [("clean", "out.ply"), ("mesh", "out.ply"), ("run", "out")]:
        done = planish(command, tmp_path / "a.xyz", "-o", tmp_path / output, status=3)
        assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr
        assert not (tmp_path / output).exists()


@pytest.mark.parametrize("damage", ["cut", "flip"])
def test_a_damaged_e57_or_laz_is_an_error_line_or_read_whole(text, tmp_path, damage):
    for name in ["a.e57", "a.laz"]:
        planish("clean", text, "-o", tmp_path / name)
        good = (tmp_path / name).read_bytes()
        bad = good[: len(good) // 2] if damage == "cut" else good[:5000] + bytes([good[5000] ^ 0xFF]) + good[5001:]
        (tmp_path / name).write_bytes(bad)
        from conftest import PLANISH
        import subprocess

        done = subprocess.run([str(PLANISH), "clean", str(tmp_path / name), "-o", str(tmp_path / "o.ply")], capture_output=True, text=True, timeout=60)
        # LAZ has no checksum: a changed byte may be read as other points.
        wanted = {0, 3} if name == "a.laz" and damage == "flip" else {3}
        assert done.returncode in wanted, (name, done.stderr)
        if done.returncode:
            assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1, done.stderr


def test_holes_are_closed_or_left_open_as_told(tmp_path):
    rng = np.random.default_rng(5)
    p = rng.normal(size=(20000, 3))
    p /= np.linalg.norm(p, axis=1)[:, None]
    p = p[p[:, 2] < 0.85] * (1 + rng.normal(size=((p[:, 2] < 0.85).sum(), 1)) * 0.002)
    np.save(tmp_path / "cap.npy", p)
    import trimesh

    planish("mesh", tmp_path / "cap.npy", "--close", "-o", tmp_path / "closed.ply")
    closed = trimesh.load(tmp_path / "closed.ply", process=False)
    assert closed.is_watertight and closed.vertices[:, 2].max() > 0.8
    # Nine in ten pairs of faces of the lid meet at less than 40 degrees; small steps are left.
    lid = closed.face_adjacency_angles[(closed.triangles_center[closed.face_adjacency].min(axis=1)[:, 2] > 0.88)]
    assert len(lid) > 0 and np.degrees(np.percentile(lid, 90)) < 40
    planish("mesh", tmp_path / "cap.npy", "--open", "-o", tmp_path / "open.ply")
    opened = trimesh.load(tmp_path / "open.ply", process=False)
    assert not opened.is_watertight


def test_a_truncated_scan_is_an_error_line(tmp_path):
    (tmp_path / "a.laz").write_bytes(b"LASF" + bytes(100))
    done = planish("clean", tmp_path / "a.laz", "-o", tmp_path / "out.ply", status=3)
    assert done.stderr.startswith("error: ") and " - hint: " in done.stderr
    assert not (tmp_path / "out.ply").exists()
