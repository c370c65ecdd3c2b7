"""Arrays in and out: layouts, dtypes, shapes, what is shared and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import planish
from planish._planish import seen_at

POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
TRIANGLES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def test_a_contiguous_float64_array_is_read_where_it_lies_and_others_are_not() -> None:
    points = np.random.default_rng(0).random((1000, 3))
    assert seen_at(points) == points.ctypes.data
    points.flags.writeable = False
    assert seen_at(points) == points.ctypes.data, "read-only"
    assert seen_at(points[100:]) == points[100:].ctypes.data, "a part that is contiguous itself"
    for other in (points[::2], np.asfortranarray(points), points.astype(np.float32)):
        assert seen_at(other) != other.ctypes.data


def test_arrays_of_an_object_are_read_only_views_of_one_memory(ball: planish.Mesh) -> None:
    a, b = ball.points, ball.points
    assert a.ctypes.data == b.ctypes.data and np.shares_memory(a, b)
    assert a.base is not None and not a.flags.writeable and a.dtype == np.float64
    assert ball.triangles.dtype == np.uint32 and not ball.triangles.flags.writeable
    with pytest.raises(ValueError):
        a[0] = 0.0
    with pytest.raises(ValueError):
        a.flags.writeable = True


def test_a_view_keeps_its_object_alive() -> None:
    view = planish.Mesh(POINTS, TRIANGLES).points
    for _ in range(100):
        planish.Mesh(POINTS + 1.0, TRIANGLES)
    assert np.array_equal(view, POINTS)


def test_an_object_does_not_change_with_the_array_that_it_was_made_from() -> None:
    points = POINTS.copy()
    mesh = planish.Mesh(points, TRIANGLES)
    points[:] = 9.0
    assert np.array_equal(mesh.points, POINTS)


@pytest.mark.parametrize(
    "points",
    [
        POINTS.tolist(),
        POINTS.astype(np.float32),
        POINTS.astype(np.int16),
        np.asfortranarray(POINTS),
        np.repeat(POINTS, 2, axis=0)[::2],
        POINTS.astype(">f8"),
        np.frombuffer(b"?" + POINTS.tobytes(), offset=1).reshape(POINTS.shape),
    ],
    ids=["list", "float32", "int16", "fortran", "strided", "big endian", "between the places of numbers"],
)
@pytest.mark.parametrize("dtype", [np.uint32, np.int64, np.int32, np.uint8, np.uint64])
def test_other_layouts_and_dtypes_of_numbers_give_the_same_mesh(points: object, dtype: type) -> None:
    mesh = planish.Mesh(points, TRIANGLES.astype(dtype))  # type: ignore[arg-type]
    assert np.array_equal(mesh.points, POINTS) and np.array_equal(mesh.triangles, TRIANGLES)


@pytest.mark.parametrize(
    ("points", "triangles", "error", "message"),
    [
        (POINTS[:, :2], TRIANGLES, ValueError, r"points: an array of shape \(n, 3\) is needed, not \(4, 2\)"),
        (POINTS[0], TRIANGLES, ValueError, r"points: .* not \(3,\)"),
        (POINTS + 1j, TRIANGLES, TypeError, "points: an array of numbers is needed, not of complex128"),
        (np.array([["a", "b", "c"]]), TRIANGLES, TypeError, "points: .* not of <U1"),
        (np.where(POINTS == 1.0, np.nan, POINTS), TRIANGLES, ValueError, r"points\[1\]: \[NaN, 0.0, 0.0\] is not finite"),
        (POINTS, TRIANGLES.astype(float), TypeError, "triangles: an array of whole numbers is needed, not of float64"),
        (POINTS, TRIANGLES[:, :2], ValueError, r"triangles: .* not \(4, 2\)"),
        (POINTS, TRIANGLES + 1, ValueError, r"triangles\[1\]: 4 names none of the 4"),
        (POINTS, (TRIANGLES + 1).astype(np.uint32), ValueError, r"triangles\[1\]: 4 names none of the 4"),
        (POINTS, TRIANGLES - 1, ValueError, r"triangles\[0\]: -1 names none of the 4"),
        ([[0.0, 0.0, 0.0], [1.0]], TRIANGLES, TypeError, "points: an array of numbers is needed"),
    ],
)
def test_what_is_wrong_is_named(points: object, triangles: object, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        planish.Mesh(points, triangles)  # type: ignore[arg-type]


def test_attributes_come_back_and_wrong_ones_are_named() -> None:
    mesh = planish.Mesh(POINTS, TRIANGLES, attributes={"color": np.eye(4)[:, :3], "heat": [1, 2, 3, 4]})
    assert mesh.attributes["color"].shape == (4, 3) and mesh.attributes["heat"].tolist() == [1, 2, 3, 4]
    with pytest.raises(ValueError, match=r'attributes\["heat"\]: 3 entries for 4 points'):
        planish.Mesh(POINTS, TRIANGLES, attributes={"heat": [1, 2, 3]})


def test_an_empty_mesh_and_an_empty_cloud_are_objects_and_stages_refuse_them() -> None:
    empty = planish.Mesh(np.empty((0, 3)), np.empty((0, 3), dtype=int))
    assert empty.points.shape == (0, 3) and "0 vertices" in repr(empty)
    for call in (empty.repair, lambda: empty.closest([[0.0, 0, 0]]), empty.layout):
        with pytest.raises(planish.MeshError):
            call()
    with pytest.raises(planish.CloudError, match="0 different points"):
        planish.Cloud(np.empty((0, 3))).clean()


def test_points_of_a_scan_that_are_not_finite_are_left_out(scan: planish.Cloud) -> None:
    points = scan.points.copy()
    points[:50] = np.nan
    cloud = planish.Cloud(points)
    assert np.isfinite(cloud.bounds).all() and len(cloud) == len(scan)
    assert np.isfinite(cloud.clean().points).all()


def test_meshes_clouds_and_surfaces_are_pickled_by_their_arrays(box: planish.Mesh, scan: planish.Cloud) -> None:
    tagged = box.decimate(ratio=0.5)
    mesh, cloud = pickle.loads(pickle.dumps((tagged, scan)))
    assert np.array_equal(mesh.points, tagged.points) and np.array_equal(mesh.feature_edges, tagged.feature_edges)
    assert np.array_equal(cloud.points, scan.points) and np.array_equal(cloud.seen_by, scan.seen_by)
    surface = planish.Surface(np.random.default_rng(1).random((5, 6, 3)))
    again = pickle.loads(pickle.dumps(surface))
    assert np.array_equal(again.control, surface.control) and np.array_equal(again.knots_u, surface.knots_u)


shapes = arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5)
dtypes = st.one_of(
    arrays.floating_dtypes(), arrays.integer_dtypes(), arrays.boolean_dtypes(), arrays.complex_number_dtypes()
)


@settings(max_examples=150, deadline=None)
@given(points=arrays.arrays(dtypes, shapes), triangles=arrays.arrays(dtypes, shapes))
def test_any_arrays_give_a_mesh_or_a_type_or_value_error(points: np.ndarray, triangles: np.ndarray) -> None:
    try:
        mesh = planish.Mesh(points, triangles)
    except (TypeError, ValueError):
        return
    assert mesh.points.shape == points.shape
    facts = mesh.diagnose()
    assert facts["vertices"] == len(points) and facts["bad_indices"] == 0
    try:
        mesh.repair()
    except planish.MeshError:
        pass


@settings(max_examples=60, deadline=None)
@given(uv=arrays.arrays(np.float64, st.tuples(st.integers(0, 20), st.just(2))))
def test_any_parameters_give_points_or_a_value_error(uv: np.ndarray) -> None:
    surface = planish.Surface(np.dstack(np.meshgrid(range(5), range(4), [0.0])).reshape(4, 5, 3))
    inside = bool(np.all((uv >= 0.0) & (uv <= 1.0)))
    if not inside:
        with pytest.raises(ValueError, match=r"uv\[\d+\]"):
            surface.evaluate(uv)
    else:
        assert np.isfinite(surface.evaluate(uv)).all()
