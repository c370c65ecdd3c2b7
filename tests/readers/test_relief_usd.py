"""Maps that USD wires: the stage is valid, and mesh and texture give the displaced shape."""

import json

import numpy as np
import pytest
from conftest import planish

Usd = pytest.importorskip("pxr.Usd")
OpenEXR = pytest.importorskip("OpenEXR")
from pxr import UsdGeom, UsdShade, UsdValidation  # noqa: E402


def exported(demo, folder, *options):
    planish("relief", "export", demo / "model.planish", "-o", folder, "--usd", *options)
    return Usd.Stage.Open(str(folder / "relief.usda"))


def errors_of(stage):
    registry = UsdValidation.ValidationRegistry()
    errors = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators()).Validate(stage)
    return [e.GetErrorAsString() for e in errors]


def mesh_of(stage):
    return UsdGeom.Mesh(next(p for p in stage.Traverse() if p.IsA(UsdGeom.Mesh)))


def source(shader, name):
    """The shader that an input is connected to."""
    return UsdShade.Shader(shader.GetInput(name).GetConnectedSources()[0][0].source.GetPrim())


def texture_of(material, output, name):
    """The texture node that feeds an input of the preview surface, which the output of the material comes from."""
    preview = UsdShade.Shader(material.GetOutput(output).GetConnectedSources()[0][0].source.GetPrim())
    assert preview.GetIdAttr().Get() == "UsdPreviewSurface"
    texture = source(preview, name)
    assert texture.GetIdAttr().Get() == "UsdUVTexture"
    assert texture.GetInput("sourceColorSpace").Get() == "raw"
    reader = source(texture, "st")
    assert reader.GetIdAttr().Get() == "UsdPrimvarReader_float2" and reader.GetInput("varname").Get() == "st"
    return texture


def image(path):
    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        name = next(c for c in ("R", "Y", "V") if c in channels)
        return np.asarray(channels[name].pixels, float)


def test_heights_of_udim_tiles_are_wired_and_read_at_st_as_the_sidecar_has_them(demo, tmp_path):
    folder = tmp_path / "udim"
    stage = exported(demo, folder, "--preset", "usd", "--tile", "512")
    assert errors_of(stage) == []
    mesh = mesh_of(stage)
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    texture = texture_of(material, "displacement", "displacement")
    assert texture.GetInput("file").Get().path == "./relief.<UDIM>.exr"
    assert texture.GetInput("scale").Get() == (1, 1, 1, 1) and texture.GetInput("bias").Get() == (0, 0, 0, 0)
    # Every corner hits a texel centre of the tile that UDIM names, within a patch of the sidecar.
    sidecar = json.loads((folder / "relief.json").read_text())
    st = np.asarray(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").ComputeFlattened(), float)
    tiles = np.floor(st).astype(int)
    largest = 0.0
    for tile in np.unique(tiles, axis=0):
        heights = image(folder / f"relief.{1001 + tile[0] + 10 * tile[1]}.exr")
        at = (st[(tiles == tile).all(1)] - tile) * 512 - 0.5
        assert np.abs(at - np.rint(at)).max() < 1e-2
        i, j = np.rint(at).astype(int).T
        largest = max(largest, np.abs(heights[511 - j, i]).max())
    assert largest == pytest.approx(sidecar["largest"], rel=1e-6)


@pytest.mark.parametrize("options, scale, bias", [
    (("--kind", "normal", "--frame", "tangent", "--file", "png"), 2, -1),
    (("--kind", "normal", "--frame", "tangent"), 1, 0),
])
def test_normals_are_wired_patch_by_patch_with_scale_and_bias(demo, tmp_path, options, scale, bias):
    stage = exported(demo, tmp_path / "normals", *options)
    assert errors_of(stage) == []
    for p, subset in enumerate(UsdGeom.Subset.GetAllGeomSubsets(mesh_of(stage))):
        material, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
        texture = texture_of(material, "surface", "normal")
        assert texture.GetInput("file").Get().path.startswith(f"./patch_{p:04}.")
        assert texture.GetInput("scale").Get() == (scale, scale, scale, 1)
        assert texture.GetInput("bias").Get() == (bias, bias, bias, 0)


def test_scale_and_bias_of_whole_numbers_undo_the_mid_level(demo, tmp_path):
    stage = exported(demo, tmp_path / "png", "--kind", "scalar", "--file", "png", "--sheets", "atlas")
    assert errors_of(stage) == []
    material, _ = UsdShade.MaterialBindingAPI(mesh_of(stage)).ComputeBoundMaterial()
    texture = texture_of(material, "displacement", "displacement")
    sidecar = json.loads((tmp_path / "png" / "relief.json").read_text())
    scale, bias = texture.GetInput("scale").Get()[0], texture.GetInput("bias").Get()[0]
    assert scale == pytest.approx(sidecar["scale"], rel=1e-6)
    assert scale * sidecar["mid_level"] + bias == pytest.approx(0, abs=1e-6 * scale)


def test_vectors_are_wired_by_nodes_of_materialx(demo, tmp_path):
    stage = exported(demo, tmp_path / "vectors", "--frame", "tangent", "--sheets", "atlas")
    material, _ = UsdShade.MaterialBindingAPI(mesh_of(stage)).ComputeBoundMaterial()
    node = UsdShade.Shader(material.GetOutput("mtlx:displacement").GetConnectedSources()[0][0].source.GetPrim())
    assert node.GetIdAttr().Get() == "ND_displacement_vector3"
    signed = source(node, "displacement")
    read = source(signed, "in1")
    assert [s.GetIdAttr().Get() for s in (signed, read)] == ["ND_subtract_vector3FA", "ND_image_vector3"]
    assert read.GetInput("file").Get().path == "./atlas.exr"
    assert source(read, "texcoord").GetInput("geomprop").Get() == "st"
