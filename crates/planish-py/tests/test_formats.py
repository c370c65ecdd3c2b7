"""Formats that their own libraries write, read back by these libraries."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import planish


@pytest.mark.parametrize("up", ["y", "z"])
def test_a_3dm_has_the_surfaces_as_nurbs_and_a_mesh_in_the_units_of_the_model(
    model: planish.Model, tmp_path: Path, up: str
) -> None:
    rhino3dm = pytest.importorskip("rhino3dm")
    path = tmp_path / "box.3dm"
    model.export(path, up=up)  # type: ignore[arg-type]
    file = rhino3dm.File3dm.Read(str(path))
    assert file.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Millimeters
    assert [layer.Name for layer in file.Layers] == ["surfaces", "displaced"]
    shapes = [thing.Geometry for thing in file.Objects]
    assert len(shapes) == 7 and len(shapes[-1].Vertices) == len(model.surface_mesh().points)

    def turned(points: np.ndarray) -> np.ndarray:
        return points[:, [0, 2, 1]] * [1, -1, 1] if up == "y" else points

    uv = np.random.default_rng(1).random((40, 2))
    for surface, shape in zip(model.surfaces, shapes[:-1], strict=True):
        there = shape.Surfaces[0].ToNurbsSurface() if hasattr(shape, "Surfaces") else shape
        points = [there.PointAt(float(u), float(v)) for u, v in uv]
        assert np.allclose([[p.X, p.Y, p.Z] for p in points], turned(surface.evaluate(uv)), atol=1e-12)


@pytest.mark.parametrize("name", ["box.usdc", "box.usdz"])
def test_a_binary_usd_has_what_the_text_form_has(model: planish.Model, tmp_path: Path, name: str) -> None:
    Usd = pytest.importorskip("pxr.Usd")
    model.export(tmp_path / name)
    model.export(tmp_path / "box.usda")
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted([name, "box.usda"])
    head = (tmp_path / name).read_bytes()[:8]
    assert head.startswith(b"PXR-USDC" if name.endswith("c") else b"PK")
    packed, text = (Usd.Stage.Open(str(tmp_path / n)) for n in (name, "box.usda"))
    told = [[(p.GetPath().pathString, p.GetTypeName()) for p in stage.Traverse()] for stage in (packed, text)]
    assert told[0] == told[1] and len(told[0]) > 6
    for prim in text.Traverse():
        for attribute in prim.GetAttributes():
            other = packed.GetAttributeAtPath(attribute.GetPath())
            assert str(other.Get()) == str(attribute.Get()), attribute.GetPath()


@pytest.mark.parametrize(("name", "module"), [("a.3dm", "rhino3dm"), ("a.usdc", "pxr")])
def test_a_library_that_is_not_there_is_named_with_the_way_out(
    model: planish.Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, module: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(planish.FileError, match=f"{name}: is written by") as raised:
        model.export(tmp_path / name)
    assert raised.value.hint is not None and raised.value.hint.startswith("pip install")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_and_a_model_without_surfaces_are_told(
    model: planish.Model, box: planish.Mesh, tmp_path: Path
) -> None:
    with pytest.raises(planish.FileError, match="no such folder"):
        model.export(tmp_path / "none" / "a.3dm")
    pytest.importorskip("rhino3dm")
    with pytest.raises(planish.FileError, match="no surfaces yet"):
        box.model().export(tmp_path / "a.3dm")
