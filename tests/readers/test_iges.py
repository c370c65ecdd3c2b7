"""IGES as OpenCASCADE reads it: the solid of the STEP file, face by face."""

import numpy as np
import pytest
from conftest import planish

OCP = pytest.importorskip("OCP")
from OCP.BRep import BRep_Tool  # noqa: E402
from OCP.BRepCheck import BRepCheck_Analyzer  # noqa: E402
from OCP.BRepGProp import BRepGProp  # noqa: E402
from OCP.GProp import GProp_GProps  # noqa: E402
from OCP.IFSelect import IFSelect_RetDone  # noqa: E402
from OCP.IGESControl import IGESControl_Reader  # noqa: E402
from OCP.Interface import Interface_Static  # noqa: E402
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX  # noqa: E402
from test_step import TOLERANCE, cast, faces_of, parts, static  # noqa: E402
from test_step import read as read_step  # noqa: E402


def read(path):
    """The shape of an IGES file in centimetres."""
    reader = IGESControl_Reader()
    static(Interface_Static, "SetCVal")("xstep.cascade.unit", "CM")
    assert reader.ReadFile(str(path)) == IFSelect_RetDone
    reader.TransferRoots()
    return reader.OneShape()


def measure(shape, which):
    properties = GProp_GProps()
    # To a millionth of a millionth: the same surfaces are integrated in the same way.
    static(BRepGProp, which)(shape, properties)
    return properties.Mass()


@pytest.fixture(scope="module")
def file(demo, tmp_path_factory):
    path = tmp_path_factory.mktemp("iges") / "part.igs"
    planish("export", demo / "model.planish", "-o", path)
    return path


@pytest.fixture(scope="module")
def shape(file):
    return read(file)


def test_the_file_holds_one_solid_of_one_closed_shell(shape, report):
    assert len(list(parts(shape, TopAbs_SOLID))) == 1
    shells = list(parts(shape, TopAbs_SHELL))
    assert len(shells) == 1 and static(BRep_Tool, "IsClosed")(shells[0])
    assert BRepCheck_Analyzer(shape).IsValid()
    assert len(list(parts(shape, TopAbs_FACE))) == report["quality"]["patches.count"]


def test_every_edge_has_two_faces_and_a_tolerance_below_a_millionth_of_the_diagonal(shape, demo):
    uses = []
    for face in parts(shape, TopAbs_FACE):
        for edge in parts(face, TopAbs_EDGE):
            known = next((u for u in uses if u[0].IsSame(edge)), None)
            if known is None:
                uses.append((edge, [edge.Orientation()]))
            else:
                known[1].append(edge.Orientation())
    assert all(len(u) == 2 and u[0] != u[1] for _, u in uses)
    control = np.array([[p.X(), p.Y(), p.Z()] for p in (f.Value(a, b) for f in faces_of(demo / "surface.step", "CM") for a in (0, 1) for b in (0, 1))])
    diagonal = np.linalg.norm(np.ptp(control, axis=0))
    largest = max(static(BRep_Tool, "Tolerance")(cast("Edge", e)) for e in parts(shape, TopAbs_EDGE))
    largest = max([largest] + [static(BRep_Tool, "Tolerance")(cast("Vertex", v)) for v in parts(shape, TopAbs_VERTEX)])
    assert largest <= TOLERANCE * diagonal


def test_area_and_volume_are_those_of_step_to_a_millionth(shape, demo):
    step = read_step(demo / "surface.step", "CM")
    for which in ("SurfaceProperties", "VolumeProperties"):
        assert measure(shape, which) == pytest.approx(measure(step, which), rel=1e-6)
        assert measure(shape, which) > 0


def test_every_surface_is_that_of_step_to_rounding(shape, demo):
    surface = static(BRep_Tool, "Surface")
    ours = [surface(cast("Face", face)) for face in parts(shape, TopAbs_FACE)]
    theirs = faces_of(demo / "surface.step", "CM")
    t = np.linspace(0, 1, 7)
    places = [[[(p := face.Value(a, b)).X(), p.Y(), p.Z()] for a in t for b in t] for face in ours]
    wanted = [[[(p := face.Value(a, b)).X(), p.Y(), p.Z()] for a in t for b in t] for face in theirs]
    assert np.abs(np.array(places) - np.array(wanted)).max() <= 1e-12 * np.abs(wanted).max()


def test_every_line_has_80_columns(file):
    lines = file.read_text("ascii").splitlines()
    assert {len(line) for line in lines} == {80} and lines[-1][72] == "T"
