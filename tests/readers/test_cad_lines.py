"""Parts that OpenCASCADE triangulates, long strips beside fine lines: every sharp edge is on a sharp curve of the network."""

import json

import numpy
import pytest
import trimesh

OCP = pytest.importorskip("OCP")
from OCP.BRepAdaptor import BRepAdaptor_Curve  # noqa: E402
from OCP.BRepAlgoAPI import BRepAlgoAPI_Fuse  # noqa: E402
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet  # noqa: E402
from OCP.BRepMesh import BRepMesh_IncrementalMesh  # noqa: E402
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox  # noqa: E402
from OCP.gp import gp_Pnt  # noqa: E402
from OCP.StlAPI import StlAPI_Writer  # noqa: E402
from OCP.TopAbs import TopAbs_EDGE  # noqa: E402

from conftest import planish
from test_step import cast, parts
from test_step_read import cylinder

SHARP_DEG = 40.0


def tee():
    """Two pipes: the line where they meet bends between 40 and 90 degrees, beside strips as long as the pipes."""
    return BRepAlgoAPI_Fuse(cylinder(14, 80, (-40, 0, 0), (1, 0, 0)), cylinder(10, 40)).Shape()


def lid():
    """The upper edges of a box are rounded, so its upright edges fade out between the fillets."""
    solid = BRepPrimAPI_MakeBox(gp_Pnt(0, 0, 0), gp_Pnt(60, 40, 20)).Shape()
    made = BRepFilletAPI_MakeFillet(solid)
    for edge in parts(solid, TopAbs_EDGE):
        curve = BRepAdaptor_Curve(cast("Edge", edge))
        if curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).Z() > 19:
            made.Add(5.0, cast("Edge", edge))
    return made.Shape()


@pytest.mark.parametrize("solid", [tee, lid])
def test_every_sharp_edge_of_a_triangulated_part_is_on_a_sharp_curve(tmp_path, solid):
    shape = solid()
    BRepMesh_IncrementalMesh(shape, 0.05, False, 0.25, True)
    StlAPI_Writer().Write(shape, str(tmp_path / "part.stl"))
    planish("transform", "part.stl", "-o", "part.ply", "--move", "0,0,0", cwd=tmp_path)
    planish("layout", "part.ply", "-o", "part.json", "--coarsest", cwd=tmp_path)

    mesh = trimesh.load(tmp_path / "part.ply", process=False)
    place = lambda p: numpy.dot(p["bary"], mesh.vertices[mesh.faces[p["face"]]])  # noqa: E731
    curves = json.loads((tmp_path / "part.json").read_text())["curves"]
    lines = [numpy.array([place(p) for p in c["points"]]) for c in curves if c["kind"] == "feature"]
    length = sum(numpy.linalg.norm(numpy.diff(line, axis=0), axis=1).sum() for line in lines)

    ends = mesh.vertices[mesh.face_adjacency_edges]
    sharp = mesh.face_adjacency_angles > numpy.radians(SHARP_DEG)
    assert length == pytest.approx(numpy.linalg.norm(ends[sharp, 0] - ends[sharp, 1], axis=1).sum(), rel=1e-6)
