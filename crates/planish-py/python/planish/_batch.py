"""Whole runs: one part, or many beside each other.

Each run is the program in a process of its own, as on the command line: its options are keywords, its products and its
report are the same, and a run that fails or is killed takes nothing else along.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ._planish import Cloud, Mesh, Model, RunError, __version__, read

#: Exit statuses of the program with a result: done, and a demanded tolerance is missed.
_DONE, _MISSED = 0, 1
#: Seconds that the program has to end by itself after Ctrl-C.
_GRACE = 2.0
#: Products whose presence tells that a run was finished.
_PRODUCTS = ("mesh.ply", "model.planish", "surface.step", "preview.glb", "report.json", "report.html", "relief")
#: Name of the file that tells which runs of a batch are finished.
_MANIFEST = "manifest.json"

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
    ("seam deg", "seam.angle_max_deg", "{:.2f}"),
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
    """Everything for many files: one folder of products each, below `output`.

    One that fails does not stop the others. One that was finished by an earlier call is skipped if its content, the options
    and the version of planish are the same and its products are there: `output/manifest.json` tells.

    * sources: files
    * jobs: runs beside each other; `threads` of each is a share of the cores unless it is given
    * progress: True writes a line for each row to stderr; a function is called with it
    * options: as of `run`, for all of them

    Returns the table; raises KeyboardInterrupt on Ctrl-C when all runs have ended, and what is finished stays finished.
    """
    if jobs < 1:
        raise ValueError(f"jobs={jobs}: at least 1 is needed")
    folder = Path(output)
    folder.mkdir(parents=True, exist_ok=True)
    if options.get("threads") is None:
        options = {**options, "threads": max(1, (os.cpu_count() or 1) // jobs)}
    paths = [Path(source) for source in sources]
    manifest, children = _Manifest(folder / _MANIFEST), _Children()
    rows: dict[int, Row] = {}
    with ThreadPoolExecutor(jobs) as pool:
        places = zip(paths, _names(paths), strict=True)
        work = {pool.submit(_one, path, folder / name, options, manifest, children): k for k, (path, name) in enumerate(places)}
        try:
            for done, row in _ended(work):
                rows[done] = row
                _tell(row, progress)
        except BaseException:
            children.stop()
            for future in work:
                future.cancel()
            raise
    return Batch(rows[k] for k in sorted(rows))


def _ended(work: dict[Future[Row], int]) -> Iterator[tuple[int, Row]]:
    """Rows as they end. It wakes often: a thread that waits for a lock hears no Ctrl-C on some systems."""
    left = set(work)
    while left:
        ended, left = wait(left, timeout=0.1, return_when=FIRST_COMPLETED)
        for future in ended:
            yield work[future], future.result()


def _one(path: Path, folder: Path, options: dict[str, Option], manifest: _Manifest, children: _Children) -> Row:
    """One row of a batch."""
    try:
        key = _key(path, options)
    except OSError as error:
        return Row(path, folder, "failed", 0.0, f"error: {path}: cannot be read ({error.strerror})")
    if (known := manifest.finished(folder, key)) is not None:
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
        return Row(path, folder, "skipped", known["seconds"], quality=report["quality"])
    start = time.monotonic()
    try:
        made = _run(path, folder, options, children, progress=False)
    except RunError as error:
        return Row(path, folder, "failed", time.monotonic() - start, str(error))
    seconds = time.monotonic() - start
    status = "missed" if made.missed else "done"
    manifest.add(folder, {"key": key, "source": str(path), "status": status, "seconds": round(seconds, 3)})
    return Row(path, folder, status, seconds, quality=made.quality)


def _tell(row: Row, progress: bool | Callable[[Row], None]) -> None:
    if callable(progress):
        progress(row)
    elif progress:
        print(f"{row.source}: {row.status} in {row.seconds:.1f} s{f' - {row.error}' if row.error else ''}", file=sys.stderr)


def _names(paths: list[Path]) -> Iterator[str]:
    """A folder's name for each file: its stem, with its extension where two have one stem, and a number where that helps not."""
    taken: set[str] = set()
    stems = [path.stem for path in paths]
    for path in paths:
        name = path.stem if stems.count(path.stem) == 1 else path.name.replace(".", "-")
        number, plain = 2, name
        while name in taken:
            name, number = f"{plain}-{number}", number + 1
        taken.add(name)
        yield name


def _key(path: Path, options: dict[str, Option]) -> str:
    """What the products depend on: content, options, version."""
    told = {name: value for name, value in options.items() if value is not None and name not in ("threads", "force")}
    digest = hashlib.sha256(json.dumps([__version__, path.suffix.lower(), told], sort_keys=True).encode())
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


class _Manifest:
    """Which runs of a batch are finished: one JSON file, replaced as a whole after each."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock = path, threading.Lock()
        try:
            self._rows: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))["runs"]
        except (OSError, ValueError, KeyError, TypeError):
            # None yet, or one that a crash of the machine cut off: everything is run.
            self._rows = {}

    def finished(self, folder: Path, key: str) -> dict[str, Any] | None:
        """The entry of a folder, if its products are those of this key and all there."""
        with self._lock:
            row: dict[str, Any] | None = self._rows.get(folder.name)
        whole = row is not None and row["key"] == key and all((folder / name).exists() for name in _PRODUCTS)
        return row if whole else None

    def add(self, folder: Path, row: dict[str, Any]) -> None:
        """Adds an entry and writes the file."""
        with self._lock:
            self._rows[folder.name] = row
            text = json.dumps({"planish": __version__, "runs": dict(sorted(self._rows.items()))}, indent=1)
            beside = self._path.with_suffix(".json.part")
            beside.write_text(text + "\n", encoding="utf-8")
            beside.replace(self._path)


class _Children:
    """The processes that run, so that they can be stopped."""

    def __init__(self) -> None:
        self._lock, self._stopped = threading.Lock(), False
        self._running: set[subprocess.Popen[str]] = set()

    def start(self, command: list[str], progress: bool) -> subprocess.Popen[str]:
        """Starts a process, unless all are to stop."""
        with self._lock:
            if self._stopped:
                raise RunError("interrupted")
            errors = None if progress else subprocess.PIPE
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=errors, stdin=subprocess.DEVNULL, text=True)
            self._running.add(process)
            return process

    def ended(self, process: subprocess.Popen[str]) -> None:
        """Forgets a process."""
        with self._lock:
            self._running.discard(process)

    def stop(self) -> None:
        """Ends all processes: as Ctrl-C does, and by force if they do not hear."""
        with self._lock:
            self._stopped = True
            running = list(self._running)
        for process in running:
            process.send_signal(signal.SIGINT)
        end = time.monotonic() + _GRACE
        for process in running:
            try:
                process.wait(max(0.0, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()


def _run(path: Path, output: Path, options: dict[str, Option], children: _Children, progress: bool) -> Run:
    """Runs the program on a file."""
    command = [sys.executable, "-m", "planish", "run", str(path), "-o", str(output), *_flags(options)]
    process = children.start(command if progress else [*command, "--quiet"], progress)
    try:
        _, told = process.communicate()
    except BaseException:
        children.stop()
        raise
    finally:
        children.ended(process)
    if process.returncode not in (_DONE, _MISSED):
        raise _failure(told or "", process.returncode)
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
_SWITCHES = ("force", "no_clobber", "in_place", "open", "close", "quiet", "verbose")


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
