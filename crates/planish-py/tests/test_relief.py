"""The relief of a model: arrays in and out, layers, detail of another model."""

from __future__ import annotations

import numpy as np
import pytest

import planish


@pytest.fixture(scope="module")
def detailed() -> planish.Model:
    """A ball with bumps, on few control points: the bumps are relief."""
    ball = planish.sphere(10.0, 4)
    unit = ball.points / 10.0
    bumps = 0.05 * np.sin(25.0 * unit[:, 0]) * np.sin(22.0 * unit[:, 1])
    return planish.Mesh(ball.points + bumps[:, None] * unit, ball.triangles).fit(patches=6, control=[6, 6])


@pytest.fixture(scope="module")
def plain(detailed: planish.Model) -> planish.Model:
    """Its smooth form on other patches."""
    return detailed.surface_mesh("base").fit(patches=24, tolerance=2e-4)


def test_detail_moves_to_a_model_with_another_network(detailed: planish.Model, plain: planish.Model) -> None:
    made = plain.transfer_relief(detailed)
    assert made.facts["missed"] == 0 and made.facts["texels"] == sum(r.vectors.shape[0] * r.vectors.shape[1] for r in made.reliefs)
    wanted = detailed.surface_mesh("displaced")
    before, after = (m.surface_mesh("displaced").compare(wanted)["both"]["rms"] for m in (plain, made))
    assert before > 0.03 and after < 0.3 * before
    assert made.history[-1]["command"] == "relief transfer" and made.edit_relief("undo").reliefs[0].vectors.tolist() == plain.reliefs[0].vectors.tolist()
    nothing = plain.transfer_relief(detailed, reach=1e-9)
    # But for corners, which lie on the form that was fitted.
    assert nothing.facts["texels"] - nothing.facts["missed"] <= 4 * len(plain.reliefs)


def test_detail_goes_along_with_pairs_of_places_to_a_turned_and_doubled_copy(detailed: planish.Model, plain: planish.Model) -> None:
    turn = np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    copy = plain.surface_mesh("base")
    moved = planish.Mesh(copy.points @ turn.T + [50.0, 0.0, 0.0], copy.triangles).fit(patches=24, tolerance=2e-4)
    # Both are balls of radius 10, but for what the fit leaves.
    places = 10.0 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.6, 0.8, 0]])
    points = np.stack([places, places @ turn.T + [50.0, 0.0, 0.0]], axis=1)
    made = moved.transfer_relief(detailed, points=points)
    assert made.facts["missed"] == 0 and len(made.history[-1]["parameters"]["points"]) == 7
    whole = detailed.surface_mesh("displaced")
    wanted = planish.Mesh(whole.points @ turn.T + [50.0, 0.0, 0.0], whole.triangles)
    before, after = (m.surface_mesh("displaced").compare(wanted)["both"]["rms"] for m in (moved, made))
    assert before > 0.06 and after < 0.3 * before
    with pytest.raises(planish.ReliefError, match="2 pairs are given"):
        moved.transfer_relief(detailed, points=points[:2])
    with pytest.raises(planish.ReliefError, match="mirror image"):
        moved.transfer_relief(detailed, points=np.stack([places, (places * [-1, 1, 1]) @ turn.T + [50.0, 0.0, 0.0]], axis=1))
    with pytest.raises(ValueError, match="points"):
        moved.transfer_relief(detailed, points=points[:, :, :2])


def test_arrays_become_the_relief_and_are_a_layer_that_can_be_taken_back(detailed: planish.Model) -> None:
    doubled = detailed.with_reliefs([planish.Relief(2.0 * r.vectors) for r in detailed.reliefs], name="doubled")
    for new, old in zip(doubled.reliefs, detailed.reliefs, strict=True):
        assert np.allclose(new.vectors[1:-1, 1:-1], 2.0 * old.vectors[1:-1, 1:-1], atol=1e-12)
    back = doubled.edit_relief("undo")
    assert all(np.array_equal(a.vectors, b.vectors) for a, b in zip(back.reliefs, detailed.reliefs, strict=True))
    same = back.edit_relief("redo")
    assert np.array_equal(same.reliefs[0].vectors, doubled.reliefs[0].vectors)
    with pytest.raises(ValueError, match=r"reliefs\[0\]: its shape is \[4, 4\]"):
        detailed.with_reliefs([planish.Relief(np.zeros((4, 4, 3)))] * len(detailed.reliefs))
    with pytest.raises(ValueError, match="1 are given"):
        detailed.with_reliefs(detailed.reliefs[:1])


def test_edits_of_a_script_are_methods_and_faults_are_told(detailed: planish.Model) -> None:
    blurred = detailed.edit_relief("blur", radius=1.0)
    rough = [np.abs(np.diff(m.reliefs[0].vectors, axis=0)).mean() for m in (detailed, blurred)]
    assert rough[1] < rough[0]
    with pytest.raises(TypeError, match="unknown field"):
        detailed.edit_relief("blur", radios=1.0)
    with pytest.raises(planish.ReliefError, match="nothing left to undo"):
        detailed.edit_relief("undo")


def test_a_model_without_surfaces_is_refused(box: planish.Mesh, detailed: planish.Model) -> None:
    with pytest.raises(planish.ReliefError, match="no relief yet"):
        box.model().transfer_relief(detailed)


def test_form_and_detail_are_parted_at_a_wavelength_and_the_shape_stays(detailed: planish.Model) -> None:
    parted = detailed.part_relief(20.0)
    levelled = detailed.level_relief(control=[8, 8])
    assert levelled.surfaces[0].control.shape == (8, 8, 3)
    whole = detailed.surface_mesh("displaced")
    for made in (parted, levelled):
        assert made.surface_mesh("displaced").compare(whole)["both"]["max"] < 0.02
