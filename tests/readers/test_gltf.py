"""GLB files as the validator of the Khronos Group judges them."""

import json
import subprocess

import pytest
from conftest import ROOT, planish

STUDIO = ROOT / "studio"
JUDGE = """
import { readFileSync } from "node:fs";
import validator from "gltf-validator";
const bytes = new Uint8Array(readFileSync(process.argv[1]));
const { issues } = await validator.validateBytes(bytes);
console.log(JSON.stringify(issues.messages.filter((m) => m.severity < 2)));
"""


def faults(path):
    """Errors and warnings of the validator."""
    done = subprocess.run(
        [ROOT / ".ci/node", "node", "--input-type=module", "-e", JUDGE, path],
        cwd=STUDIO,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module")
def written(demo, tmp_path_factory):
    """A GLB of each kind: the preview, surfaces, a mesh, a mesh with attributes."""
    folder = tmp_path_factory.mktemp("glb")
    planish("export", demo / "model.planish", "-o", folder / "surfaces.glb", "-q")
    planish("smooth", demo / "mesh.ply", "-o", folder / "mesh.glb", "-q")
    planish("compare", demo / "mesh.ply", demo / "truth.ply", "-o", folder / "distances.ply", "-q")
    planish("transform", folder / "distances.ply", "--scale", 2, "-o", folder / "attributes.glb", "-q")
    return {"preview": demo / "preview.glb"} | {f.stem: f for f in folder.iterdir()}


@pytest.mark.parametrize("name", ["preview", "surfaces", "mesh", "attributes"])
def test_the_validator_finds_no_fault(written, name):
    assert faults(written[name]) == []


def test_the_validator_finds_the_fault_of_a_damaged_file(written, tmp_path):
    damaged = tmp_path / "a.glb"
    damaged.write_bytes(written["mesh"].read_bytes().replace(b'"VEC3"', b'"VEC2"'))
    assert faults(damaged)
