"""Every line of a shell in README, guide and tutorials runs, in the order of its page, on small stand-ins for the reader's files; so
does every block of a script. What cannot run is in `LEFT_OUT` and `PIECES`, with the reason. Of the Python blocks those of
`docs/examples.md` and of the tutorial for researchers are run by crates/planish-py/tests; those of README, guide/python.md and the
tutorial for many files are not."""

import gzip
import os
import pathlib
import re
import shutil
import signal
import subprocess
import time

import pytest
from conftest import PLANISH, ROOT, planish
from meshes import ball, box, write_ply

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md")), *sorted((ROOT / "docs" / "tutorials").glob("*.md"))]

# Lines that are no command of a reader's shell, or cannot run here: how they begin, and why.
LEFT_OUT = {
    "scan ──►": "the picture of the way of the data",
    "make ": "errands of this repository: `make demo` is `planish demo`, which other tests run, `make test` would run this test",
    "pip install": "installs the package: `make test-python` does, from the wheel",
    "step ": "what the command above it prints",
    "error: ": "what the program prints",
    "python3 examples/edit/head.py": "test_edit.py runs the three lines of the head, on a coarser one",
    "planish mesh head.nrrd": "test_edit.py",
    "planish edit head.ply": "test_edit.py",
    "planish edit part.planish studio-tour.toml": "a session on the part of the studio: studio/e2e replays it",
}

# Blocks of scripts that are pieces without a solid, curve or image of their own to work on: page, first words, why.
PIECES = {
    ("edit.md", "[view]"): "picks on a head of 14 units",
    ("edit.md", '[[step]]\nedit = "relax"'): "a stroke that the page does not draw",
    ("edit.md", '[[step]]\nedit = "drag_curve"'): "a feature curve that the page does not draw",
    ("relief.md", '[[step]]\nedit = "erase"'): "a mask that is not there",
    ("relief.md", '[[step]]\nedit = "synthesise"'): "blocks that are too large for the stand-in",
    ("relief.md", "[[pair]]"): "places on models that are not there",
}

# Time that a line has; they take a second or two on a machine with nothing else to do.
SECONDS = 120


def shell_lines(page):
    """The indented lines outside fences, without what explains them."""
    lines, fenced = [], False
    for line in page.read_text().splitlines():
        fenced ^= line.startswith("```")
        if not fenced and line.startswith("    "):
            lines.append(re.split(r"(?<=\S) {2,}(?=\S)", line.strip())[0])
    return lines


def blocks(page, language):
    """The fenced blocks in a language."""
    return [part.split("\n```")[0] + "\n" for part in page.read_text().split(f"```{language}\n")[1:]]


def is_left_out(line):
    return any(line.startswith(start) for start in LEFT_OUT)


@pytest.fixture(scope="session")
def shelf(tmp_path_factory):
    """Files with the names that pages give theirs, made once."""
    folder = tmp_path_factory.mktemp("shelf")
    write_ply(folder / "part.ply", box(2))
    planish("transform", "part.ply", "--scale", 1, "-o", "broken.stl", cwd=folder)
    points = [(2 * x, 1.5 * y, z) for x, y, z in ball(10)[0]]
    (folder / "scan.xyz").write_text("".join(f"{x!r} {y!r} {z!r}\n" for x, y, z in points))
    planish("transform", "scan.xyz", "--scale", 1, "-o", "scan.e57", cwd=folder)
    planish("clean", "scan.xyz", "-o", "scan.ply", cwd=folder)
    (folder / "scan.ply.gz").write_bytes(gzip.compress((folder / "scan.ply").read_bytes()))
    planish("fit", "part.ply", "-o", "part.planish", cwd=folder)
    (folder / "moves.toml").write_text('[[step]]\nedit = "split_curve"\ncurve = 0\nat = 0.5\n\n[[step]]\nedit = "undo"\n')
    (folder / "edits.toml").write_text('[[step]]\nedit = "stroke"\npath = [[-1, 0, 1], [1, 0, 1]]\nradius = 0.4\nheight = 0.05\n')
    return folder


def stand_ins(shelf, folder):
    """Lays the files of the shelf, with all names that pages use, into the folder of a page."""
    names = {
        "part.ply": ["part.ply", "extra.ply", "look/mesh.ply"],
        "broken.stl": ["broken.stl", "part.stl", "scan.stl"],
        "scan.xyz": ["scan.xyz", "raw.xyz"],
        "scan.e57": ["scan.e57", "scans/a.e57", "look/scan.e57"],
        "scan.ply.gz": ["scan.ply.gz"],
        "part.planish": ["part.planish", "model.planish", "plain.planish"],
        "moves.toml": ["moves.toml"],
        "edits.toml": ["edits.toml"],
    }
    for source, targets in names.items():
        for target in targets:
            (folder / target).parent.mkdir(exist_ok=True)
            shutil.copy(shelf / source, folder / target)


def environment(folder):
    """A home of the page's own, and the program under its name."""
    (folder / "bin").mkdir()
    (folder / "bin" / "planish").symlink_to(PLANISH)
    home = folder / "home"
    (home / ".local" / "share" / "bash-completion" / "completions").mkdir(parents=True)
    (home / ".local" / "share" / "man").mkdir()
    return os.environ | {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "HOME": str(home)}


def studio(line, folder, env):
    """Starts the studio as the page says, but without a browser; it tells its address and ends at Ctrl-C. A program that was built
    without the page (not by `make`) says so."""
    words = [*line.split(), "--no-open", "--port", "0"]
    with open(folder / "studio.txt", "wb+") as told:
        server = subprocess.Popen(words, cwd=folder, env=env, stdin=subprocess.DEVNULL, stdout=told, stderr=told)
        until = time.monotonic() + SECONDS
        while b"http://" not in (folder / "studio.txt").read_bytes():
            if b"built without the studio's page" in (folder / "studio.txt").read_bytes():
                server.wait()
                return
            assert server.poll() is None and time.monotonic() < until, (line, (folder / "studio.txt").read_text())
            time.sleep(0.02)
        server.send_signal(signal.SIGINT)
        assert server.wait(timeout=SECONDS) in (0, 130), (line, (folder / "studio.txt").read_text())


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_shell_lines_of_a_page_run_in_their_order(page, shelf, tmp_path):
    lines = [line for line in shell_lines(page) if not is_left_out(line)]
    if not lines:
        return
    stand_ins(shelf, tmp_path)
    env = environment(tmp_path)
    for line in lines:
        assert line.split()[0] in ("planish", "zcat"), f"{page.name}: {line}: run it, or say in LEFT_OUT why not"
        if line.startswith("planish studio"):
            studio(line, tmp_path, env)
            continue
        # A page shows several ways to one product: what stands there is another's by then.
        text = f"planish() {{ command planish \"$@\" {'--force' if needs_force(line) else ''}; }}; {line}"
        done = subprocess.run(
            ["bash", "-o", "pipefail", "-c", text],
            cwd=tmp_path, env=env, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=SECONDS
        )
        # A tolerance may be missed by a stand-in: the product is there.
        allowed = (0, 1) if "--tolerance" in line else (0,)
        assert done.returncode in allowed, f"{page.name}: {line}: {done.returncode}\n{done.stderr}"


def needs_force(line):
    """True for lines whose product the page has as an input elsewhere."""
    return " -o part.ply" in line or " -o part.planish" in line


def test_every_left_out_line_and_piece_is_still_on_a_page():
    lines = [line for page in PAGES for line in shell_lines(page)]
    assert not [start for start in LEFT_OUT if not any(line.startswith(start) for line in lines)]
    for (name, start), _ in PIECES.items():
        assert any(block.startswith(start) for block in blocks(ROOT / "docs" / "guide" / name, "toml")), (name, start)


SCRIPTS = [(page, block) for page in PAGES for block in blocks(page, "toml")]


@pytest.mark.parametrize("page,block", SCRIPTS, ids=lambda x: x.name if isinstance(x, pathlib.Path) else "")
def test_a_script_on_a_page_runs(page, block, shelf, tmp_path):
    if any(page.name == name and block.startswith(start) for name, start in PIECES):
        return
    stand_ins(shelf, tmp_path)
    (tmp_path / "finish.nc").write_text("G21 G90\nG0 X12 Y12 Z5\nG1 Z-6 F200\nG1 X48\n")
    script = tmp_path / "script.toml"
    script.write_text(block)
    if "[solid." in block or "[stock]" in block:
        planish("mesh", script, "--resolution", 40, "-o", "made.ply", cwd=tmp_path)
        assert (tmp_path / "made.ply").stat().st_size > 1000
    elif "[[move]]" in block:
        planish("deform", "part.planish", script, "-o", "moved.planish", cwd=tmp_path)
    else:
        # The image beside the script, and places on the stand-in.
        shutil.copy(ROOT / "docs" / "pictures" / "letters.png", tmp_path / "letters.png")
        planish("relief", "edit", "part.planish", script, "-o", "edited.planish", cwd=tmp_path)
