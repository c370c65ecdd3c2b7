"""Long calls: progress, Ctrl-C, threads, and what a call costs."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import planish


def test_progress_tells_the_stages_in_order_and_ends_at_one(ball: planish.Mesh) -> None:
    told: list[tuple[str, float]] = []
    ball.fit(patches=12, progress=lambda stage, share: told.append((stage, share)))
    shares = [share for _, share in told]
    assert shares == sorted(shares) and shares[-1] == 1.0 and told[-1][0] == "measure"


def test_what_progress_raises_stops_the_call(scan: planish.Cloud) -> None:
    class Enough(Exception):
        pass

    def stop(stage: str, share: float) -> None:
        raise Enough

    start = time.monotonic()
    with pytest.raises(Enough):
        scan.fit(progress=stop)
    assert time.monotonic() - start < 3.0


def test_progress_must_be_a_function_or_a_truth(ball: planish.Mesh) -> None:
    with pytest.raises(TypeError, match="progress"):
        ball.repair(progress=3)  # type: ignore[arg-type]
    ball.repair(progress=False)


def test_a_bar_is_shown_with_tqdm_and_without(ball: planish.Mesh, monkeypatch: pytest.MonkeyPatch) -> None:
    ball.repair(progress=True)
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    ball.repair(progress=True)


INTERRUPTED = """
import sys, tempfile, threading, time, signal, os
import numpy as np
import planish
planish.set_threads(1)
if sys.argv[2] == "fit":
    call = planish.virtual_scan(planish.demo_part(), points=60_000).fit
else:
    room = tempfile.TemporaryDirectory()
    scan = os.path.join(room.name, "scan.ply")
    planish.Cloud(np.random.default_rng(0).normal(size=(2_000_000, 3)).astype("f4")).write(scan)
    call = lambda: planish.Bricks.create(scan, os.path.join(room.name, "bricks"))
sent = []
def interrupt():
    time.sleep(float(sys.argv[1]))
    sent.extend([time.monotonic(), time.process_time()])
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt).start()
try:
    call()
except KeyboardInterrupt:
    print("stopped", time.monotonic() - sent[0], time.process_time() - sent[1])
"""


@pytest.mark.parametrize(("call", "after"), [("fit", "0.2"), ("fit", "0.8"), ("fit", "2.5"), ("bricks", "0.2"), ("bricks", "1.1")])
def test_ctrl_c_stops_a_call_within_200_ms(call: str, after: str) -> None:
    # The machine may be busy with other work: on one thread, the time that the process has computed is what it takes alone.
    least = 9.9
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", INTERRUPTED, after, call], capture_output=True, text=True)
        assert done.stdout.startswith("stopped"), done.stdout + done.stderr
        least = min(least, *map(float, done.stdout.split()[1:]))
        if least < 0.2:
            break
    assert least < 0.2


def test_other_threads_run_during_a_call(scan: planish.Cloud) -> None:
    ticks, over = [0], threading.Event()

    def tick() -> None:
        while not over.is_set():
            ticks[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    scan.clean()
    over.set()
    thread.join()
    assert ticks[0] > 20


def test_calls_at_once_on_one_object_give_what_one_call_gives(ball: planish.Mesh) -> None:
    points = np.random.default_rng(0).normal(size=(2_000, 3))
    wanted = ball.closest(points)["distance"]
    found: list[bool] = []
    fresh = planish.Mesh(ball.points, ball.triangles)
    threads = [
        threading.Thread(target=lambda: found.append(np.array_equal(fresh.closest(points)["distance"], wanted)))
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [True] * 8


def test_results_do_not_depend_on_the_number_of_threads(ball: planish.Mesh) -> None:
    def corners() -> bytes:
        return ball.layout(patches=24).corners.tobytes()

    try:
        planish.set_threads(1)
        one = corners()
        planish.set_threads(3)
        assert corners() == one
    finally:
        planish.set_threads(None)
    with pytest.raises(ValueError):
        planish.set_threads(0)


def test_a_call_costs_less_than_3_percent_of_cleaning_100_000_points() -> None:
    """Arrays in, a thread, arrays out: all that a call from Python adds to the stage."""
    rng = np.random.default_rng(0)
    points = rng.normal(size=(100_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points += 0.002 * rng.normal(size=points.shape)
    start = time.perf_counter()
    samples = planish.Cloud(points).clean()
    whole = time.perf_counter() - start

    def added() -> float:
        start = time.perf_counter()
        cloud = planish.Cloud(points)
        assert len(samples.points) and len(samples.normals) and cloud.points.shape == points.shape
        planish.sphere(1.0, 0).diagnose()
        return time.perf_counter() - start

    cost = min(added() for _ in range(5))
    print(f"{cost * 1e3:.2f} ms of {whole:.2f} s")
    assert cost < 0.03 * whole


def test_planish_is_imported_within_150_ms_and_without_numpy() -> None:
    code = "import sys, time; t = time.perf_counter(); import planish; print(time.perf_counter() - t, 'numpy' in sys.modules)"
    # The first one reads the files; the machine may be busy with other work.
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(4)]
    assert min(float(run.stdout.split()[0]) for run in runs) < 0.15
    assert runs[0].stdout.split()[1] == "False"


def test_errors_have_their_stage_a_hint_and_the_words_of_the_command_line(tmp_path: os.PathLike[str]) -> None:
    path = os.path.join(tmp_path, "none.ply")
    with pytest.raises(planish.FileError) as raised:
        planish.read(path)
    program = subprocess.run([sys.executable, "-m", "planish", "info", path], capture_output=True, text=True)
    assert program.returncode == 3 and program.stderr.strip() == f"error: {raised.value}"
    assert issubclass(planish.FileError, planish.Error)
    with pytest.raises(planish.Error) as raised_too:
        planish.Cloud([[0.0, 0, 0]] * 30).clean()
    assert isinstance(raised_too.value, planish.CloudError)
    assert raised_too.value.hint == "at least 18 are needed" or raised_too.value.hint is None


def test_an_interrupted_program_writes_nothing(tmp_path: os.PathLike[str]) -> None:
    folder = os.path.join(tmp_path, "out")
    process = subprocess.Popen([sys.executable, "-m", "planish", "demo", "-o", folder], stderr=subprocess.PIPE, text=True)
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=10)
    assert process.returncode == 130 and "interrupted; nothing was written" in told
    assert not os.path.exists(folder)
