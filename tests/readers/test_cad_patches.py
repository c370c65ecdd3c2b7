"""Parts that OpenCASCADE triangulates have patches along their form, and no seam over them folds."""

import json

import pytest

OCP = pytest.importorskip("OCP")
from OCP.BRepMesh import BRepMesh_IncrementalMesh  # noqa: E402
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox  # noqa: E402
from OCP.gp import gp_Pnt  # noqa: E402
from OCP.StlAPI import StlAPI_Writer  # noqa: E402

from conftest import planish
from test_step_read import cut, cylinder


def tray():
    """Bores of 6 mm stand 4 mm from the corners of a pocket and 2 mm from the walls outside."""
    tools = [BRepPrimAPI_MakeBox(gp_Pnt(10, 10, 10), 60, 40, 20).Shape(), cylinder(8, 30, (40, 30, -1))]
    tools += [cylinder(3, 30, place) for place in ((5, 5, -1), (75, 55, -1))]
    shape = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), 80, 60, 25).Shape()
    for tool in tools:
        shape = cut(shape, tool)
    return shape


def test_patches_around_narrow_walls_do_not_fold(tmp_path):
    shape = tray()
    BRepMesh_IncrementalMesh(shape, 0.1, False, 0.2, True)
    StlAPI_Writer().Write(shape, str(tmp_path / "part.stl"))
    planish("run", "part.stl", "-o", "out", cwd=tmp_path)
    quality = json.loads((tmp_path / "out" / "report.json").read_text())["quality"]
    assert quality["layout.along_form_share"] == 1
    assert (quality["grid.folds"], quality["seam.folded"]) == (0, 0)
    # Bends of a degree are seen in reflections.
    assert quality["seam.inner_angle_max_deg"] < 1.0
