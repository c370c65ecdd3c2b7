"""The project file, the reports and the exit statuses as other programs see them."""

import html.parser
import json
import sqlite3

import pytest
from conftest import data, planish

KEYS = """mesh.triangles mesh.watertight mesh.manifold mesh.feature_edges patches.count grid.folds grid.spacing_cv
surface.rms surface.max surface.p95 surface.rms_rel surface.max_rel surface.p95_rel surface.control_points
displaced.rms displaced.max displaced.p95 displaced.rms_rel seam.gap_max seam.gap_max_rel seam.angle_max_deg
relief.roundtrip_max relief.roundtrip_max_rel""".split()


def test_the_project_is_a_sqlite_database_with_an_application_id_and_no_fault(demo):
    connection = sqlite3.connect(f"file:{demo / 'model.planish'}?mode=ro", uri=True)
    (application,) = connection.execute("pragma application_id").fetchone()
    assert application != 0
    assert connection.execute("pragma integrity_check").fetchone() == ("ok",)
    assert connection.execute("select count(*) from sqlite_master").fetchone()[0] > 0


def test_the_report_has_all_keys_and_relative_figures_are_fractions_of_the_diagonal(report):
    assert set(report) >= {"planish", "command", "input", "stages", "quality", "warnings"}
    assert report["input"]["units"] == "cm"
    quality = report["quality"]
    assert not [key for key in KEYS if key not in quality]
    assert all(isinstance(value, (bool, int, float)) for value in quality.values())
    for key in ["surface.rms", "surface.max", "displaced.p95", "relief.roundtrip_max"]:
        assert quality[key + "_rel"] * report["input"]["diagonal"] == pytest.approx(quality[key], rel=1e-9)
    for stage in report["stages"]:
        assert stage["seconds"] >= 0 and stage["peak_bytes"] > 0 and isinstance(stage["counts"], dict)
    assert [s["name"] for s in report["stages"]][:11] == [
        "shape", "scan", "mesh", "points", "repair", "layout", "imprint", "grids", "surfaces", "seams", "relief"
    ]


def test_the_demonstration_is_near_its_truth_and_finds_its_sharp_edges(report):
    quality = report["quality"]
    # A third of the points of the real one: half a noise level away on the average.
    assert quality["truth.mesh_rms_rel"] < 0.0003 and quality["truth.displaced_rms_rel"] < 0.0003
    assert quality["scan.noise_rel"] == pytest.approx(quality["truth.noise_rel"], rel=0.3)
    assert quality["truth.outliers"] * 0.6 < quality["scan.outliers"] < quality["truth.outliers"] * 3
    assert quality["truth.sharp_found"] > 0.89 and quality["truth.sharp_met"] > 0.69
    assert quality["scan.confidence"] > 0.999 and quality["truth.mesh_topology"] is True


def test_displacement_brings_the_surface_nearer_to_the_input(report):
    assert report["quality"]["displaced.rms"] < report["quality"]["surface.rms"]
    assert report["quality"]["relief.roundtrip_max_rel"] < 1e-9


def test_the_page_is_well_formed_has_its_pictures_and_asks_for_nothing_from_outside(demo):
    page = (demo / "report.html").read_text()
    open_tags, outside, pictures = [], [], []

    class Parser(html.parser.HTMLParser):
        def handle_starttag(self, tag, attributes):
            if tag not in {"meta", "img", "br"}:
                open_tags.append(tag)
            for name, value in attributes:
                if name in {"src", "href"} and not value.startswith(("data:", "#")):
                    outside.append(value)
                if name == "alt":
                    pictures.append(value)

        def handle_endtag(self, tag):
            assert open_tags.pop() == tag

    Parser().feed(page)
    assert not open_tags and not outside
    gallery = ["Scan", "Mesh", "Patches", "Numbers", "Deviation"]
    wide = ["Zebra stripes", "Combs of curvature", "Surfaces", "Displaced"]
    sides = ["Front", "Back", "Right", "Left", "Top", "Bottom"]
    assert pictures == gallery + wide + sides


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n0\n",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 900000000\nproperty float x\nproperty float y\n"
        b"property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\0\0",
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n",
    ],
    ids=["empty", "no y and z", "lying header", "not a number"],
)
def test_a_malformed_mesh_is_status_3_with_one_line_and_no_product(tmp_path, content):
    (tmp_path / "bad.ply").write_bytes(content)
    done = planish("run", "bad.ply", "-o", "out", cwd=tmp_path, status=3)
    lines = done.stderr.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: bad.ply: ") and " - hint: " in lines[0]
    assert [p.name for p in tmp_path.iterdir()] == ["bad.ply"]


def test_a_measured_part_goes_all_the_way(tmp_path):
    planish("run", data("goathead.ply"), "-o", tmp_path / "out")
    quality = json.loads((tmp_path / "out" / "report.json").read_text())["quality"]
    assert quality["mesh.watertight"] is True
    assert quality["surface.rms_rel"] < 0.0006
