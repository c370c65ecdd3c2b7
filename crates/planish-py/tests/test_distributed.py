"""Batches on a Dask cluster: workers are processes, one is killed, and a scheduler is reached by its address."""

from __future__ import annotations

import os
import pickle
import signal
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planish

distributed_library = pytest.importorskip("distributed")
from planish import distributed  # noqa: E402

QUICK: dict[str, Any] = {"patches": 6}
#: Products that are the same bytes at every run: reports have times.
SAME = ("mesh.ply", "surface.step", "preview.glb", "relief/relief.json")


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("parts")
    for k in range(3):
        planish.cuboid((3.0 + k, 3.0, 2.0), cells=3).write(folder / f"box-{k}.stl")
    (folder / "box-0.ply").write_text("this is no mesh")
    return sorted(folder.iterdir())


def test_a_cluster_makes_the_bytes_of_run_many_and_skips_what_is_finished(parts: list[Path], tmp_path: Path) -> None:
    here = planish.run_many(parts, tmp_path / "here", jobs=2, **QUICK)
    told: list[planish.Row] = []
    with distributed_library.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        # By the address on the loopback interface, as that of any cluster.
        address = cluster.scheduler_address
        there = distributed.run_many(parts, tmp_path / "there", cluster=address, progress=told.append, **QUICK)
        assert [row.status for row in there] == [row.status for row in here] == ["failed", "done", "done", "done"]
        assert len(told) == 4 and there[0].error is not None and "box-0.ply" in there[0].error
        for a, b in zip(here[1:], there[1:], strict=True):
            assert a.folder.name == b.folder.name
            for name in SAME:
                assert (a.folder / name).read_bytes() == (b.folder / name).read_bytes(), name
        with distributed_library.Client(cluster) as client:
            again = distributed.run_many(parts, tmp_path / "there", cluster=client, **QUICK)
    assert [row.status for row in again] == ["failed", "skipped", "skipped", "skipped"]
    # And the other way about: one manifest for all ways.
    assert [r.status for r in planish.run_many(parts[1:], tmp_path / "there", **QUICK)][1:] == ["skipped", "skipped"]


def test_a_killed_worker_costs_only_time(tmp_path: Path) -> None:
    part = tmp_path / "part.ply"
    planish.demo_part(triangles=8_000).write(part)
    killed: list[int] = []

    def kill(cluster: Any) -> None:
        end = time.monotonic() + 60.0
        while not list((tmp_path / "out").glob("part/.planish-partial-*")) and time.monotonic() < end:
            time.sleep(0.05)
        for worker in list(cluster.workers.values())[:1]:
            killed.append(worker.process.process.pid)
            os.kill(killed[0], signal.SIGKILL)

    with distributed_library.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        killer = threading.Thread(target=kill, args=(cluster,))
        killer.start()
        table = distributed.run_many([part], tmp_path / "out", cluster=cluster, patches=20, threads=2)
        killer.join()
    assert len(killed) == 1 and [row.status for row in table] == ["done"]
    planish.run(part, tmp_path / "alone", patches=20, threads=1)
    for name in SAME:
        assert (tmp_path / "alone" / name).read_bytes() == (table[0].folder / name).read_bytes(), name


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("scan") / "scan.ply"
    planish.virtual_scan(planish.demo_part(triangles=20_000), points=12_000, stations=8, outliers=0.0).write(file)
    return file


def alone(scan: Path, folder: Path) -> planish.Mesh:
    """Bricks in this process, one after the other, the last one first."""
    bricks = planish.Bricks.create(scan, folder, most=4_000, close=True)
    assert bricks.points == len(planish.read(scan).points) and len(bricks) > 2
    for k in reversed(range(len(bricks))):
        bricks.clean(k)
    bricks.settle()
    for k in reversed(range(len(bricks))):
        bricks.mesh(k)
    return bricks.weld()


def same(a: planish.Mesh, b: planish.Mesh) -> bool:
    return bool((a.points == b.points).all() and (a.triangles == b.triangles).all())


def test_bricks_on_a_cluster_with_a_killed_worker_are_the_mesh_of_one_process(scan: Path, tmp_path: Path) -> None:
    here = alone(scan, tmp_path / "here")
    assert here.diagnose()["watertight"]
    killed: list[int] = []

    def kill(cluster: Any) -> None:
        end = time.monotonic() + 60.0
        while not list((tmp_path / "there").glob("facts-*")) and time.monotonic() < end:
            time.sleep(0.02)
        worker = next(iter(cluster.workers.values()))
        killed.append(worker.process.process.pid)
        os.kill(killed[0], signal.SIGKILL)

    told: list[tuple[str, float]] = []
    with distributed_library.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        killer = threading.Thread(target=kill, args=(cluster,))
        killer.start()
        there = distributed.mesh(
            scan,
            cluster=cluster.scheduler_address,
            folder=tmp_path / "there",
            most=4_000,
            close=True,
            progress=lambda step, share: told.append((step, share)),
        )
        killer.join()
    assert len(killed) == 1 and same(here, there)
    assert [step for step, share in told if share == 1.0] == ["clean", "settle", "mesh"]


def test_a_model_fitted_on_a_cluster_with_a_killed_worker_has_the_bytes_of_one_process() -> None:
    network = planish.demo_part(triangles=8_000).layout(patches=40)
    killed: list[int] = []

    def kill(cluster: Any) -> None:
        ends = time.monotonic() + 60.0
        while not killed and time.monotonic() < ends:
            busy = [
                task.processing_on.name
                for task in list(cluster.scheduler.tasks.values())
                if task.processing_on and str(task.key).startswith("planish-relax")
            ]
            if busy:
                killed.append(cluster.workers[busy[0]].process.process.pid)
                os.kill(killed[0], signal.SIGKILL)
            time.sleep(0.01)

    with distributed_library.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        killer = threading.Thread(target=kill, args=(cluster,))
        killer.start()
        there = distributed.fit(network, cluster=cluster.scheduler_address, tolerance=2e-4, density=3.0)
        killer.join()
        with pytest.raises(planish.GridError, match="with four sides|flattened|sides of at least"):
            distributed.fit(network, cluster=cluster, min_side=30, max_side=20)
    here = network.fit(tolerance=2e-4, density=3.0)
    assert len(killed) == 1 and there.quality == here.quality
    for a, b in zip(here.grids, there.grids, strict=True):
        assert np.array_equal(a.points, b.points) and np.array_equal(a.places["bary"], b.places["bary"])
    for a, b in zip(here.surfaces, there.surfaces, strict=True):
        assert np.array_equal(a.control, b.control)


def test_grids_of_some_patches_are_those_of_all_and_what_relax_raises_comes_up() -> None:
    network = planish.cuboid(cells=6).layout(patches=6)
    grids = network.grids()
    sizes = [grid.shape[::-1] for grid in grids]
    some = network.relax([1, 4], [sizes[1], sizes[4]])
    again = pickle.loads(pickle.dumps(some[1]))
    for grid in (some[1], again):
        assert np.array_equal(grid.points, grids[4].points) and np.array_equal(grid.places["face"], grids[4].places["face"])
    assert np.array_equal(pickle.loads(pickle.dumps(network)).relax([1], [sizes[1]])[0].points, grids[1].points)
    with pytest.raises(ValueError, match="patches rise"):
        network.relax([4, 1], [sizes[4], sizes[1]])
    with pytest.raises(ValueError, match="names none of the 6"):
        network.relax([6], [(5, 5)])
    with pytest.raises(RuntimeError, match="not today"):
        network.fit(relax=lambda patches, sizes, stopped: (_ for _ in ()).throw(RuntimeError("not today")))
    with pytest.raises(planish.GridError, match="no grids of the sizes"):
        network.fit(relax=lambda patches, sizes, stopped: [])


def test_bricks_tell_what_is_wrong_with_folders_and_files(scan: Path, tmp_path: Path) -> None:
    with pytest.raises(planish.CloudError, match="bricks"):
        planish.Bricks(tmp_path)
    with pytest.raises(planish.FileError, match="cannot read it"):
        planish.Bricks.create(tmp_path / "missing.ply", tmp_path / "new")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine").write_text("mine")
    with pytest.raises(planish.CloudError, match="is not empty"):
        planish.Bricks.create(scan, tmp_path / "full")
    (tmp_path / "torn.xyz").write_text("0 0 0\n" * 1000 + "1 1\n")
    for _ in range(2):  # what failed leaves nothing that a second try would refuse
        with pytest.raises(planish.FileError, match="line 1001"):
            planish.Bricks.create(tmp_path / "torn.xyz", tmp_path / "torn")
    with pytest.raises(TypeError, match="voxels"):
        planish.Bricks.create(scan, tmp_path / "other", voxels=3)  # type: ignore[call-arg]
    bricks = planish.Bricks.create(scan, tmp_path / "bricks", most=4_000)
    with pytest.raises(IndexError, match=f"brick 99: there are {len(bricks)}"):
        bricks.clean(99)
    with pytest.raises(planish.CloudError, match="facts-00000"):
        bricks.settle()
    with pytest.raises(planish.CloudError, match="plan"):
        bricks.weld()
    again = planish.Bricks(tmp_path / "bricks")
    assert (len(again), again.points) == (len(bricks), bricks.points)


def test_points_of_bricks_lie_on_the_surface_as_those_of_the_whole(scan: Path, tmp_path: Path) -> None:
    whole = planish.read(scan)
    points = whole.clean().project()
    bricks = planish.Bricks.create(scan, tmp_path / "bricks", most=4_000)
    with pytest.raises(planish.CloudError, match="plan"):
        bricks.project(0)
    for k in range(len(bricks)):
        bricks.clean(k)
    bricks.settle()
    pieces = [bricks.project(k) for k in range(len(bricks))]
    assert abs(sum(len(p.points) for p in pieces) - len(points.points)) < 0.01 * len(points.points)
    assert all(p.attributes.keys() == points.attributes.keys() for p in pieces)
    surface = whole.mesh()
    off = np.concatenate([surface.closest(p.points)["distance"] for p in pieces])
    assert np.median(off) < 1.1 * np.median(surface.closest(points.points)["distance"])
    thin = bricks.project(0, spacing=0.1 * float(np.ptp(whole.points, axis=0).max()))
    assert 0 < len(thin.points) < len(pieces[0].points)


def test_wrong_options_are_told_as_elsewhere(parts: list[Path], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="jobs=0"):
        distributed.run_many(parts, tmp_path, jobs=0)
    assert distributed.run_many([], tmp_path) == []
