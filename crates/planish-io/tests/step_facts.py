"""Facts about STEP and IGES files as OpenCASCADE reads them, one JSON object per file.

Needs the package cadquery-ocp. OpenCASCADE's own "valid" passes gaps, free edges and reversed faces, so what is
counted here is faces per edge, the direction in which they run along it, and the tolerance it had to grow to.
"""

import json
import os
import sys

from OCP import TopAbs
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.GProp import GProp_GProps
from OCP.IGESControl import IGESControl_Reader
from OCP.STEPControl import STEPControl_Reader
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS


def cast(shape, kind):
    return (getattr(TopoDS, kind + "_s", None) or getattr(TopoDS, kind))(shape)


def all_of(shape, kind):
    """Sub-shapes of a kind, with their orientation, as often as they are used."""
    explorer = TopExp_Explorer(shape, getattr(TopAbs, "TopAbs_" + kind.upper()))
    found = []
    while explorer.More():
        found.append(cast(explorer.Current(), kind))
        explorer.Next()
    return found


def distinct(shapes):
    kept = []
    for shape in shapes:
        if not any(shape.IsSame(other) for other in kept):
            kept.append(shape)
    return kept


def facts(path):
    reader = IGESControl_Reader() if path.endswith(".igs") else STEPControl_Reader()
    if int(reader.ReadFile(path)) != 1:
        return {"error": "OpenCASCADE cannot read it"}
    reader.TransferRoots()
    shape = reader.OneShape()
    faces, shells = all_of(shape, "Face"), all_of(shape, "Shell")
    uses = [edge for face in faces for edge in all_of(face, "Edge") if not BRep_Tool.Degenerated_s(edge)]
    edges = distinct(uses)
    free, same_way, crowded = 0, 0, 0
    for edge in edges:
        ways = [use.Orientation() for use in uses if use.IsSame(edge)]
        free += len(ways) == 1
        crowded += len(ways) > 2
        same_way += len(ways) == 2 and ways[0] == ways[1]
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box)
    low, high = box.CornerMin(), box.CornerMax()
    diagonal = low.Distance(high)
    tolerance = max(
        [BRep_Tool.Tolerance_s(s) for s in edges + faces + distinct(all_of(shape, "Vertex"))], default=0.0
    )
    volume = 0.0
    solids = all_of(shape, "Solid")
    for solid in solids:
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(solid, properties)
        volume += properties.Mass()
    return {
        "solids": len(solids),
        "shells": len(shells),
        "closed_shells": sum(bool(BRep_Tool.IsClosed_s(s)) for s in shells),
        "faces": len(faces),
        "edges": len(edges),
        "free_edges": free,
        "crowded_edges": crowded,
        "same_way_edges": same_way,
        "tolerance_rel": tolerance / diagonal,
        "diagonal": diagonal,
        "volume": volume,
        "valid": bool(BRepCheck_Analyzer(shape).IsValid()),
    }


if __name__ == "__main__":
    # The reader talks on standard output; the facts are to stand there alone.
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for name in sys.argv[1:]:
        print(json.dumps(facts(name)), file=out, flush=True)
