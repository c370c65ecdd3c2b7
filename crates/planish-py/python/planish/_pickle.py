"""Pickling: each object by its arrays."""

from typing import Any

from ._planish import Cloud, Grid, Mesh, Network, Surface


def mesh(mesh: Mesh) -> tuple[Any, ...]:
    return _mesh, (mesh.points, mesh.triangles, mesh.attributes, mesh.feature_edges)


def _mesh(points: Any, triangles: Any, attributes: Any, feature_edges: Any) -> Mesh:
    return Mesh(points, triangles, attributes=attributes, feature_edges=feature_edges)


def cloud(cloud: Cloud) -> tuple[Any, ...]:
    seen_by = cloud.seen_by if len(cloud.seen_by) else None
    return _cloud, (cloud.points, cloud.attributes, cloud.scanners, seen_by, cloud.shift)


def _cloud(points: Any, attributes: Any, scanners: Any, seen_by: Any, shift: Any) -> Cloud:
    return Cloud(points, attributes=attributes, scanners=scanners, seen_by=seen_by, shift=shift)


def surface(surface: Surface) -> tuple[Any, ...]:
    return _surface, (surface.control, surface.knots_u, surface.knots_v)


def _surface(control: Any, knots_u: Any, knots_v: Any) -> Surface:
    return Surface(control, knots_u=knots_u, knots_v=knots_v)


def grid(grid: Grid) -> tuple[Any, ...]:
    places = grid.places
    return _grid, (grid.points, places["face"], places["bary"])


def _grid(points: Any, face: Any, bary: Any) -> Grid:
    return Grid(points, face=face, bary=bary)


def network(network: Network) -> tuple[Any, ...]:
    return Network.from_json, (network.to_json(), network.mesh)
