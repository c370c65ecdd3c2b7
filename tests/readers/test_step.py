"""surface.step as OpenCASCADE reads it: one closed solid whose edges are shared and exact."""

import collections

import pytest

OCP = pytest.importorskip("OCP")
from OCP.Bnd import Bnd_Box  # noqa: E402
from OCP.BRep import BRep_Tool  # noqa: E402
from OCP.BRepBndLib import BRepBndLib  # noqa: E402
from OCP.BRepCheck import BRepCheck_Analyzer  # noqa: E402
from OCP.BRepGProp import BRepGProp  # noqa: E402
from OCP.GProp import GProp_GProps  # noqa: E402
from OCP.IFSelect import IFSelect_RetDone  # noqa: E402
from OCP.Interface import Interface_Static  # noqa: E402
from OCP.STEPControl import STEPControl_Reader  # noqa: E402
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX  # noqa: E402
from OCP.TopExp import TopExp_Explorer  # noqa: E402
from OCP.TopoDS import TopoDS  # noqa: E402

# Largest tolerance of an edge that is accepted, in diagonals: far below what a kernel would have to sew.
TOLERANCE = 1e-6


def parts(shape, kind):
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield explorer.Current()
        explorer.Next()


def cast(name, shape):
    """TopoDS.Edge_s in some versions of the module, TopoDS.Edge in others."""
    function = getattr(TopoDS, name + "_s", None) or getattr(TopoDS, name)
    return function(shape)


def static(owner, name):
    return getattr(owner, name + "_s", None) or getattr(owner, name)


def read(path, unit="MM"):
    """The shape of a STEP file, in a unit."""
    reader = STEPControl_Reader()
    static(Interface_Static, "SetCVal")("xstep.cascade.unit", unit)
    assert reader.ReadFile(str(path)) == IFSelect_RetDone
    reader.TransferRoots()
    return reader.OneShape()


def faces_of(path, unit="MM"):
    """The surfaces of the faces of a STEP file."""
    surface = static(BRep_Tool, "Surface")
    return [surface(cast("Face", face)) for face in parts(read(path, unit), TopAbs_FACE)]


@pytest.fixture(scope="module")
def shape(demo):
    return read(demo / "surface.step")


@pytest.fixture(scope="module")
def diagonal(shape):
    box = Bnd_Box()
    static(BRepBndLib, "Add")(shape, box)
    return box.SquareExtent() ** 0.5


def test_the_file_holds_one_solid_of_one_closed_shell(shape):
    assert len(list(parts(shape, TopAbs_SOLID))) == 1
    shells = list(parts(shape, TopAbs_SHELL))
    assert len(shells) == 1
    assert static(BRep_Tool, "IsClosed")(shells[0])
    assert BRepCheck_Analyzer(shape).IsValid()


def test_it_has_one_face_per_patch(shape, report):
    assert len(list(parts(shape, TopAbs_FACE))) == report["quality"]["patches.count"]


def test_every_edge_has_two_faces_that_run_along_it_in_opposite_directions(shape):
    uses = []
    for face in parts(shape, TopAbs_FACE):
        for edge in parts(face, TopAbs_EDGE):
            known = next((u for u in uses if u[0].IsSame(edge)), None)
            if known is None:
                uses.append((edge, [edge.Orientation()]))
            else:
                known[1].append(edge.Orientation())
    counts = collections.Counter(len(u) for _, u in uses)
    assert set(counts) == {2}, f"faces per edge: {counts}"
    assert all(a != b for _, (a, b) in uses), "two faces run along an edge in one direction"


def test_no_tolerance_is_larger_than_a_millionth_of_the_diagonal(shape, diagonal):
    edges = [static(BRep_Tool, "Tolerance")(cast("Edge", e)) for e in parts(shape, TopAbs_EDGE)]
    vertices = [static(BRep_Tool, "Tolerance")(cast("Vertex", v)) for v in parts(shape, TopAbs_VERTEX)]
    assert max(edges + vertices) <= TOLERANCE * diagonal


def test_the_volume_is_positive_and_that_of_the_mesh_within_2_per_cent(shape, demo):
    trimesh = pytest.importorskip("trimesh")
    properties = GProp_GProps()
    static(BRepGProp, "VolumeProperties")(shape, properties)
    # The run was in centimetres, the reader gives millimetres.
    want = trimesh.load(demo / "mesh.ply", process=False).volume * 1000
    assert want > 0
    assert properties.Mass() == pytest.approx(want, rel=0.02)
