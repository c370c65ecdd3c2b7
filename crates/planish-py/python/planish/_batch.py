"""Whole runs: one part, or many beside each other.

Both are `planish run` in a process of its own: its options are keywords, its products and its report are the same, and a run
that fails or is killed takes nothing else along.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._planish import Cloud, Mesh, Model, RunError, read

#: Exit statuses of the program with a result: done, and a demanded tolerance is missed.
_DONE, _MISSED = 0, 1
#: Seconds that the program has to end by itself after Ctrl-C.
_GRACE = 2.0

Option = bool | int | float | str | list[int] | tuple[int, ...] | None


@dataclass(frozen=True)
class Run:
    """What a run left in its folder."""

    #: The folder: points.ply (scans only), mesh.ply, model.planish, surface.step, preview.glb, relief, report.*
    folder: Path
    #: report.json
    report: dict[str, Any] = field(repr=False)
    #: True if the result misses a tolerance that was demanded.
    missed: bool = False

    @property
    def quality(self) -> dict[str, Any]:
        """Figures of quality by key."""
        return dict(self.report["quality"])

    @property
    def warnings(self) -> list[dict[str, str]]:
        """What a user should know: dicts of `code`, `message`, `where`."""
        return list(self.report["warnings"])

    def model(self) -> Model:
        """Reads the model."""
        return Model.read(self.folder / "model.planish")

    def mesh(self) -> Mesh:
        """Reads the mesh that the model was fitted to."""
        mesh = read(self.folder / "mesh.ply")
        assert isinstance(mesh, Mesh)
        return mesh


def run(
    source: str | os.PathLike[str] | Cloud | Mesh,
    output: str | os.PathLike[str],
    *,
    progress: bool = False,
    **options: Option,
) -> Run:
    """Everything, as `planish run`: scan or mesh in; surfaces, displacement maps and a report in a folder.

    * source: a file, or a cloud or mesh
    * output: the folder; made if missing
    * progress: True shows the program's bars on a terminal
    * options: those of `planish run --help` with _ for -, such as `patches=60`, `tolerance=1e-4`, `units="m"`,
      `threads=2`, `force=True`; None is as if not given

    Raises RunError with the program's message and its exit `status`.
    """
    with _file_of(source) as path:
        return _run(path, Path(output), options, _Children(), progress)


@dataclass(frozen=True)
class Row:
    """One part of a batch."""

    #: The input.
    source: Path
    #: The folder of its products.
    folder: Path
    #: "done", "missed" (a demanded tolerance), "skipped" (finished before) or "failed"
    status: str
    #: Wall-clock time, seconds; that of the run that made the products.
    seconds: float
    #: The program's message, where it failed.
    error: str | None = None
    #: Figures of quality by key; empty where it failed.
    quality: dict[str, Any] = field(default_factory=dict, repr=False)


#: Columns of the table: heading, key of the report, form.
_COLUMNS = (
    ("patches", "patches.count", "{:.0f}"),
    ("RMS %", "surface.rms_rel", "{:.4%}"),
    ("max %", "surface.max_rel", "{:.4%}"),
    ("seam deg", "seam.inner_angle_max_deg", "{:.2f}"),
)


class Batch(list[Row]):
    """The rows of a batch, in the order of its inputs. As text it is a table."""

    @property
    def failed(self) -> list[Row]:
        """The rows that failed."""
        return [row for row in self if row.status == "failed"]

    def cells(self) -> Iterator[list[str]]:
        """The table: a heading and one list of texts for each row."""
        yield ["part", "status", "time s", *(heading for heading, _, _ in _COLUMNS), "remark"]
        for row in self:
            figures = [form.format(row.quality[key]) if key in row.quality else "" for _, key, form in _COLUMNS]
            yield [row.source.name, row.status, f"{row.seconds:.1f}", *figures, row.error or ""]

    def __str__(self) -> str:
        cells = list(self.cells())
        widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
        lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in cells)
        return "\n".join(line.rstrip() for line in lines)

    def _repr_html_(self) -> str:
        import html

        head, *rows = self.cells()
        line = "<tr>{}</tr>".format
        cell = "<{0}>{1}</{0}>".format
        body = [line("".join(cell("td", html.escape(text)) for text in row)) for row in rows]
        return f"<table>{line(''.join(cell('th', text) for text in head))}{''.join(body)}</table>"


def run_many(
    sources: Iterable[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    jobs: int = 1,
    progress: bool | Callable[[Row], None] = False,
    **options: Option,
) -> Batch:
    """Everything for many files: one folder of products each, below `output`; as `planish run` with several inputs.

    One that fails does not stop the others. One that was finished by an earlier call is skipped if its content, the options
    and the version of planish are the same and its products are there: `output/manifest.json` tells. `output/batch.html` is
    the table as a page, `output/batch.json` for programs.

    * sources: files, and patterns such as "scans/*.e57"
    * jobs: runs beside each other; `threads` of each is a share of the cores unless it is given
    * progress: True writes a line for each row to stderr; a function is called with it
    * options: as of `run`, for all of them

    Returns the table; raises KeyboardInterrupt on Ctrl-C when all runs have ended, and what is finished stays finished.
    Raises RunError for options that there are not, and for a folder that cannot be written to.
    """
    if jobs < 1:
        raise ValueError(f"jobs={jobs}: at least 1 is needed")
    paths = [os.fspath(source) for source in sources]
    if not paths:
        return Batch()
    command = ["run", "--output", os.fspath(output), f"--jobs={jobs}", *_flags(options), "--", *paths]
    return _batch(command, len(paths), progress)


def _batch(command: list[str], least: int, progress: bool | Callable[[Row], None]) -> Batch:
    """Runs the program for a batch of at least so many rows."""
    tell = progress if callable(progress) else None
    quiet = [] if progress and tell is None else ["--quiet"]
    children, rows = _Children(), dict[int, Row]()
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as told:
        process = children.start([command[0], "--json", *quiet, *command[1:]], subprocess.PIPE, told if quiet else None)
        assert process.stdout is not None
        try:
            for line in process.stdout:
                index, row = _row(json.loads(line))
                rows[index] = row
                if tell is not None:
                    tell(row)
            process.wait()
        except BaseException:
            children.stop()
            raise
        finally:
            children.ended(process)
        # Without a row for each input the batch itself failed.
        if len(rows) < least:
            told.seek(0)
            raise _failure(told.read(), process.returncode)
    return Batch(rows[k] for k in sorted(rows))


def _row(told: dict[str, Any]) -> tuple[int, Row]:
    """A row from the program's line of JSON."""
    error = told.get("error")
    row = Row(
        Path(told["source"]),
        Path(told["folder"]),
        told["status"],
        told["seconds"],
        None if error is None else error.removeprefix("error: "),
        told["quality"],
    )
    return told["index"], row


def _tell(row: Row, progress: bool | Callable[[Row], None]) -> None:
    """Tells of a row."""
    if callable(progress):
        progress(row)
    elif progress:
        print(f"{row.source}: {row.status} in {row.seconds:.1f} s{f' - {row.error}' if row.error else ''}", file=sys.stderr)


class _Children:
    """The processes that run, so that they can be stopped. Each ends by itself when its standard input does: also when this
    process dies."""

    def __init__(self) -> None:
        self._lock, self._stopped = threading.Lock(), False
        self._running: set[subprocess.Popen[str]] = set()

    def start(self, command: list[str], stdout: int, stderr: Any) -> subprocess.Popen[str]:
        """Starts the program with a command line, unless all are to stop."""
        with self._lock:
            if self._stopped:
                raise RunError("interrupted")
            program = [sys.executable, "-m", "planish", command[0], "--tied", *command[1:]]
            process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=stdout, stderr=stderr, text=True, encoding="utf-8")
            self._running.add(process)
            return process

    def ended(self, process: subprocess.Popen[str]) -> None:
        """Forgets a process."""
        with self._lock:
            self._running.discard(process)
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()

    def stop(self) -> None:
        """Ends all processes as Ctrl-C does, and by force if they do not hear."""
        with self._lock:
            self._stopped = True
            running = list(self._running)
        for process in running:
            if process.stdin is not None:
                process.stdin.close()
        end = time.monotonic() + _GRACE
        for process in running:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _run(path: Path, output: Path, options: dict[str, Option], children: _Children, progress: bool) -> Run:
    """Runs the program on a file."""
    quiet = [] if progress else ["--quiet"]
    command = ["run", *quiet, "--output", str(output), *_flags(options), "--", str(path)]
    with tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as told:
        process = children.start(command, subprocess.DEVNULL, None if progress else told)
        try:
            process.wait()
        except BaseException:
            children.stop()
            raise
        finally:
            children.ended(process)
        told.seek(0)
        if process.returncode not in (_DONE, _MISSED):
            raise _failure(told.read(), process.returncode)
    report = json.loads((output / "report.json").read_text(encoding="utf-8"))
    return Run(output, report, process.returncode == _MISSED)


def _failure(told: str, status: int) -> RunError:
    """The exception of a run without a result: the program's own line."""
    lines = [line for line in told.splitlines() if line.startswith("error:")]
    message = (lines[-1] if lines else f"error: the program ended with status {status}").removeprefix("error: ")
    error = RunError(message)
    error.status = status
    error.hint = message.rpartition(" - hint: ")[2] if " - hint: " in message else None
    return error


def _flags(options: dict[str, Option]) -> Iterator[str]:
    """Options as they are written on the command line."""
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is None or (value is False and name in _SWITCHES):
            continue
        if value is True and name in _SWITCHES:
            yield flag
        elif isinstance(value, bool):
            yield f"{flag}={str(value).lower()}"
        elif isinstance(value, (list, tuple)):
            yield f"{flag}={','.join(map(str, value))}"
        else:
            yield f"{flag}={value}"


#: Options without a value.
_SWITCHES = ("force", "no_clobber", "in_place", "json", "open", "close", "quiet", "verbose")


class _file_of:
    """A file that a source is in: its own, or one that lives as long as the run."""

    def __init__(self, source: str | os.PathLike[str] | Cloud | Mesh) -> None:
        self._source = source
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def __enter__(self) -> Path:
        if not isinstance(self._source, (Cloud, Mesh)):
            return Path(self._source)
        self._folder = tempfile.TemporaryDirectory(prefix="planish-")
        path = Path(self._folder.name) / ("mesh.ply" if isinstance(self._source, Mesh) else "scan.ply")
        self._source.write(path)
        return path

    def __exit__(self, *_: object) -> None:
        if self._folder is not None:
            self._folder.cleanup()
