"""A session of edits on a head, replayed from its script: examples/edit/head.py and head.toml."""

import json
import subprocess
import sys

import pytest
from conftest import ROOT, planish

EXAMPLE = ROOT / "examples" / "edit"
BACK = '\n[[step]]\nedit = "undo"\ncount = 7\n\n[[step]]\nedit = "redo"\ncount = 7\n'


@pytest.fixture(scope="module")
def head(tmp_path_factory):
    """Folder with the mesh of the head and the model that the script makes of it, with pictures and report."""
    folder = tmp_path_factory.mktemp("head")
    subprocess.run([sys.executable, EXAMPLE / "head.py", folder / "head.nrrd"], check=True, timeout=120)
    planish("mesh", "head.nrrd", "--plain", "-o", "head.ply", cwd=folder)
    arguments = ["-o", "head.planish", "--pictures", "seen", "--report", "head.json", "--threads", 2]
    planish("edit", "head.ply", EXAMPLE / "head.toml", *arguments, cwd=folder)
    return folder


def test_every_region_is_a_four_sided_patch_and_no_cell_is_folded(head):
    report = json.loads((head / "head.json").read_text())
    quality = report["quality"]
    assert quality["grid.folds"] == 0
    # Both sides have the same patches.
    assert quality["patches.count"] >= 40 and quality["patches.count"] % 2 == 0
    assert not [w for w in report["warnings"] if w["code"] == "network_unfinished"]
    assert quality["relief.rounding_max_rel"] < 1e-12


def test_a_picture_is_made_after_every_edit(head):
    script = (EXAMPLE / "head.toml").read_text()
    pictures = sorted(p.name for p in (head / "seen").iterdir())
    assert len(pictures) == script.count("[[step]]")
    assert pictures[0] == "01-symmetry.png" and pictures[-1].endswith("-relax.png")
    assert all((head / "seen" / p).read_bytes().startswith(b"\x89PNG") for p in pictures)


def test_edits_taken_back_and_made_again_give_the_same_bytes_on_one_thread(head):
    script = head / "back.toml"
    script.write_text((EXAMPLE / "head.toml").read_text() + BACK)
    planish("edit", "head.ply", script, "-o", "back.planish", "--threads", 1, cwd=head)
    assert (head / "back.planish").read_bytes() == (head / "head.planish").read_bytes()


def test_all_edits_taken_back_leave_the_bare_mesh_and_made_again_the_same_drawing(head):
    count = (EXAMPLE / "head.toml").read_text().count("[[step]]")
    (head / "all.toml").write_text(f'[[step]]\nedit = "undo"\ncount = {count}\n')
    told = planish("edit", "head.planish", "all.toml", "-o", "bare.planish", cwd=head).stdout
    assert "0 corners, 0 curves, 0 patches" in told and f"0 to take back, {count} to make again" in told
    (head / "again.toml").write_text(f'[[step]]\nedit = "redo"\ncount = {count}\n')
    planish("edit", "bare.planish", "again.toml", "-o", "again.planish", cwd=head)
    assert (head / "again.planish").read_bytes() == (head / "head.planish").read_bytes()
