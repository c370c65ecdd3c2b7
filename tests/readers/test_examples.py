"""Every file of examples/ does what its head says, on small inputs. The head with its script is in test_edit.py, the Python examples
are in crates/planish-py/tests."""

import os
import subprocess

import pytest
from conftest import PLANISH, ROOT, planish
from meshes import cube, write_ply

EXAMPLES = ROOT / "examples"
ELSEWHERE = {"edit/head.py", "edit/head.toml"}
PYTHON = "python/"
# Options that make an example small.
SMALL = {"letters.toml": ["--resolution", 48], "pocket.toml": ["--resolution", 48], "edit/box.toml": []}


def command(name):
    """The command in the head of a script, as words after `planish`."""
    head = [line for line in (EXAMPLES / name).read_text().splitlines() if line.startswith("#")]
    (line,) = [line for line in head if "planish " in line]
    return line[line.index("planish ") :].split()[1:]


def test_no_example_is_left_out():
    found = {p.relative_to(EXAMPLES).as_posix() for p in EXAMPLES.rglob("*") if p.is_file() and "__pycache__" not in p.parts}
    found = {name for name in found if not name.startswith(PYTHON)}
    assert found == ELSEWHERE | set(SMALL) | {"step_by_step.sh"}


@pytest.mark.parametrize("name", SMALL)
def test_a_script_runs_as_its_head_says(tmp_path, name):
    write_ply(tmp_path / "box.ply", cube(6, lambda x, y, z: ((1 + x) / 2, (1 + y) / 2, (1 + z) / 2)))
    words = [str(ROOT / w) if w.startswith("examples/") else w for w in command(name)]
    assert str(EXAMPLES / name) in words
    told = planish(*words, *SMALL[name], cwd=tmp_path)
    product = tmp_path / words[words.index("-o") + 1]
    assert product.stat().st_size > 1000
    if name == "edit/box.toml":
        assert "10 patches, finished" in told.stdout and len(list((tmp_path / "out" / "box").iterdir())) == 3
    else:
        assert "watertight, manifold" in told.stdout, told.stdout


def test_the_whole_way_step_by_step(tmp_path):
    script = EXAMPLES / "step_by_step.sh"
    done = subprocess.run(
        ["bash", script, tmp_path / "out", "6000"],
        env=os.environ | {"PLANISH": str(PLANISH)}, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    made = {p.name for p in (tmp_path / "out").iterdir()}
    assert made >= {"network.json", "part.planish", "part.step", "maps", "report.html"}
    assert (tmp_path / "out" / "maps" / "relief.json").exists()
