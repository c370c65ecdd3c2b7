"""Files that are no good, through the program: status 3, one line, nothing left, and bounded time and memory."""

import resource
import struct
import subprocess
import time
from pathlib import Path

import meshes
import pytest
from conftest import PLANISH

THREADS = 2
SECONDS = 10


def cache_bytes():
    size = Path("/sys/devices/system/cpu/cpu0/cache/index3/size")
    return int(size.read_text().strip().removesuffix("K")) << 10 if size.exists() else 0


# Far above what a file of a few hundred bytes needs, far below what a lying header asks for. Each thread reserves address space,
# which it does not use: where it multiplies matrices twice the third level cache, nearly a gigabyte on some machines.
ADDRESS_SPACE = (1 << 30) + THREADS * 2 * cache_bytes()

XYZ = "property float x\nproperty float y\nproperty float z\n"
FACES = "property list uchar int vertex_indices\nend_header\n"


def ply(points, faces, vertices=None, triangles=None, form="ascii", kind=XYZ):
    head = f"ply\nformat {form} 1.0\nelement vertex {len(points) if vertices is None else vertices}\n{kind}"
    head += f"element face {len(faces) if triangles is None else triangles}\n{FACES}"
    return (head + "\n".join([*points, *faces]) + "\n").encode()


def stl(count):
    return b"binary".ljust(80, b" ") + struct.pack("<I", count) + bytes(50)


def glb(json, length=None):
    chunk = json.ljust(-(-len(json) // 4) * 4).encode()
    body = struct.pack("<II", len(chunk), 0x4E4F534A) + chunk
    return struct.pack("<III", 0x46546C67, 2, 12 + len(body) if length is None else length) + body


THREE = ["0 0 0", "1 0 0", "0 1 0"]
TABLE = {
    "empty.ply": b"",
    "words.ply": b"this is no mesh\n",
    "head.ply": b"ply\nformat ascii 1.0\nelement vertex 3\n",
    "version.ply": ply(THREE, ["3 0 1 2"]).replace(b" 1.0", b" 7.0"),
    "no-y.ply": b"ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nend_header\n0\n",
    "short.ply": ply(THREE, ["3 0 1 2"], vertices=9),
    "vertices.ply": ply([], [], vertices=4_000_000_000, triangles=1, form="binary_little_endian"),
    "faces.ply": ply(THREE, ["3 0 1 2"], triangles=2**62, form="binary_little_endian"),
    "negative.ply": ply(THREE, ["3 0 1 2"], vertices=-3),
    "index.ply": ply(THREE, ["3 0 1 7"]),
    "below.ply": ply(THREE, ["3 0 1 -1"]),
    "nan.ply": ply(["0 0 0", "1 0 nan", "0 1 0"], ["3 0 1 2"]),
    "inf.ply": ply(["0 0 0", "1 0 inf", "0 1 0"], ["3 0 1 2"]),
    "flat.ply": ply(["0 0 0", "1 0 0", "2 0 0"], ["3 0 1 2"]),
    "point.ply": ply(["5 5 5"] * 3, ["3 0 1 2"]),
    "cloud.ply": ply(THREE, []),
    "empty.stl": b"",
    "count.stl": stl(4_000_000_000),
    "solid.stl": b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0\n",
    "index.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
    "zero.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "words.obj": b"v a b c\n",
    "deep.gltf": b"[" * 100_000,
    "words.gltf": b"{",
    "length.glb": glb('{"asset":{"version":"2.0"}}', length=4_000_000_000),
    "nothing.glb": glb('{"asset":{"version":"2.0"}}'),
    "count.glb": glb(
        '{"asset":{"version":"2.0"},"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],'
        '"accessors":[{"componentType":5126,"type":"VEC3","count":4000000000}],"nodes":[{"mesh":0}]}'
    ),
    "part.docx": b"PK\3\4",
    "no-extension": b"ply\n",
    "broken.planish": b"SQLite format 3\0" + bytes(200),
    "empty.planish": b"",
}


def bounded(*arguments, cwd):
    def limit():
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))

    start = time.monotonic()
    done = subprocess.run(
        [str(PLANISH), *arguments, "--threads", str(THREADS)],
        cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=SECONDS, preexec_fn=limit,
    )
    return done, time.monotonic() - start


@pytest.mark.parametrize("name", TABLE)
def test_a_malformed_file_is_one_line_with_status_3_and_leaves_nothing(tmp_path, name):
    (tmp_path / name).write_bytes(TABLE[name])
    for arguments in (["run", name, "-o", "out"], ["fit", name, "-o", "m.planish"], ["layout", name, "-o", "n.json"]):
        done, _ = bounded(*arguments, cwd=tmp_path)
        assert done.returncode == 3, f"{arguments}: {done.returncode} {done.stderr}"
        lines = done.stderr.splitlines()
        assert len(lines) == 1 and lines[0].startswith(f"error: {name}: ") and " - hint: " in lines[0], done.stderr
        assert not done.stdout
        assert [p.name for p in tmp_path.iterdir()] == [name]


def test_the_bound_on_memory_lets_a_sound_mesh_pass(tmp_path):
    meshes.write_ply(tmp_path / "box.ply", meshes.box())
    done, _ = bounded("layout", "box.ply", "-o", "n.json", "--patches", "6", cwd=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_project_damaged_at_any_of_40_places_is_refused_or_read_whole_but_never_a_fault(demo, tmp_path):
    good = (demo / "model.planish").read_bytes()
    path = tmp_path / "m.planish"
    for k in range(40):
        at = k * len(good) // 40 + 17
        path.write_bytes(good[:at] + bytes(b ^ 0x55 for b in good[at : at + 64]) + good[at + 64 :])
        done, _ = bounded("info", "m.planish", cwd=tmp_path)
        assert done.returncode in (0, 3), f"byte {at}: {done.returncode} {done.stderr}"
        if done.returncode == 3:
            assert done.stderr.startswith("error: m.planish: ") and len(done.stderr.splitlines()) == 1
    path.write_bytes(good[: len(good) // 2])
    assert bounded("info", "m.planish", cwd=tmp_path)[0].returncode == 3
