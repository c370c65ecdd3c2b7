"""Whole runs in processes of their own, one and many."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import planish

#: Options of quick runs.
QUICK = {"patches": 6, "threads": 1}


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two boxes, with a file between them that is no mesh."""
    folder = tmp_path_factory.mktemp("parts")
    for k in (1, 2):
        planish.cuboid((3.0 + k, 3.0, 2.0), cells=3).write(folder / f"box-{k}.stl")
    (folder / "broken.ply").write_text("this is no mesh")
    return [folder / "box-1.stl", folder / "broken.ply", folder / "box-2.stl"]


@pytest.fixture(scope="module")
def batch(parts: list[Path], tmp_path_factory: pytest.TempPathFactory) -> planish.Batch:
    """A batch of them."""
    return planish.run_many(parts, tmp_path_factory.mktemp("out"), jobs=2, **QUICK)


def test_one_that_fails_does_not_stop_the_others(batch: planish.Batch) -> None:
    assert [row.status for row in batch] == ["done", "failed", "done"]
    assert [row.source.name for row in batch.failed] == ["broken.ply"]
    assert batch[1].error is not None and "broken.ply" in batch[1].error and "\n" not in batch[1].error
    assert batch[0].quality["patches.count"] == 6


def test_the_table_has_a_line_for_each(batch: planish.Batch) -> None:
    lines = str(batch).splitlines()
    assert len(lines) == 4 and lines[0].startswith("part") and "failed" in lines[2]
    assert batch._repr_html_().count("<tr>") == 4


def test_a_second_run_skips_what_is_finished_and_only_that(batch: planish.Batch, parts: list[Path]) -> None:
    folder = batch[0].folder.parent
    told: list[planish.Row] = []
    start = time.monotonic()
    again = planish.run_many(parts, folder, jobs=2, progress=told.append, **QUICK)
    assert [row.status for row in again] == ["skipped", "failed", "skipped"] and len(told) == 3
    assert time.monotonic() - start < 5.0
    assert again[0].quality == batch[0].quality
    manifest = json.loads((folder / "manifest.json").read_text())
    assert set(manifest["runs"]) == {"box-1", "box-2"}


def test_other_content_other_options_and_lost_products_are_run_again(batch: planish.Batch, parts: list[Path]) -> None:
    folder = batch[0].folder.parent
    planish.cuboid((9.0, 3.0, 2.0), cells=3).write(parts[0])
    (folder / "box-2" / "surface.step").unlink()
    again = planish.run_many([parts[0], parts[2]], folder, jobs=2, **QUICK)
    assert [row.status for row in again] == ["done", "done"]
    again = planish.run_many([parts[0]], folder, patches=7, threads=1)
    assert [row.status for row in again] == ["done"]
    again = planish.run_many([parts[0]], folder, patches=7, threads=2, seed=None)
    assert [row.status for row in again] == ["skipped"]


def test_a_run_of_an_object_leaves_products_that_are_read_back(box: planish.Mesh, tmp_path: Path) -> None:
    made = planish.run(box, tmp_path / "out", tolerance=1e-3, **QUICK)
    assert made.quality["patches.count"] == 6 and not made.missed and made.warnings == made.report["warnings"]
    assert len(made.model().surfaces) == 6 and len(made.mesh().triangles) == len(box.triangles)


def test_failures_have_the_programs_words_and_status(tmp_path: Path, parts: list[Path]) -> None:
    with pytest.raises(planish.RunError) as raised:
        planish.run(parts[1], tmp_path / "out")
    assert raised.value.status == 3 and "broken.ply" in str(raised.value)
    with pytest.raises(planish.RunError, match="no-such-option") as raised:
        planish.run(parts[0], tmp_path / "out", no_such_option=3)
    assert raised.value.status == 2
    with pytest.raises(ValueError, match="jobs=0"):
        planish.run_many([], tmp_path, jobs=0)


def test_the_command_line_and_python_skip_what_the_other_has_finished(parts: list[Path], tmp_path: Path) -> None:
    table = planish.run_many([str(parts[2].parent / "box-*.stl")], tmp_path / "out", patches=6)
    assert [row.source.name for row in table] == ["box-1.stl", "box-2.stl"]
    command = ["run", *map(str, (parts[0], parts[2])), "-o", "out", "--patches", "6", "--json", "--jobs", "2"]
    told = subprocess.run([sys.executable, "-m", "planish", *command], cwd=tmp_path, capture_output=True, text=True)
    assert told.returncode == 0, told.stderr
    rows = [json.loads(line) for line in told.stdout.splitlines()]
    assert [row["status"] for row in rows] == ["skipped", "skipped"]
    assert (tmp_path / "out" / "batch.html").read_text().count("<tr>") == 3


def test_no_files_are_an_empty_table(tmp_path: Path) -> None:
    assert planish.run_many([], tmp_path / "out") == []


def test_a_batch_that_is_killed_takes_its_runs_along(tmp_path: Path) -> None:
    planish.demo_part(triangles=40_000).write(tmp_path / "part.ply")
    code = "import sys, planish; planish.run_many([sys.argv[1] + '/part.ply'], sys.argv[1] + '/out')"
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stderr=subprocess.DEVNULL)

    def runs() -> list[str]:
        told = subprocess.run(["ps", "-eww", "-o", "args"], capture_output=True, text=True).stdout.splitlines()
        return [line for line in told if str(tmp_path) in line and "planish run" in line]

    end = time.monotonic() + 10.0
    while len(runs()) < 2 and time.monotonic() < end:
        time.sleep(0.1)
    assert len(runs()) == 2
    process.kill()
    process.wait()
    end = time.monotonic() + 5.0
    while runs() and time.monotonic() < end:
        time.sleep(0.1)
    assert runs() == [] and not (tmp_path / "out" / "part" / "report.json").exists()


def test_ctrl_c_stops_a_batch_and_its_processes(tmp_path: Path) -> None:
    for k in range(3):
        planish.demo_part(seed=k, triangles=20_000).write(tmp_path / f"part-{k}.ply")
    code = (
        "import sys, planish; from pathlib import Path\n"
        "folder = Path(sys.argv[1])\n"
        "planish.run_many(sorted(folder.glob('*.ply')), folder / 'out', jobs=2)"
    )
    process = subprocess.Popen([sys.executable, "-c", code, str(tmp_path)], stderr=subprocess.PIPE, text=True, start_new_session=True)
    time.sleep(2.0)
    os.kill(process.pid, signal.SIGINT)
    _, told = process.communicate(timeout=15)
    assert "KeyboardInterrupt" in told and process.returncode != 0
    assert not list((tmp_path / "out").glob("*/model.planish"))
