"""Formats that their own libraries write: 3DM by rhino3dm, binary USD by usd-core. Each is imported when it is asked for."""

from __future__ import annotations

import importlib
import os
import tempfile
from pathlib import Path
from typing import Any

from ._planish import FileError, Model


def export(model: Model, path: str | os.PathLike[str], surface: str, up: str) -> None:
    """Writes a model by the extension of `path`, whole or not at all."""
    target = Path(path)
    write = _to_3dm if target.suffix.lower() == ".3dm" else _to_usd
    folder = target.parent
    if not folder.is_dir():
        raise _wrong(target, "cannot be written (no such folder)", "make its folder first")
    with tempfile.TemporaryDirectory(prefix=".planish-", dir=folder) as scratch:
        made = Path(scratch) / target.name
        write(model, made, surface, up, target)
        os.replace(made, target)


def _wrong(path: Path, what: str, hint: str) -> FileError:
    error = FileError(f"{path}: {what} - hint: {hint}")
    error.hint = hint
    return error


def _missing(path: Path, library: str, error: ImportError) -> FileError:
    made = _wrong(path, f"is written by {library}, which cannot be imported ({error})", f"pip install {library}")
    made.__cause__ = error
    return made


def _to_3dm(model: Model, path: Path, surface: str, up: str, told: Path) -> None:
    """The surfaces as NURBS on one layer, and a mesh of the model on another; units as the model has them."""
    try:
        # Its own stubs leave setters and arguments out.
        rhino3dm: Any = importlib.import_module("rhino3dm")
    except ImportError as error:
        raise _missing(told, "rhino3dm", error) from error
    if not model.surfaces:
        raise _wrong(told, "there is nothing to write: the model has no surfaces yet", "fit it first")
    file = rhino3dm.File3dm()
    units = rhino3dm.UnitSystem
    known = {"mm": units.Millimeters, "cm": units.Centimeters, "m": units.Meters, "in": units.Inches}
    file.Settings.ModelUnitSystem = known[model.units]
    # 3DM is z up.
    turn = (lambda p: (p[0], -p[2], p[1])) if up == "y" else (lambda p: (p[0], p[1], p[2]))
    for layer, name in enumerate(("surfaces", surface)):
        made = rhino3dm.Layer()
        made.Name = name
        file.Layers.Add(made)
    for k, patch in enumerate(model.surfaces):
        attributes = rhino3dm.ObjectAttributes()
        attributes.Name = f"patch {k}"
        attributes.LayerIndex = 0
        file.Objects.AddSurface(_nurbs(rhino3dm, patch, turn), attributes)
    attributes = rhino3dm.ObjectAttributes()
    attributes.Name = surface
    attributes.LayerIndex = 1
    file.Objects.AddMesh(_mesh(rhino3dm, model, surface, turn), attributes)
    if not file.Write(str(path), 0):
        raise _wrong(told, "rhino3dm cannot write it", "check that the folder is writable and has room")


def _nurbs(rhino3dm: Any, patch: Any, turn: Any) -> Any:
    """A bicubic surface: openNURBS leaves the first and the last knot away."""
    rows, cols, _ = patch.control.shape
    made = rhino3dm.NurbsSurface.Create(3, False, 4, 4, cols, rows)
    for knots, given in ((made.KnotsU, patch.knots_u), (made.KnotsV, patch.knots_v)):
        for i, knot in enumerate(given[1:-1]):
            knots[i] = float(knot)
    for j in range(rows):
        for i in range(cols):
            x, y, z = turn(patch.control[j, i])
            made.Points[i, j] = rhino3dm.Point4d(float(x), float(y), float(z), 1.0)
    return made


def _mesh(rhino3dm: Any, model: Model, surface: str, turn: Any) -> Any:
    source = model.surface_mesh(surface)  # type: ignore[arg-type]
    made = rhino3dm.Mesh()
    for point in source.points:
        made.Vertices.Add(*map(float, turn(point)))
    for a, b, c in source.triangles.tolist():
        made.Faces.AddFace(a, b, c)
    made.Normals.ComputeNormals()
    return made


def _to_usd(model: Model, path: Path, surface: str, up: str, told: Path) -> None:
    """What the text form has, packed by Pixar's library."""
    try:
        from pxr import Usd, UsdGeom, UsdUtils
    except ImportError as error:
        raise _missing(told, "usd-core", error) from error
    text = path.with_suffix(".usda")
    model.export(text, surface=surface, up=up)  # type: ignore[arg-type]
    stage = Usd.Stage.Open(str(text))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if up == "z" else UsdGeom.Tokens.y)
    binary = path if path.suffix.lower() == ".usdc" else path.with_suffix(".usdc")
    stage.Export(str(binary))
    if binary != path and not UsdUtils.CreateNewUsdzPackage(str(binary), str(path)):
        raise _wrong(told, "usd-core cannot pack it", "check that the folder is writable and has room")
