"""What the reader tests share: the built program, and one small run that several tests look at."""

import json
import os
import pathlib
import subprocess

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLANISH = pathlib.Path(os.environ.get("PLANISH", ROOT / "target" / "release" / "planish"))
DATA = pathlib.Path(os.environ.get("PLANISH_DATA", ROOT.parent / "shared" / "data"))


def planish(*arguments, cwd=None, status=0):
    """Runs the program; returns the finished process after checking its exit status."""
    done = subprocess.run(
        [str(PLANISH), *map(str, arguments)], cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == status, f"{arguments}: {done.returncode}\n{done.stderr}"
    return done


def data(name):
    """A measured mesh, or a skip where the data is not there."""
    path = DATA / name
    if not path.exists():
        pytest.skip(f"skipped: {name} is not in {DATA}")
    return path


@pytest.fixture(scope="session")
def demo(tmp_path_factory):
    """Folder of a small demonstration run, in centimetres."""
    folder = tmp_path_factory.mktemp("demo")
    planish("demo", "-o", folder, "--points", 20000, "--units", "cm")
    return folder


@pytest.fixture(scope="session")
def report(demo):
    """Its report."""
    return json.loads((demo / "report.json").read_text())
