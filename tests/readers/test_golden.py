"""Figures of two small meshes in closed form, against those kept in golden/, each with its own tolerance.

After a change that is meant to move them: PLANISH_GOLDEN=write make test-readers, then read the difference.
"""

import json
import os
import pathlib

import meshes
import pytest
from conftest import planish

GOLDEN = pathlib.Path(__file__).parent / "golden"
CASES = {"box": (meshes.box, ["--patches", 6]), "ball": (meshes.ball, ["--patches", 24])}

# How far a figure may be from the kept one: (relative, absolute). Counts of the mesh are exact; what rests on the
# automatic network may move with it; distances by a fifth; rounding errors only have a ceiling.
EXACT, SHAPE, DISTANCE, ROUNDING = (0.0, 0.0), (0.3, 0.02), (0.2, 1e-9), (0.0, 1e-9)
TOLERANCES = {
    "mesh.": EXACT,
    "grid.folds": EXACT,
    "patches.": (0.4, 4),
    "seam.count": (0.4, 8),
    "seam.gap_max": ROUNDING,
    "seam.angle": (0.2, 0.02),
    "relief.rounding_max": ROUNDING,
    "relief.max": DISTANCE,
    "surface.control_points": (0.5, 0),
    "surface.": DISTANCE,
    "displaced.": DISTANCE,
    "": SHAPE,
}


def tolerance(key):
    return max(((k, t) for k, t in TOLERANCES.items() if key.startswith(k)), key=lambda kt: len(kt[0]))[1]


@pytest.mark.parametrize("name", CASES)
def test_figures_are_the_kept_ones_within_their_tolerances(tmp_path, name):
    make, options = CASES[name]
    meshes.write_ply(tmp_path / f"{name}.ply", make())
    planish("fit", f"{name}.ply", "-o", "m.planish", "--report", "report.json", *options, cwd=tmp_path)
    report = json.loads((tmp_path / "report.json").read_text())
    found = {"diagonal": report["input"]["diagonal"], "quality": report["quality"]}
    found["warnings"] = sorted(w["code"] for w in report["warnings"])
    path = GOLDEN / f"{name}.json"
    if os.environ.get("PLANISH_GOLDEN") == "write":
        path.write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
    kept = json.loads(path.read_text())
    assert found["diagonal"] == pytest.approx(kept["diagonal"], rel=1e-12)
    assert found["warnings"] == kept["warnings"]
    # Keys are only ever added.
    assert set(kept["quality"]) <= set(found["quality"])
    wrong = []
    for key, want in kept["quality"].items():
        relative, absolute = tolerance(key)
        got = found["quality"][key]
        assert isinstance(got, bool) == isinstance(want, bool), key
        room = absolute + relative * abs(want)
        if abs(got - want) > room:
            wrong.append(f"{key}: {got}, kept {want}, room {room}")
    assert not wrong, "\n".join(wrong)
