#!/usr/bin/env python3
"""Scans with known truth, meshed by planish and by the programs that pip installs, side by side in one run.

    python -m pip install numpy open3d pymeshlab meshlib
    python bench/peers.py TRUTH.ply [--noise 0.1,0.25] [--points 100000] [--program target/release/planish]

Points lie evenly by area, with normal noise in three directions, in percent of the diagonal. Every chain is a process
of its own; its CPU seconds are those from points in memory to a mesh (of planish: with reading and writing). Distances both
ways in percent of the diagonal, angles in degrees; the zone is within 1 % of a true edge above 40 degrees. Chains of the
others: normals from 30 neighbours (MeshLib's own by radius), then what is named, with one setting for all noise.
"""
import argparse
import importlib
import os
import resource
import subprocess
import sys
import tempfile
import time

import numpy as np

SAMPLES = 100_000


def poisson(points, out):
    import open3d as o3d
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(30))
    cloud.orient_normals_consistent_tangent_plane(30)
    mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(cloud, depth=8)
    o3d.io.write_triangle_mesh(out, mesh)


def apss(points, out):
    import pymeshlab
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points))
    meshes.compute_normal_for_point_clouds(k=30)
    meshes.generate_marching_cubes_apss(filterscale=4, resolution=200)
    meshes.save_current_mesh(out)


def fusion(points, out):
    from meshlib import mrmeshnumpy, mrmeshpy
    cloud = mrmeshnumpy.pointCloudFromPoints(points)
    cloud.normals = mrmeshpy.makeOrientedNormals(cloud, 4 * spacing(points))
    settings = mrmeshpy.PointsToMeshParameters()
    settings.sigma = 1.5 * spacing(points)
    settings.voxelSize = settings.sigma / 1.5
    settings.minWeight = 1
    mrmeshpy.saveMesh(mrmeshpy.pointsToMeshFusion(cloud, settings), out)


CHAINS = {"Open3D, Poisson depth 8": poisson, "MeshLab, APSS scale 4": apss, "MeshLib, fusion": fusion}


def spacing(points):
    """Distance of neighbouring points if they lay on the box around them."""
    a, b, c = np.ptp(points, axis=0)
    return np.sqrt(2 * (a * b + b * c + c * a) / len(points))


def read(path):
    import open3d as o3d
    return o3d.io.read_triangle_mesh(path)


def places(mesh, count, seed):
    """Points evenly by area, and the normals of their triangles."""
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    random = np.random.default_rng(seed)
    t = np.minimum(np.searchsorted(np.cumsum(area), random.random(count) * area.sum()), len(area) - 1)
    q, r = np.sqrt(random.random((count, 1))), random.random((count, 1))
    a, b, c = corners[t, 0], corners[t, 1], corners[t, 2]
    return a * (1 - q) + b * q * (1 - r) + c * q * r, cross[t] / np.maximum(area[t], 1e-300)[:, None]


def edges(mesh, diagonal):
    """Places on the edges of the truth above 40 degrees."""
    vertices, triangles = np.asarray(mesh.vertices), np.asarray(mesh.triangles)
    _, normals = face_normals(mesh)
    sides = {}
    for f, t in enumerate(triangles):
        for k in range(3):
            sides.setdefault(tuple(sorted((t[k], t[(k + 1) % 3]))), []).append(f)
    found = [[vertices[0]]]
    for (i, j), faces in sides.items():
        if len(faces) == 2 and normals[faces[0]] @ normals[faces[1]] < np.cos(np.radians(40)):
            a, b = vertices[i], vertices[j]
            n = int(np.ceil(np.linalg.norm(b - a) / (0.002 * diagonal)))
            found.append(a + (b - a) * np.linspace(0, 1, n + 1)[:, None])
    return np.concatenate(found[1:] or [np.full((1, 3), np.inf)])


def face_normals(mesh):
    corners = np.asarray(mesh.vertices)[np.asarray(mesh.triangles)]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return length, cross / np.maximum(length, 1e-300)[:, None]


def far(start, end, edge_cloud, diagonal):
    """Distances (percent), angles (degrees) and whether in the zone, of samples of one surface against the other."""
    import open3d as o3d
    points, normals = places(start, SAMPLES, 77)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(end))
    hit = scene.compute_closest_points(o3d.core.Tensor(points.astype(np.float32)))
    d = np.linalg.norm(hit["points"].numpy() - points, axis=1)
    _, there = face_normals(end)
    there = there[hit["primitive_ids"].numpy()]
    turn = np.degrees(np.arccos(np.clip((normals * there).sum(1), -1, 1)))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    zone = np.asarray(cloud.compute_point_cloud_distance(edge_cloud)) < 0.01 * diagonal
    return 100 * d / diagonal, turn, zone


def scan(mesh, count, noise):
    points, _ = places(mesh, count, 1)
    return points + noise * np.random.default_rng(2).standard_normal((count, 3))


def write_points(path, points):
    head = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % len(points)
    head += "".join(f"property double {axis}\n" for axis in "xyz") + "end_header\n"
    with open(path, "wb") as f:
        f.write(head.encode() + points.astype("<f8").tobytes())


def cpu_of(command):
    """Runs a process: its CPU seconds as it tells them, or all of them; None if it fails."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return None
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    told = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("cpu ")]
    return float(told[0]) if told else after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def row(name, seconds, truth, path, edge_cloud, diagonal):
    if seconds is None or not os.path.exists(path) or not len(read(path).triangles):
        print(f"| {name} | fails | | | | |", flush=True)
        return
    mesh = read(path)
    both = [far(truth, mesh, edge_cloud, diagonal), far(mesh, truth, edge_cloud, diagonal)]
    d, turn, zone = (np.concatenate(part) for part in zip(*both))
    if turn.mean() > 90:  # inside out: some leave that to the user
        turn = 180 - turn

    def rms(x):
        return np.sqrt((x * x).mean()) if len(x) else np.nan

    beside = turn[zone].mean() if zone.any() else np.nan
    print(f"| {name} | {seconds:.1f} | {rms(d):.3f} | {turn.mean():.1f} | {rms(d[zone]):.3f} | {beside:.1f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("truth")
    parser.add_argument("--noise", default="0.1,0.25,0.5,1")
    parser.add_argument("--points", type=int, default=100_000)
    parser.add_argument("--program", default="target/release/planish")
    parser.add_argument("--chain", help=argparse.SUPPRESS)
    parser.add_argument("--out", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.chain:
        points = np.load(args.truth)
        for module in ("open3d", "pymeshlab", "meshlib.mrmeshnumpy"):
            importlib.import_module(module)
        start = time.process_time()
        CHAINS[args.chain](points, args.out)
        print("cpu", time.process_time() - start)
        return
    truth = read(args.truth)
    diagonal = np.linalg.norm(truth.get_max_bound() - truth.get_min_bound())
    import open3d as o3d
    edge_cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(edges(truth, diagonal)))
    for level in map(float, args.noise.split(",")):
        print(f"\n{os.path.basename(args.truth)}, {args.points} points, noise {level} %")
        print("| chain | CPU s | RMS | normals | RMS in the zone | normals there |\n| --- | --- | --- | --- | --- | --- |")
        points = scan(truth, args.points, level / 100 * diagonal)
        with tempfile.TemporaryDirectory() as folder:
            ply, npy = os.path.join(folder, "scan.ply"), os.path.join(folder, "scan.npy")
            write_points(ply, points)
            np.save(npy, points)
            out = os.path.join(folder, "planish.ply")
            seconds = cpu_of([args.program, "mesh", "-q", ply, "-o", out])
            row("planish", seconds, truth, out, edge_cloud, diagonal)
            for k, name in enumerate(CHAINS):
                out = os.path.join(folder, f"{k}.ply")
                seconds = cpu_of([sys.executable, __file__, npy, "--chain", name, "--out", out])
                row(name, seconds, truth, out, edge_cloud, diagonal)


if __name__ == "__main__":
    main()
