"""Many files, or one large scan, on many machines: a Dask cluster in the place of one machine's cores.

    from planish import distributed

    distributed.run_many(["a.ply", "b.e57"], "out", patches=60)                            # a cluster of this machine's own
    distributed.run_many(["a.ply", "b.e57"], "out", cluster="tcp://10.0.0.1:8786")         # any Dask cluster, by its address
    mesh = distributed.mesh("huge.e57", cluster="tcp://10.0.0.1:8786", folder="/shared/huge")
    model = distributed.fit(mesh.layout(patches=5000), cluster="tcp://10.0.0.1:8786")

`run_many`: each input is one task, and each task is `planish run` in a process of its own on its worker: the products are the same
bytes, in the same folders, as those of `planish.run_many`, whatever the number of workers. `mesh`: each brick of a scan is a task,
first for its samples and then for its mesh (`planish.Bricks`); the mesh is the same bytes as on one machine. `fit`: patches of a
network are relaxed by shares, each share a task, and the model is the same bytes; what workers need is sent to them. For
the other two they read and write files by these paths, so on several machines these lie on a file system that all of them have. A
task whose worker dies is started again on another one; files appear whole or not at all, and what is finished is not lost.

A script that starts a cluster of its own needs `if __name__ == "__main__":` around the call, as everything does that starts
processes. It needs `dask.distributed`, imported when it is asked for.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from ._batch import Batch, Option, Row, _batch, _flags, _tell
from ._planish import Bricks, Cloud, Grid, Mesh, Model, Network, RunError, folder_names, keywords, set_threads

if TYPE_CHECKING:
    from pathlib import Path

__all__ = ["fit", "mesh", "run_many"]

#: Workers that may die under one task before it counts as failed.
_DEATHS = 3


def run_many(
    sources: Iterable[str | os.PathLike[str]],
    output: str | os.PathLike[str],
    *,
    cluster: Any = None,
    jobs: int | None = None,
    progress: bool | Callable[[Row], None] = False,
    **options: Option,
) -> Batch:
    """Everything for many files on a cluster: one folder of products each, below `output`.

    * sources: files
    * cluster: the address of a scheduler, a `dask.distributed.Client` or a cluster of Dask's; None makes one of this machine's
      cores for the time of the call
    * jobs: workers of a cluster that is made here, one for each core unless given; `threads` of each run is 1 unless given
    * progress: True writes a line for each row to stderr; a function is called with it
    * options: as of `planish.run`, for all of them

    Returns the table, as `planish.run_many` does; an input whose workers died three times is a row that failed. Raises
    RunError for options that there are not, ImportError without `dask.distributed`.
    """
    import pathlib

    paths = [pathlib.Path(source).absolute() for source in sources]
    folder = pathlib.Path(output).absolute()
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs={jobs}: at least 1 is needed")
    if not paths:
        return Batch()
    if options.get("threads") is None:
        options = {**options, "threads": 1}
    with _client(cluster, jobs) as client:
        work = {
            client.submit(_task, str(path), str(folder), name, options, key=f"planish-{k}-{_stamp()}", pure=False): k
            for k, (path, name) in enumerate(zip(paths, folder_names([str(path) for path in paths]), strict=True))
        }
        return _gathered(work, paths, folder, progress)


def _task(source: str, output: str, name: str, options: dict[str, Option]) -> Row:
    """One input, on a worker: the program itself skips what is finished."""
    command = ["run", "--output", output, "--jobs=1", f"--folder={name}", *_flags(options), "--", source]
    return _batch(command, 1, progress=False)[0]


def mesh(
    scan: str | os.PathLike[str] | Iterable[Cloud],
    *,
    cluster: Any = None,
    jobs: int | None = None,
    memory: float | None = None,
    folder: str | os.PathLike[str] | None = None,
    most: int | None = None,
    columns: str | None = None,
    classes: Sequence[int] | None = None,
    close: bool | None = None,
    progress: bool | Callable[[str, float], object] = False,
    **parameters: Any,
) -> Mesh:
    """The mesh of a scan that is too large for one process, brick by brick on a cluster.

    * scan: the file, or its pieces, as of `Bricks.create`
    * cluster, jobs: as of `run_many`
    * memory: GB that each worker of a cluster that is made here may take; a brick of the usual size takes about half of one
    * folder: where the bricks lie, empty or not there yet; all workers see it. None: a temporary one of this machine, for a
      cluster of this machine alone
    * most, columns, classes, close and the keywords of `Cloud.mesh`: as of `Bricks.create`
    * progress: True writes the steps to stderr; a function is called with the name of the step and the share done

    Returns the mesh: the same bytes as `Bricks` gives in one process. Raises what `Bricks` raises; RunError if workers died three
    times under one brick; ImportError without `dask.distributed`.
    """
    import pathlib
    import tempfile

    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs={jobs}: at least 1 is needed")
    if most is not None:
        parameters["most"] = most
    with _client(cluster, jobs, memory) as client, tempfile.TemporaryDirectory(prefix="planish-") as own:
        place = str(pathlib.Path(folder if folder is not None else own).absolute())
        bricks = Bricks.create(scan, place, columns=columns, classes=classes, close=close, **parameters)
        count = len(bricks)
        each: list[tuple[int, ...]] = [(k,) for k in range(count)]
        at_once: list[tuple[int, ...]] = [()]
        for step, arguments in (("clean", each), ("settle", at_once), ("mesh", each)):
            _all(client, step, (place, _stamp()), arguments, progress)
        return bricks.weld()


def fit(
    network: Network,
    *,
    cluster: Any = None,
    jobs: int | None = None,
    progress: Any = None,
    **parameters: Any,
) -> Model:
    """A model of a network, as `Network.fit` makes it, with the patches relaxed by the workers of a cluster.

    * cluster, jobs: as of `run_many`
    * progress and the other keywords: as of `Network.fit`

    Grids are the part of the work that falls apart into patches; surfaces, seams and reliefs follow in this process. Returns the
    model: the same bytes as without a cluster. Raises what `Network.fit` raises; RunError if workers died three times under one share of
    the patches; ImportError without `dask.distributed`.
    """
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs={jobs}: at least 1 is needed")
    of_grids = {name: value for name, value in parameters.items() if name in keywords()["grid"]}
    with _client(cluster, jobs) as client:
        held = client.scatter(network, broadcast=True, hash=False)
        workers = max(1, len(client.scheduler_info()["workers"]))

        def relax(patches: Any, sizes: Any, stopped: Callable[[], bool]) -> list[Grid]:
            # Neighbours are alike, so every share has some of all parts of the model.
            count = min(len(patches), _SHARES * workers)
            shares = [slice(k, None, count) for k in range(count)]
            stamp = _stamp()
            work = [
                client.submit(
                    _relaxed, held, patches[share], sizes[share], of_grids, key=f"planish-relax-{k}-{stamp}", pure=False
                )
                for k, share in enumerate(shares)
            ]
            return _in_order(work, shares, len(patches), stopped)

        return network.fit(relax=relax, progress=progress, **parameters)


#: Shares of the patches for each worker: the last one to end keeps the others waiting by a part of that.
_SHARES = 8
#: Seconds between two looks whether the result is still wanted.
_LOOK = 0.05


def _relaxed(network: Network, patches: Any, sizes: Any, parameters: dict[str, Any]) -> list[Grid]:
    """A share of the patches, on a worker, which has other threads only for other shares."""
    set_threads(1)
    return network.relax(patches, sizes, **parameters)


def _in_order(work: list[Any], shares: list[slice], count: int, stopped: Callable[[], bool]) -> list[Grid]:
    """The grids of all shares, in the order of their patches; the first share that fails stops the others."""
    import distributed
    from distributed.scheduler import KilledWorker

    found: list[Any] = [None] * count
    try:
        for future, share in zip(work, shares, strict=True):
            while not future.done():
                if stopped():
                    raise KeyboardInterrupt
                try:
                    distributed.wait(future, timeout=_LOOK)
                except TimeoutError:
                    continue
            try:
                found[share] = future.result()
            except KilledWorker as error:
                raise RunError(f"relax: {_DEATHS} workers died under one share of the patches ({error})") from error
    except BaseException:
        for future in work:
            future.cancel()
        raise
    return found


def _all(
    client: Any,
    step: str,
    place: tuple[str, str],
    arguments: Sequence[tuple[int, ...]],
    progress: bool | Callable[[str, float], object],
) -> None:
    """One step of all bricks; the first that fails stops the others."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    work = [
        client.submit(_brick, step, place, a, key=f"planish-{step}-{k}-{place[1]}", pure=False) for k, a in enumerate(arguments)
    ]
    try:
        for done, future in enumerate(as_completed(list(work)), start=1):
            try:
                future.result()
            except KilledWorker as error:
                raise RunError(f"{step}: {_DEATHS} workers died under one brick ({error})") from error
            if callable(progress):
                progress(step, done / len(work))
            elif progress:
                print(f"{step} {done} of {len(work)}", file=sys.stderr)
    except BaseException:
        for future in work:
            future.cancel()
        raise


#: The bricks of the step that this worker had last, by folder and stamp: what was settled for all is read once.
_held: dict[tuple[str, str], Bricks] = {}


def _brick(step: str, place: tuple[str, str], arguments: tuple[int, ...]) -> None:
    """A step of one brick, on a worker, which has other threads only for other bricks."""
    set_threads(1)
    bricks = _held.get(place)
    if bricks is None:
        bricks = Bricks(place[0])
        _held.clear()
        _held[place] = bricks
    getattr(bricks, step)(*arguments)


def _gathered(work: dict[Any, int], paths: list[Path], folder: Path, progress: bool | Callable[[Row], None]) -> Batch:
    """The rows as they come, in the order of the inputs."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    rows: dict[int, Row] = {}
    try:
        for future in as_completed(list(work)):
            k = work[future]
            try:
                row = future.result()
            except KilledWorker as error:
                row = Row(paths[k], folder, "failed", 0.0, f"{paths[k]}: {_DEATHS} workers died under it ({error})")
            rows[k] = row
            _tell(row, progress)
    except BaseException:
        for future in work:
            future.cancel()
        raise
    return Batch(rows[k] for k in sorted(rows))


def _stamp() -> str:
    """Something that no earlier task of the cluster is named by: a result that it still knows would be taken for this one."""
    import uuid

    return uuid.uuid4().hex


class _client:
    """A client of a cluster, which is closed if it was made here."""

    def __init__(self, cluster: Any, jobs: int | None, memory: float | None = None) -> None:
        try:
            import distributed
        except ImportError as error:
            hint = "install it with pip install 'planish[distributed]'"
            raise ImportError(f"planish.distributed needs dask.distributed - hint: {hint}") from error
        self._own: list[Any] = []
        if isinstance(cluster, distributed.Client):
            self._client = cluster
            return
        if cluster is None:
            # One task at a time for each worker: the runs have threads of their own.
            cluster = distributed.LocalCluster(
                n_workers=jobs or os.cpu_count() or 1,
                threads_per_worker=1,
                memory_limit="auto" if memory is None else int(memory * 1e9),
                dashboard_address=None,
            )
            self._own.append(cluster)
        self._client = distributed.Client(cluster)
        self._own.insert(0, self._client)

    def __enter__(self) -> Any:
        return self._client

    def __exit__(self, *_: object) -> None:
        for thing in self._own:
            thing.close()
