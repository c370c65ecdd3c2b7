"""Documents that wire maps: valid MaterialX with its standard nodes, and a graph that gives tangent, bitangent, normal."""

import json

import numpy as np
import pytest
from conftest import planish

mx = pytest.importorskip("MaterialX")


def exported(demo, folder, *options):
    planish("relief", "export", demo / "model.planish", "-o", folder, "--materialx", *options)
    document = mx.createDocument()
    library = mx.createDocument()
    mx.loadLibraries(mx.getDefaultDataLibraryFolders(), mx.getDefaultDataSearchPath(), library)
    document.setDataLibrary(library)
    mx.readFromXmlFile(document, str(folder / "relief.mtlx"))
    valid, message = document.validate()
    assert valid, message
    return document, json.loads((folder / "relief.json").read_text())


def value(node, pixel, output="out"):
    """What a node of a graph gives where the image has this pixel."""

    def of(name):
        given = node.getInput(name)
        if not given.getNodeName():
            found = given.getValue()
            return np.array(list(found)) if hasattr(found, "__len__") else np.full(len(pixel), found)
        return value(node.getParent().getNode(given.getNodeName()), pixel, given.getOutputString() or "out")

    match node.getCategory():
        case "image":
            return np.asarray(pixel, float)
        case "subtract":
            return of("in1") - of("in2")
        case "multiply":
            return of("in1") * of("in2")
        case "separate3":
            return np.full(len(pixel), of("in")["outx outy outz".split().index(output)])
        case "combine3":
            return np.array([of(f"in{k}")[0] for k in (1, 2, 3)])
    raise AssertionError(node.getCategory())


#: Where tangent, bitangent and normal stand in the channels, and their signs.
ORDERS = {"tbn": ([0, 1, 2], [1, 1, 1]), "tnb": ([0, 2, 1], [1, 1, 1]), "tbn-down": ([0, 1, 2], [1, -1, 1])}


@pytest.mark.parametrize(
    "options", [["--frame", "tangent"], ["--preset", "arnold"], ["--preset", "blender"], ["--preset", "mudbox"], ["--kind", "height"]]
)
def test_the_graph_of_every_order_gives_the_displacement_in_tangent_space(demo, tmp_path, options):
    document, sidecar = exported(demo, tmp_path / "maps", *options)
    shaders = document.getNodes("displacement")
    assert shaders and len(document.getMaterialNodes()) == len(shaders)
    scale = shaders[0].getInputValue("scale")
    assert scale == pytest.approx(sidecar["scale"])
    graph = document.getNodeGraph(shaders[0].getInput("displacement").getNodeGraphString())
    last = graph.getNode(graph.getOutputs()[0].getNodeName())
    if sidecar["params"]["kind"] != "vector":
        assert value(last, [0.75]) == pytest.approx(0.75 - sidecar["mid_level"])
        return
    places, signs = ORDERS[sidecar["params"]["order"].replace("_", "-")]
    wanted = np.array([0.2, -0.3, 0.5])
    pixel = np.zeros(3)
    pixel[places] = wanted * signs
    assert scale * value(last, pixel + sidecar["mid_level"]) == pytest.approx(scale * wanted)


def test_normals_are_wired_to_a_surface_and_vectors_of_an_object_are_refused(demo, tmp_path):
    document, _ = exported(demo, tmp_path / "normals", "--kind", "normal", "--frame", "tangent")
    assert document.getNodes("standard_surface")
    refused = planish("relief", "export", demo / "model.planish", "-o", tmp_path / "object", "--materialx", "--frame", "object", status=2)
    assert "tangent" in refused.stderr
