"""The steps one by one: each takes up where the file of the one before leaves off."""

import json
import pathlib
import shutil
import sys

import pytest
from conftest import ROOT, data, planish


def fit(folder, *arguments, status=0):
    planish("fit", *arguments, "--report", "report.json", cwd=folder, status=status)
    return json.loads((folder / "report.json").read_text())


def same_surfaces(a, b):
    # Maps are read back only where they are written.
    skip = {"mesh.feature_edges", "relief.roundtrip_max", "relief.roundtrip_max_rel"}
    # A model knows neither the scan that it comes from nor how its network was laid.
    def fitted(one):
        return sorted(k for k in set(one["quality"]) - skip if not k.startswith(("scan.", "truth.", "layout.")))

    keys = fitted(a)
    assert keys == fitted(b)
    for key in keys:
        assert b["quality"][key] == pytest.approx(a["quality"][key], rel=1e-6, abs=1e-9), key


def test_a_network_that_goes_through_its_file_gives_the_same_surfaces(demo, tmp_path):
    shutil.copy(demo / "mesh.ply", tmp_path / "part.ply")
    planish("layout", "part.ply", "-o", "network.json", "--patches", 60, cwd=tmp_path)
    straight = fit(tmp_path, "part.ply", "-o", "a.planish", "--patches", 60)
    by_file = fit(tmp_path, "part.ply", "--network", "network.json", "-o", "b.planish")
    assert "layout" in [s["name"] for s in straight["stages"]]
    assert "layout" not in [s["name"] for s in by_file["stages"]]
    same_surfaces(straight, by_file)
    # And again: what is written anew is the same text.
    network = json.loads((tmp_path / "network.json").read_text())
    assert len(network["patches"]) == by_file["quality"]["patches.count"]


def test_a_project_alone_is_exported_to_the_same_step_file(demo, tmp_path):
    pytest.importorskip("OCP")
    sys.path.insert(0, str(ROOT / "crates" / "planish-io" / "tests"))
    from step_facts import facts

    shutil.copy(demo / "model.planish", tmp_path / "scan.planish")
    planish("export", "scan.planish", "-o", "scan.step", cwd=tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["scan.planish", "scan.step"]

    def records(path: pathlib.Path):
        return [line for line in path.read_text().splitlines() if line.startswith("#")]

    assert records(tmp_path / "scan.step") == records(demo / "surface.step")
    found = facts(str(tmp_path / "scan.step"))
    assert (found["solids"], found["free_edges"], found["same_way_edges"], found["valid"]) == (1, 0, 0, True)


def test_a_project_alone_is_fitted_anew_with_the_control_points_asked_for(demo, report, tmp_path):
    shutil.copy(demo / "model.planish", tmp_path / "m.planish")
    coarse = fit(tmp_path, "m.planish", "--control", "6x6", "-o", "coarse.planish")
    fine = fit(tmp_path, "m.planish", "--control", "12,12", "-o", "fine.planish")
    patches = report["quality"]["patches.count"]
    assert coarse["quality"]["surface.control_points"] == 36 * patches
    assert fine["quality"]["surface.control_points"] == 144 * patches
    assert fine["quality"]["surface.rms"] < coarse["quality"]["surface.rms"]
    for one in (coarse, fine):
        names = [s["name"] for s in one["stages"]]
        assert "layout" not in names and "grids" not in names and "surfaces" in names
        assert one["input"]["units"] == "cm" and one["quality"]["grid.points"] == report["quality"]["grid.points"]
        assert one["quality"]["relief.rounding_max_rel"] < 1e-9
    # A fit anew is little against the run that made the network and its grids, on this same machine.
    def seconds(one, *names):
        return sum(s["seconds"] for s in one["stages"] if s["name"] in names)

    assert seconds(fine, "surfaces", "seams", "relief") < seconds(report, "layout", "grids") / 5
    # Without options: with the parameters it was made with, so nothing changes.
    again = fit(tmp_path, "m.planish", "-o", "again.planish")
    same_surfaces(report, again)
    # Onto itself, and with its history.
    fit(tmp_path, "fine.planish", "--control", "6,6", "-o", "fine.planish", "--in-place")
    assert "fit, refit, refit" in planish("info", "fine.planish", cwd=tmp_path).stdout
    assert (tmp_path / "m.planish").read_bytes() == (demo / "model.planish").read_bytes()


@pytest.mark.parametrize("option", [["--patches", "9"], ["--density", "2"], ["--network", "n.json"]])
def test_options_of_stages_that_do_not_run_again_are_wrong_usage(demo, tmp_path, option):
    done = planish("fit", demo / "model.planish", *option, "-o", "m.planish", cwd=tmp_path, status=2)
    lines = done.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith(f"error: {option[0]}: ") and " - hint: " in lines[0]
    assert not list(tmp_path.iterdir())


def test_a_demanded_tolerance_that_a_refit_misses_is_status_1_and_the_model_is_there(demo, tmp_path):
    model = tmp_path / "m.planish"
    found = fit(tmp_path, demo / "model.planish", "--tolerance", "5%", "-o", model)
    assert found["quality"]["surface.patch_rms_max_rel"] <= 0.05
    missed = fit(tmp_path, demo / "model.planish", "--tolerance", "1e-12", "-o", model, status=1)
    assert missed["quality"]["surface.patch_rms_max_rel"] > 1e-12 and model.exists()


@pytest.mark.parametrize("name", ["fandisk.ply"])
def test_measured_meshes_go_all_the_way_and_open_as_one_shell_or_solid(tmp_path, name):
    pytest.importorskip("OCP")
    sys.path.insert(0, str(ROOT / "crates" / "planish-io" / "tests"))
    from step_facts import facts

    planish("run", data(name), "-o", tmp_path / "out")
    quality = json.loads((tmp_path / "out" / "report.json").read_text())["quality"]
    found = facts(str(tmp_path / "out" / "surface.step"))
    assert found["faces"] == quality["patches.count"]
    assert found["solids"] == (1 if quality["mesh.watertight"] else 0)
    assert found["crowded_edges"] == found["same_way_edges"] == 0
    assert found["tolerance_rel"] < 1e-5
    assert quality["displaced.rms_rel"] < 0.002
