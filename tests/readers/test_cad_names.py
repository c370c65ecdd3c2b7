"""Names and colours of STEP and IGES files, as OpenCASCADE's readers for them (XCAF) give them."""

import pytest

OCP = pytest.importorskip("OCP")
from conftest import planish  # noqa: E402
from OCP.IFSelect import IFSelect_RetDone  # noqa: E402
from OCP.IGESCAFControl import IGESCAFControl_Reader  # noqa: E402
from OCP.Interface import Interface_Static  # noqa: E402
from OCP.Quantity import Quantity_Color, Quantity_TypeOfColor  # noqa: E402
from OCP.STEPCAFControl import STEPCAFControl_Reader  # noqa: E402
from OCP.TCollection import TCollection_ExtendedString  # noqa: E402
from OCP.TDataStd import TDataStd_Name  # noqa: E402
from OCP.TDF import TDF_ChildIterator  # noqa: E402
from OCP.TDocStd import TDocStd_Document  # noqa: E402
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID  # noqa: E402
from OCP.XCAFDoc import XCAFDoc_ColorType, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool  # noqa: E402
from test_step import static  # noqa: E402


def labels(label):
    children = TDF_ChildIterator(label, True)
    while children.More():
        yield children.Value()
        children.Next()


def found(path, reader):
    """Names of solids, faces and edges, and the colours of the faces as bytes, in the order of the document."""
    static(Interface_Static, "SetIVal")("read.stepcaf.subshapes.name", 1)
    document = TDocStd_Document(TCollection_ExtendedString("XmlXCAF"))
    reader.SetNameMode(True)
    reader.SetColorMode(True)
    assert reader.ReadFile(str(path)) == IFSelect_RetDone and reader.Transfer(document)
    shapes = static(XCAFDoc_DocumentTool, "ShapeTool")(document.Main())
    tool = static(XCAFDoc_DocumentTool, "ColorTool")(document.Main())
    names = {TopAbs_SOLID: [], TopAbs_FACE: [], TopAbs_EDGE: []}
    colors = {}
    for label in labels(shapes.Label()):
        shape = static(XCAFDoc_ShapeTool, "GetShape")(label)
        if shape is None or shape.IsNull() or shape.ShapeType() not in names:
            continue
        name = TDataStd_Name()
        if label.FindAttribute(static(TDataStd_Name, "GetID")(), name):
            name = name.Get().ToExtString()
            names[shape.ShapeType()].append(name)
            color = Quantity_Color()
            # Of STEP files it is the colour of the surface, of IGES files that of the shape as a whole.
            kinds = [XCAFDoc_ColorType.XCAFDoc_ColorSurf, XCAFDoc_ColorType.XCAFDoc_ColorGen]
            if any(tool.GetColor(shape, kind, color) for kind in kinds):
                colors[name] = [round(255 * x) for x in color.Values(Quantity_TypeOfColor.Quantity_TOC_sRGB)]
    return names, colors


@pytest.fixture(scope="module")
def step(demo):
    return found(demo / "surface.step", STEPCAFControl_Reader())


def test_every_face_edge_and_solid_comes_back_with_its_name(step, report):
    names, _ = step
    patches = report["quality"]["patches.count"]
    assert sorted(names[TopAbs_FACE]) == sorted(f"patch {p}" for p in range(patches))
    assert sorted(names[TopAbs_EDGE]) == sorted(f"curve {c}" for c in range(report["quality"]["seam.count"]))
    # The reader gives a solid that is the whole product the name of that.
    assert names[TopAbs_SOLID] == ["scan"]


def test_every_face_comes_back_with_a_colour_of_its_own(step, report):
    _, colors = step
    assert len(colors) == report["quality"]["patches.count"]
    assert len(set(map(tuple, colors.values()))) == len(colors)
    # Soft colours: no face is black, white or grey.
    assert all(max(c) - min(c) > 20 for c in colors.values())


def test_iges_has_the_names_and_colours_of_step(demo, step, tmp_path):
    path = tmp_path / "part.igs"
    planish("export", demo / "model.planish", "-o", path)
    names, colors = found(path, IGESCAFControl_Reader())
    assert sorted(names[TopAbs_FACE]) == sorted(step[0][TopAbs_FACE])
    assert names[TopAbs_SOLID] == ["piece 1"]
    assert colors == step[1]
