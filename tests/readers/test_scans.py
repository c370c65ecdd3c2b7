"""Scans that planish writes, as laspy and pye57 read them, and theirs as planish reads them."""

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
    check(np.stack([data["cartesianX"], data["cartesianY"], data["cartesianZ"]], 1))


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


def test_a_truncated_scan_is_an_error_line(tmp_path):
    (tmp_path / "a.laz").write_bytes(b"LASF" + bytes(100))
    done = planish("clean", tmp_path / "a.laz", "-o", tmp_path / "out.ply", status=3)
    assert done.stderr.startswith("error: ") and " - hint: " in done.stderr
    assert not (tmp_path / "out.ply").exists()
