"""Solids that OpenCASCADE writes as STEP, read by planish: closed, as large, in their place."""

import json
import math

import numpy
import pytest
import trimesh

OCP = pytest.importorskip("OCP")
from OCP.BRep import BRep_Builder  # noqa: E402
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut  # noqa: E402
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace  # noqa: E402
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeWire, BRepBuilderAPI_NurbsConvert  # noqa: E402
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet  # noqa: E402
from OCP.BRepGProp import BRepGProp  # noqa: E402
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections  # noqa: E402
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCone, BRepPrimAPI_MakeCylinder  # noqa: E402
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeRevol  # noqa: E402
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere, BRepPrimAPI_MakeTorus  # noqa: E402
from OCP.gp import gp_Ax1, gp_Ax2, gp_Circ, gp_Dir, gp_Elips, gp_Pnt, gp_Trsf, gp_Vec  # noqa: E402
from OCP.GProp import GProp_GProps  # noqa: E402
from OCP.Interface import Interface_Static  # noqa: E402
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer  # noqa: E402
from OCP.TopAbs import TopAbs_EDGE  # noqa: E402
from OCP.TopExp import TopExp_Explorer  # noqa: E402
from OCP.TopLoc import TopLoc_Location  # noqa: E402
from OCP.TopoDS import TopoDS_Compound  # noqa: E402

from conftest import planish
from test_step import cast, faces_of, parts, static

# Share of the diagonal that a triangle may be off its face.
TOLERANCE = 2e-5


def box():
    return BRepPrimAPI_MakeBox(10.0, 20.0, 30.0).Shape()


def cylinder(radius, height, at=(0, 0, 0), along=(0, 0, 1)):
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*at), gp_Dir(*along)), radius, height).Shape()


def cut(a, b):
    return BRepAlgoAPI_Cut(a, b).Shape()


def fillets():
    solid = box()
    made = BRepFilletAPI_MakeFillet(solid)
    for edge in parts(solid, TopAbs_EDGE):
        made.Add(1.5, cast("Edge", edge))
    return made.Shape()


def face(edge):
    return BRepBuilderAPI_MakeFace(BRepBuilderAPI_MakeWire(edge).Wire()).Face()


def loft():
    made = BRepOffsetAPI_ThruSections(True)
    for height, radius in [(0, 3), (5, 5), (10, 2)]:
        circle = gp_Circ(gp_Ax2(gp_Pnt(0, 0, height), gp_Dir(0, 0, 1)), radius)
        made.AddWire(BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(circle).Edge()).Wire())
    return made.Shape()


def moved(shape, axis, turn, by):
    turned, shifted = gp_Trsf(), gp_Trsf()
    turned.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*axis)), turn)
    shifted.SetTranslation(gp_Vec(*by))
    return shape.Moved(TopLoc_Location(shifted.Multiplied(turned)))


def compound(*shapes):
    made, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(made)
    for shape in shapes:
        builder.Add(made, shape)
    return made


def assembly():
    inner = compound(moved(box(), (0, 0, 1), 0.5, (50, 0, 0)), moved(cylinder(3, 10), (1, 0, 0), 1.0, (0, 40, 5)))
    return compound(moved(inner, (0, 1, 0), 0.7, (5, 6, 7)), moved(inner, (1, 1, 0), 2.0, (-100, 6, 7)), box())


def ring():
    ellipse = gp_Elips(gp_Ax2(gp_Pnt(7, 0, 5), gp_Dir(0, 1, 0)), 4.0, 2.0)
    axis = gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))
    return BRepPrimAPI_MakeRevol(face(BRepBuilderAPI_MakeEdge(ellipse).Edge()), axis).Shape()


def rod():
    ellipse = gp_Elips(gp_Ax2(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1)), 5.0, 2.0)
    return BRepPrimAPI_MakePrism(face(BRepBuilderAPI_MakeEdge(ellipse).Edge()), gp_Vec(0, 1, 4)).Shape()


SOLIDS = {
    "box": box,
    "cylinder": lambda: cylinder(3, 10),
    "part of a cylinder": lambda: BRepPrimAPI_MakeCylinder(3.0, 10.0, math.pi / 3).Shape(),
    "cone": lambda: BRepPrimAPI_MakeCone(3.0, 0.0, 10.0).Shape(),
    "wedge of a cone": lambda: BRepPrimAPI_MakeCone(3.0, 0.0, 10.0, 1.0).Shape(),
    "ball": lambda: BRepPrimAPI_MakeSphere(5.0).Shape(),
    "zone of a ball": lambda: BRepPrimAPI_MakeSphere(5.0, -0.4, 0.9).Shape(),
    "cap of a ball": lambda: BRepPrimAPI_MakeSphere(5.0, 0.3, math.pi / 2).Shape(),
    "wedge of a ball": lambda: BRepPrimAPI_MakeSphere(5.0, 1.2).Shape(),
    "torus": lambda: BRepPrimAPI_MakeTorus(10.0, 3.0).Shape(),
    "bend": lambda: BRepPrimAPI_MakeTorus(10.0, 3.0, 1.0).Shape(),
    "holes across": lambda: cut(cylinder(5, 20), cylinder(3, 30, (-10, 0, 10), (1, 0, 0))),
    "ball with a hole beside its pole": lambda: cut(
        BRepPrimAPI_MakeSphere(5.0).Shape(), cylinder(2, 30, (1, 0, -10))
    ),
    "ball with a hole across": lambda: cut(
        BRepPrimAPI_MakeSphere(5.0).Shape(), cylinder(2, 30, (-10, 0, 0), (1, 0, 0))
    ),
    "void": lambda: cut(box(), BRepPrimAPI_MakeSphere(gp_Pnt(5, 10, 15), 3.0).Shape()),
    "fillets": fillets,
    "loft of degree 14": loft,
    "ring of an ellipse": ring,
    "oblique rod": rod,
    "assembly": assembly,
}

# What is converted to rational B-splines is measured as it was before: OpenCASCADE's own figures of splines are coarse.
SPLINES = ["part of a cylinder", "cone", "ball", "torus", "fillets", "holes across"]


def write(shape, path, unit="MM"):
    # The unit of the shape is the library's for all files: other tests set it.
    static(Interface_Static, "SetCVal")("xstep.cascade.unit", "MM")
    static(Interface_Static, "SetCVal")("write.step.unit", unit)
    static(Interface_Static, "SetIVal")("write.step.assembly", 1)
    writer = STEPControl_Writer()
    writer.Transfer(shape, STEPControl_AsIs)
    writer.Write(str(path))


def check(tmp_path, shape, written, unit="MM", scale=1.0):
    write(written, tmp_path / "a.step", unit)
    planish("transform", tmp_path / "a.step", "--scale", 1, "-o", tmp_path / "a.ply", "-q")
    mesh = trimesh.load(tmp_path / "a.ply", process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    volume, area = GProp_GProps(), GProp_GProps()
    static(BRepGProp, "VolumeProperties")(shape, volume)
    static(BRepGProp, "SurfaceProperties")(shape, area)
    off = TOLERANCE * mesh.scale * scale
    assert abs(mesh.volume * scale**3 - volume.Mass()) <= off * area.Mass()
    assert abs(mesh.area * scale**2 / area.Mass() - 1) < 1e-4
    middle = volume.CentreOfMass()
    place = mesh.center_mass * scale
    assert math.dist(place, (middle.X(), middle.Y(), middle.Z())) < 5 * off


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_closed_and_as_large(tmp_path, name):
    shape = SOLIDS[name]()
    check(tmp_path, shape, shape)


@pytest.mark.parametrize("name", SPLINES)
def test_rational_splines_are_closed_and_as_large(tmp_path, name):
    shape = SOLIDS[name]()
    check(tmp_path, shape, BRepBuilderAPI_NurbsConvert(shape).Shape())


def test_inches_are_read_as_inches(tmp_path):
    check(tmp_path, box(), box(), unit="INCH", scale=25.4)
    report = json.loads(planish("info", tmp_path / "a.step", "--json").stdout)
    assert report["input"]["units"] == "in"


def test_the_surfaces_of_a_run_are_where_its_model_has_them(demo, tmp_path):
    planish("compare", demo / "surface.step", demo / "model.planish", "--surface", "base", "--report", tmp_path / "a.json")
    figures = json.loads((tmp_path / "a.json").read_text())
    assert figures["input"]["units"] == "cm"
    assert figures["quality"]["distance.rms_rel"] < 1e-4


def test_control_points_moved_by_another_program_deform_the_model(demo, tmp_path):
    """Faces in reverse order, their parameters turned, in another unit, and stretched along z."""
    surfaces = faces_of(demo / "surface.step")
    compound, builder = TopoDS_Compound(), BRep_Builder()
    builder.MakeCompound(compound)
    for k, surface in enumerate(reversed(surfaces)):
        surface = surface.Copy()
        for i in range(1, surface.NbUPoles() + 1):
            for j in range(1, surface.NbVPoles() + 1):
                p = surface.Pole(i, j)
                surface.SetPole(i, j, gp_Pnt(p.X(), p.Y(), 1.25 * p.Z()))
        if k % 2:
            surface.ExchangeUV()
        if k % 3:
            surface.UReverse()
        builder.Add(compound, BRepBuilderAPI_MakeFace(surface, 1e-6).Face())
    write(compound, tmp_path / "stretched.step", "M")
    told = planish("deform", demo / "model.planish", tmp_path / "stretched.step", "-o", "deformed.planish", cwd=tmp_path)
    for model, name in [(demo / "model.planish", "before.ply"), ("deformed.planish", "after.ply")]:
        planish("export", model, "--surface", "base", "-o", name, "-q", cwd=tmp_path)
    before, after = [trimesh.load(tmp_path / name, process=False) for name in ("before.ply", "after.ply")]
    assert after.is_watertight and "apart by" in told.stdout
    off = numpy.abs(before.vertices * [1, 1, 1.25] - after.vertices).max()
    assert off < 1e-6 * before.scale
