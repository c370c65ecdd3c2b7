"""The examples run, on small input, and do what they say."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import planish

EXAMPLES = Path(__file__).parents[3] / "examples" / "python"


def load(name: str) -> dict[str, Any]:
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))


def test_a_scan_to_step(tmp_path: Path) -> None:
    model = load("scan_to_step")["main"](output=str(tmp_path / "part.step"), points=6_000)
    assert (tmp_path / "part.step").stat().st_size > 100_000
    assert model.quality["surface.rms_rel"] < 1e-3


def test_an_own_implicit_function_to_a_sharp_mesh(tmp_path: Path) -> None:
    mesh = load("implicit_to_mesh")["main"](output=str(tmp_path / "gyroid.ply"), resolution=40)
    facts = mesh.diagnose()
    assert facts["watertight"] and len(mesh.feature_edges) > 1_000 and (tmp_path / "gyroid.ply").exists()
    assert np.abs(mesh.points).max() < 1.0 + 1e-3


def test_a_batch_with_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = load("batch_table")["main"](folder=str(tmp_path), parts=2)
    assert [row.status for row in table] == ["done", "done"] and "box-01.stl" in capsys.readouterr().out


def test_a_curve_drawn_by_code(capsys: pytest.CaptureFixture[str]) -> None:
    curve = load("draw_curve")["main"](triangles=6_000)
    assert curve.closed and len(curve) == 120
    assert capsys.readouterr().out.count("<planish.Curve") == 5


def test_an_own_patch_layout(tmp_path: Path) -> None:
    model = load("own_layout")["main"](output=str(tmp_path / "ball.step"), level=4)
    assert len(model.network.patches) == 6 and model.quality["seam.angle_max_deg"] < 0.5


def test_relief_moved_to_another_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = load("move_relief")["main"](output=str(tmp_path / "moved.planish"))
    told = capsys.readouterr().out
    before, after = (float(line.split()[1]) for line in told.splitlines()[:2])
    assert model.facts["missed"] == 0 and after < 0.3 * before
    assert len(planish.Model.read(tmp_path / "moved.planish").reliefs) == len(model.reliefs)


def test_the_blocks_of_the_tutorial_run_one_after_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    page = (EXAMPLES.parents[1] / "docs" / "tutorials" / "researcher.md").read_text()
    blocks = [part.split("```")[0] for part in page.split("```python\n")[1:]]
    assert len(blocks) == 5
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block, names)
    assert names["model"].quality["surface.rms_rel"] < 2e-3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["gyroid.nrrd", "softer.planish"]


def test_a_notebook_runs_and_shows_pictures_and_a_bar(tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(EXAMPLES / "tour.ipynb", as_version=4)
    nbclient.NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    shown = [output.get("data", {}) for cell in notebook.cells for output in cell.get("outputs", [])]
    assert sum("<img" in data.get("text/html", "") for data in shown) == 3
