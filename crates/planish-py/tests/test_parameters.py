"""Keywords are the parameters of the stages: the stub's, the schema's and the command line's are the same."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import planish

STUB = ast.parse((Path(planish.__file__).parent / "_planish.pyi").read_text())
#: The stages that each group of the stub stands for.
GROUPS = {f"_{stage.capitalize()}": [stage] for stage in planish.keywords()} | {
    "_Remesh": ["scan", "contour"],
    "_VolumeMesh": ["volume", "contour"],
    "_CloudMesh": ["scan", "clean", "contour"],
    "_Project": ["clean", "points"],
    "_Pipeline": ["mend", "layout", "grid", "fit", "stitch"],
    "_CloudFit": ["points", "scan", "clean", "contour", "mend", "layout", "grid", "fit", "stitch"],
}
CLASSES = {node.name: node for node in STUB.body if isinstance(node, ast.ClassDef)}


def stub_keywords(group: str) -> set[str]:
    """Keywords of a group of the stub, with those of the groups that it is made of."""
    node = CLASSES[group]
    own = {item.target.id for item in node.body if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)}
    bases = (base.id for base in node.bases if isinstance(base, ast.Name) and base.id != "TypedDict")
    return own.union(*map(stub_keywords, bases))


@pytest.mark.parametrize("group", GROUPS)
def test_the_stub_has_the_keywords_of_the_stages(group: str) -> None:
    keywords = planish.keywords()
    assert stub_keywords(group) == {word for stage in GROUPS[group] for word in keywords[stage]}


@pytest.mark.parametrize("stage", planish.keywords())
def test_every_field_of_the_schema_is_a_keyword_or_several(stage: str) -> None:
    words = set(planish.keywords()[stage])
    schema = planish.schema(stage)
    nested = {"clean", "contour", "points"}
    for name, field in schema["properties"].items():
        if field.get("by_hand") or (stage == "scan" and name in nested):
            continue
        made = {name, f"{stage}_{name}"} | variants(field, schema)
        assert made & words, f"{stage}.{name} is no keyword"
        words -= made
    assert words == set(), "keywords that the schema does not know"


def variants(field: dict[str, Any], schema: dict[str, Any]) -> set[str]:
    """Names of the variants of a field that is one of several things."""
    for one in [field, *field.get("anyOf", [])]:
        if "$ref" in one:
            found = schema["$defs"][one["$ref"].rsplit("/", 1)[1]]
            return {name for v in found.get("oneOf", []) for name in v.get("properties", {})}
    return set()


#: Stages whose parameters are options of a command.
COMMANDS = {
    "clean": ["clean", "points"],
    "mesh": ["scan", "contour", "volume"],
    "smooth": ["smooth"],
    "decimate": ["decimate"],
    "layout": ["layout"],
    "fit": ["mend", "layout", "grid", "fit", "stitch"],
    "demo": ["scanner"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_every_keyword_is_an_option_of_the_command_line(command: str) -> None:
    shown = subprocess.run([sys.executable, "-m", "planish", command, "--help"], capture_output=True, text=True, check=True)
    options = set(shown.stdout.replace("[", " ").replace("=", " ").split())
    for stage in COMMANDS[command]:
        for word in planish.keywords()[stage]:
            # The seed is an option of all commands; a scan's cells are told by two words of their own.
            assert f"--{word.replace('_', '-')}" in options, f"{command} --{word}"


def test_unknown_keywords_are_refused_with_those_that_there_are(box: planish.Mesh) -> None:
    with pytest.raises(TypeError, match=r"Mesh.layout\(\) got an unexpected keyword argument 'patchs'; it takes .*patches"):
        box.layout(patchs=3)  # type: ignore[call-arg]


@pytest.mark.parametrize(
    ("keywords", "error", "message"),
    [
        ({"patches": -1}, ValueError, "patches=-1: a whole number from 0 to 100000 is needed"),
        ({"patches": 2.5}, TypeError, "patches=2.5: a whole number is needed"),
        ({"patches": True}, TypeError, "patches=true: a whole number is needed"),
        ({"patches": "6"}, TypeError, "patches='6': a whole number is needed"),
        ({"sharp_angle_deg": 500}, ValueError, "sharp_angle_deg=500: a number from 1 to 180 is needed"),
        ({"sharp_angle_deg": float("nan")}, ValueError, "sharp_angle_deg: NaN is not a finite number"),
        ({"tolerance": 1e-3, "control": [4, 4]}, TypeError, "takes .* not both"),
        ({"control": [4, 4, 4]}, ValueError, "parameters of fit"),
        ({"control": 4}, TypeError, "control=4: a list of whole numbers is needed"),
        ({"patches": object()}, TypeError, "patches: object is no number"),
    ],
)
def test_values_of_another_type_or_out_of_range_are_refused(
    box: planish.Mesh, keywords: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        box.fit(**keywords)


def test_words_are_checked_and_numpy_scalars_are_numbers(box: planish.Mesh) -> None:
    import numpy as np

    curve = box.geodesic([2, 1, 1], [-2, 1, 1])
    with pytest.raises(ValueError, match="sweep='fast': one of single, coarse_to_fine, solve is needed"):
        curve.relax(sweep="fast")  # type: ignore[typeddict-item]
    assert len(curve.relax(sweeps=np.int64(3), fairness=np.float32(1.0)).points) == len(curve)  # type: ignore[typeddict-item]
    assert np.array_equal(box.decimate(ratio=None).points, box.decimate().points)


def test_units_are_checked(box: planish.Mesh) -> None:
    with pytest.raises(ValueError, match='unknown unit "ft" - hint: use mm, cm, m or in'):
        box.model(units="ft")  # type: ignore[arg-type]
