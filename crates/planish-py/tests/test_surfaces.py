"""Surfaces against SciPy and closed forms, and as other libraries have them."""

from __future__ import annotations

import numpy as np
import pytest

import planish
from planish import neighbours

RANDOM = np.random.default_rng(5)
SURFACE = planish.Surface(RANDOM.normal(size=(6, 8, 3)))
UV = RANDOM.random((300, 2))


def test_points_and_derivatives_are_those_of_scipy_to_1e_12() -> None:
    spline = SURFACE.to_scipy()
    vu = UV[:, ::-1]
    found = SURFACE.derivatives(UV)
    assert np.allclose(SURFACE.evaluate(UV), spline(vu), atol=1e-12)
    for name, order in {"point": (0, 0), "u": (0, 1), "v": (1, 0), "uu": (0, 2), "uv": (1, 1), "vv": (2, 0)}.items():
        assert np.allclose(found[name], spline(vu, nu=order), atol=1e-10), name


def test_a_grid_of_samples_is_that_of_points_one_by_one() -> None:
    us, vs = np.linspace(0, 1, 7), np.linspace(0, 1, 5)
    grid = SURFACE.sample(us, vs)
    assert grid.shape == (5, 7, 3)
    assert np.allclose(grid[2], SURFACE.evaluate(np.column_stack([us, np.full(7, vs[2])])))


def test_normals_and_curvatures_of_a_cylinder() -> None:
    angle = np.linspace(0.0, 1.0, 81)
    points = np.stack([np.broadcast_to(np.array([2 * np.cos(a), 2 * np.sin(a), 0.0]), (9, 3)) for a in angle], axis=1)
    points = points + np.linspace(0.0, 1.0, 9)[:, None, None] * [0.0, 0.0, 1.0]
    surface = planish.Surface.fit(points, control=(4, 12))
    assert surface.control.shape == (4, 12, 3)
    assert np.allclose(np.linalg.norm(surface.evaluate(UV)[:, :2], axis=1), 2.0, atol=1e-6)
    normals = surface.normals(UV)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1.0) and np.allclose(normals[:, 2], 0.0, atol=1e-9)
    assert np.allclose(np.sort(np.abs(surface.curvatures(UV)), axis=1), [0.0, 0.5], atol=5e-3)


def test_a_flat_relief_is_found_again_after_displacing() -> None:
    relief = planish.Relief(0.01 * RANDOM.normal(size=(9, 9, 3)))
    points = SURFACE.displace(relief)
    assert points.shape == (9, 9, 3)
    base = SURFACE.sample(np.linspace(0, 1, 9), np.linspace(0, 1, 9))
    assert np.allclose(np.linalg.norm(points - base, axis=2), np.linalg.norm(relief.vectors, axis=2))


def test_a_mesh_of_a_surface_lies_on_it() -> None:
    mesh = SURFACE.mesh(17, 13)
    assert len(mesh.points) == 17 * 13 and np.allclose(mesh.points[0], SURFACE.control[0, 0])


def test_what_is_no_surface_is_refused() -> None:
    with pytest.raises(planish.FitError, match="fewer than 4 x 4"):
        planish.Surface(np.zeros((3, 5, 3)))
    with pytest.raises(planish.FitError, match="knots"):
        planish.Surface(np.zeros((4, 4, 3)), knots_u=[0, 1])
    with pytest.raises(planish.FitError, match="not finite"):
        planish.Surface(np.full((4, 4, 3), np.inf))
    with pytest.raises(ValueError, match=r"control: an array of shape \(n, n, 3\)"):
        planish.Surface(np.zeros((4, 4, 2)))
    with pytest.raises(planish.FitError):
        planish.Surface.fit(np.zeros((4, 4, 3)), control=(9, 9))
    with pytest.raises(ValueError, match=r"uv\[1\]: \[0.5, 1.5\] is not from 0 to 1"):
        SURFACE.evaluate([[0.0, 0.0], [0.5, 1.5]])


def test_surfaces_go_to_scipy_geomdl_and_splipy_and_back() -> None:
    splipy = SURFACE.to_splipy()
    assert np.allclose([splipy(u, v) for u, v in UV[:20]], SURFACE.evaluate(UV[:20]))
    pairs = [
        neighbours.surface_from_scipy(SURFACE.to_scipy()),
        neighbours.surface_from_geomdl(SURFACE.to_geomdl()),
        neighbours.surface_from_splipy(splipy),
    ]
    for again in pairs:
        assert np.allclose(again.control, SURFACE.control) and np.allclose(again.knots_v, SURFACE.knots_v)
    with pytest.raises(ValueError, match="bicubic"):
        neighbours.surface_from_geomdl({**SURFACE.to_geomdl(), "degree_u": 2})


def test_points_off_a_surface_come_back_to_their_parameters() -> None:
    # A sheet that bends slowly: offsets along its normals have their foot where they started.
    x, y = np.meshgrid(np.linspace(0, 4, 9), np.linspace(0, 3, 7))
    sheet = planish.Surface(np.stack([x, y, 0.3 * np.sin(x) * np.cos(y)], axis=2))
    uv = 0.02 + 0.96 * UV
    away = np.linspace(-0.2, 0.2, len(uv))
    found = sheet.closest(sheet.evaluate(uv) + away[:, None] * sheet.normals(uv))
    assert np.allclose(found["uv"], uv, atol=1e-7)
    assert np.allclose(found["distance"], np.abs(away), atol=1e-9)
    assert np.allclose(found["point"], sheet.evaluate(found["uv"]), atol=1e-14)


def test_a_model_tells_the_patch_and_the_place_closest_to_points(model: planish.Model) -> None:
    points = np.random.default_rng(4).uniform(-3.0, 3.0, (200, 3))
    found = model.closest(points)
    at = [model.surfaces[k].evaluate(uv[None])[0] for k, uv in zip(found["patch"], found["uv"], strict=True)]
    assert np.allclose(at, found["point"])
    half = np.array([2.0, 1.5, 1.0])
    out = np.abs(points) - half
    # The signed distance of a box: its surfaces are the box within the tolerance.
    wanted = np.where((out > 0).any(axis=1), np.linalg.norm(out.clip(0), axis=1), -out.max(axis=1))
    assert np.allclose(found["distance"], wanted, atol=0.01)
