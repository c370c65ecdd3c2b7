"""Functions of one's own, and volumes."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import planish

Reals = NDArray[np.float64]
BOX = [[-1.2] * 3, [1.2] * 3]


def ball(points: Reals) -> Reals:
    return np.linalg.norm(points, axis=1) - 1.0


def cube(points: Reals) -> Reals:
    return np.abs(points).max(axis=1) - 1.0


def test_the_mesh_of_a_ball_has_its_vertices_on_it_to_1e_12() -> None:
    mesh = planish.Field(ball, BOX).mesh(resolution=33)
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 1.0).max() < 1e-12
    assert mesh.diagnose()["watertight"] and mesh.diagnose()["genus"] == 0


@pytest.mark.parametrize("exact", [False, True])
def test_the_mesh_of_a_cube_has_sharp_edges_and_its_volume_to_1e_9(exact: bool) -> None:
    mesh = planish.Field(cube, BOX, exact=exact).mesh(voxel=0.1)
    assert mesh.diagnose()["volume"] == pytest.approx(8.0, rel=1e-9)
    assert mesh.feature_edges is not None
    ends = mesh.points[mesh.feature_edges]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(24.0, rel=1e-6)


def test_a_function_is_asked_in_batches() -> None:
    calls: list[int] = []

    def counted(points: Reals) -> Reals:
        calls.append(len(points))
        return ball(points)

    mesh = planish.Field(counted, BOX).mesh(resolution=33)
    assert len(mesh.points) > 3_000 and len(calls) < 500 and sum(calls) > 30_000


def test_a_gradient_of_ones_own_is_used_and_differences_are_as_good() -> None:
    given = planish.Field(ball, BOX, gradient=lambda p: 7.0 * p)
    points = np.random.default_rng(0).normal(size=(50, 3))
    unit = points / np.linalg.norm(points, axis=1, keepdims=True)
    assert np.allclose(given.gradients(points), unit, atol=1e-14)
    assert np.allclose(planish.Field(ball, BOX).gradients(points), unit, atol=1e-8)
    assert np.allclose(given.values(points), ball(points))


def test_what_a_function_raises_comes_up_as_it_is() -> None:
    def broken(points: Reals) -> Reals:
        raise LookupError("no such place")

    field = planish.Field(broken, BOX)
    for call in (lambda: field.mesh(resolution=20), lambda: field.values([[0.0, 0, 0]])):
        with pytest.raises(LookupError, match="no such place"):
            call()


@pytest.mark.parametrize(
    ("answer", "error"),
    [(lambda p: p, ValueError), (lambda p: 1.0, ValueError), (lambda p: ["a"] * len(p), TypeError), (lambda p: None, TypeError)],
)
def test_an_answer_of_another_shape_or_kind_is_named(answer: object, error: type[Exception]) -> None:
    with pytest.raises(error, match="what function returned"):
        planish.Field(answer, BOX).mesh(resolution=10)  # type: ignore[arg-type]


def test_nowhere_zero_and_unknown_everywhere_are_told() -> None:
    for function in (lambda p: np.ones(len(p)), lambda p: np.full(len(p), np.nan)):
        with pytest.raises(planish.ContourError, match="the surface passes none of"):
            planish.Field(function, BOX).mesh(resolution=10)


def test_wrong_fields_are_refused() -> None:
    with pytest.raises(TypeError, match="function: something that can be called"):
        planish.Field(3, BOX)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="bounds: the first corner must lie below the second"):
        planish.Field(ball, [[1.0] * 3, [-1.0] * 3])
    with pytest.raises(planish.FieldError, match="hint"):
        planish.Field(ball, BOX).mesh(resolution=5000, memory=0.01)
    with pytest.raises(ValueError, match="memory=-1"):
        planish.Field(ball, BOX).mesh(memory=-1)


def test_one_field_meshed_on_four_threads_gives_one_mesh() -> None:
    field = planish.Field(ball, BOX)
    made: list[planish.Mesh] = []
    threads = [threading.Thread(target=lambda: made.append(field.mesh(resolution=25))) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(made) == 4 and all(np.array_equal(m.points, made[0].points) for m in made)


def distances(size: int) -> NDArray[np.float32]:
    z, y, x = np.meshgrid(*[np.linspace(-1.2, 1.2, size)] * 3, indexing="ij")
    return (np.sqrt(x**2 + (1.1 * y) ** 2 + (1.2 * z) ** 2) - 1.0).astype(np.float32)


def test_a_volume_of_distances_is_meshed_with_its_axes_in_place() -> None:
    step = 2.4 / 40
    volume = planish.Volume(distances(41), spacing=step, origin=(-1.2, -1.2, -1.2))
    mesh = volume.mesh()
    assert np.allclose(mesh.bounds[1], [1.0, 1.0 / 1.1, 1.0 / 1.2], atol=5e-3)
    assert mesh.diagnose()["watertight"]
    ball = 4.0 / 3.0 * np.pi / (1.1 * 1.2)
    assert mesh.diagnose()["volume"] == pytest.approx(ball, rel=5e-3)
    assert volume.mesh(iso=-0.2).diagnose()["volume"] == pytest.approx(0.8**3 * ball, rel=5e-3)


def test_volumes_of_other_dtypes_and_layouts_are_the_same_and_wrong_ones_refused() -> None:
    values = distances(12)
    for other in (values.astype(np.float64), np.asfortranarray(values)):
        assert np.array_equal(planish.Volume(other).values, values)
    assert planish.Volume((values < 0).astype(bool)).values.max() == 1.0
    with pytest.raises(ValueError, match=r"values: an array of shape \(n, n, n\)"):
        planish.Volume(values[0])
    with pytest.raises(ValueError, match="spacing"):
        planish.Volume(values, spacing=0.0)
    with pytest.raises(planish.ContourError, match="has no surface; choose|has no surface - hint: choose"):
        planish.Volume(values).mesh(iso=99.0, volume_close=False)


def test_a_formula_gives_the_mesh_of_the_function_that_it_is() -> None:
    mesh = planish.Field("x^2 + y^2 + z^2 - 1", BOX).mesh(resolution=33)
    assert np.abs(np.linalg.norm(mesh.points, axis=1) - 1.0).max() < 1e-12
    field = planish.Field("sin(x)*y - z^2/3", BOX)
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (500, 3))
    x, y, z = points.T
    value, box = np.sin(x) * y - z**2 / 3, np.abs(points).max(axis=1) - 1.2
    # What is deep inside is as far from the box as it is.
    assert np.allclose(field.values(points), np.maximum(value, box), atol=1e-15)
    normals = np.column_stack([np.cos(x) * y, np.sin(x), -2 * z / 3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    decides = value > box
    assert decides.sum() > 300 and np.allclose(field.gradients(points)[decides], normals[decides], atol=1e-12)


def test_a_formula_ends_at_its_box_with_sharp_edges() -> None:
    mesh = planish.Field("x^2 + y^2 - 1", [[-2, -2, -1], [2, 2, 1]]).mesh(voxel=0.1)
    facts = mesh.diagnose()
    assert facts["watertight"] and facts["volume"] == pytest.approx(2 * np.pi, rel=2e-3)
    assert mesh.feature_edges is not None
    ends = mesh.points[mesh.feature_edges]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum() == pytest.approx(4 * np.pi, rel=1e-2)


def test_faults_of_a_formula_are_told_with_their_column() -> None:
    with pytest.raises(planish.FieldError, match=r'"=" has no place .* \(column 11 of the formula\)') as raised:
        planish.Field("x^2 + y^2 = 1", BOX)
    assert raised.value.hint is not None and "left - right" in raised.value.hint
    with pytest.raises(TypeError, match="exact gradients"):
        planish.Field("x", BOX, exact=True)


@pytest.mark.parametrize("name", ["ball.nrrd", "ball.npy"])
def test_a_field_is_written_as_a_volume_and_read_again(tmp_path: Path, name: str) -> None:
    volume = planish.Field(ball, BOX).sample(voxel=0.1)
    volume.write(tmp_path / name)
    back = planish.read(tmp_path / name)
    assert isinstance(back, planish.Volume) and np.array_equal(back.values, volume.values)
    if name.endswith("nrrd"):
        assert back.spacing == volume.spacing and back.origin == volume.origin
        mesh = back.mesh()
        assert np.abs(np.linalg.norm(mesh.points, axis=1) - 1.0).max() < 0.01
    else:
        array = np.load(tmp_path / name)
        assert np.array_equal(array.transpose(2, 1, 0), volume.values)
        # Where the nodes are, the values are those of the function.
        node = np.array(volume.origin) + np.array(volume.spacing) * [3, 5, 7]
        assert array[3, 5, 7] == pytest.approx(np.linalg.norm(node) - 1.0, abs=1e-6)


def test_a_sampled_function_that_raises_stops_the_call_with_what_it_raised() -> None:
    def wrong(points: Reals) -> Reals:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        planish.Field(wrong, BOX).sample(resolution=20)
    with pytest.raises(planish.FieldError, match="allow more memory"):
        planish.Field(ball, BOX).sample(resolution=500, memory=0.01)
