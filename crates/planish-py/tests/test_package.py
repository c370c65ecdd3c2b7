"""The package itself: types, documentation, the program on the path."""

from __future__ import annotations

import inspect
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest

import planish

ROOT = Path(__file__).parents[3]


def run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_stubs_are_those_of_the_compiled_part() -> None:
    run(sys.executable, "-m", "mypy.stubtest", "planish", "--mypy-config-file", "pyproject.toml")


def test_package_and_examples_are_typed_strictly() -> None:
    run(sys.executable, "-m", "mypy", "crates/planish-py/python/planish", *map(str, (ROOT / "examples/python").glob("*.py")))
    assert (Path(planish.__file__).parent / "py.typed").exists()


def public() -> list[tuple[str, object]]:
    """Everything that `help` shows."""
    found: list[tuple[str, object]] = []
    for name in planish.__all__:
        thing = getattr(planish, name)
        if name.startswith("__"):
            continue
        found.append((name, thing))
        if inspect.isclass(thing) and not issubclass(thing, (Exception, list)):
            found += [(f"{name}.{key}", value) for key, value in vars(thing).items() if not key.startswith("_")]
    return found


@pytest.mark.parametrize(("name", "thing"), public(), ids=[name for name, _ in public()])
def test_everything_is_documented(name: str, thing: object) -> None:
    # Fields of dataclasses tell of themselves in the source.
    if isinstance(thing, (str, bool, int, float, dict)) or thing is None or name.split(".")[0] in ("Run", "Row"):
        return
    assert (inspect.getdoc(thing) or "").strip(), f"{name} has no documentation"


def test_the_program_is_on_the_path_and_tells_the_version_of_the_package() -> None:
    program = Path(sysconfig.get_path("scripts")) / "planish"
    told = subprocess.run([program, "--version"], capture_output=True, text=True, check=True)
    assert told.stdout.split() == ["planish", planish.__version__]
    wrong = subprocess.run([program, "no-such-command"], capture_output=True, text=True)
    assert wrong.returncode == 2 and "no-such-command" in wrong.stderr


def test_the_compiled_part_is_below_25_mb_packed() -> None:
    import zlib

    compiled = next(Path(planish.__file__).parent.glob("_planish*.so"))
    assert len(zlib.compress(compiled.read_bytes(), 1)) < 25e6
