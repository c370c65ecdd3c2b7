"""What a person at a terminal sees: bars that come and go, and Ctrl-C."""

import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from fcntl import ioctl

import pytest
from conftest import PLANISH

# A bar of the stage `layout` that is under way.
BAR = re.compile(rb"layout .*?\d+ %")


class Terminal:
    """The program under a pseudo-terminal of 100 columns, of which it is the only user."""

    def __init__(self, *arguments, cwd):
        self.ours, theirs = pty.openpty()
        ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))

        def own_it():
            os.setsid()
            ioctl(0, termios.TIOCSCTTY, 0)

        self.process = subprocess.Popen(
            [str(PLANISH), *map(str, arguments)],
            cwd=cwd, stdin=theirs, stdout=theirs, stderr=theirs, preexec_fn=own_it, env={**os.environ, "TERM": "xterm"},
        )
        os.close(theirs)
        self.seen = b""

    def read(self, seconds, until=None):
        """Reads until the pattern is seen (true), or the program ends or the time is over (false)."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            if until and until.search(self.seen):
                return True
            if select.select([self.ours], [], [], 0.05)[0]:
                try:
                    self.seen += os.read(self.ours, 65536)
                except OSError:  # the other end is closed
                    return False
        return False

    def close(self):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        os.close(self.ours)


@pytest.fixture
def terminal(request):
    started = []

    def start(*arguments, cwd):
        started.append(Terminal(*arguments, cwd=cwd))
        return started[-1]

    yield start
    for one in started:
        one.close()


def test_bars_show_the_stage_and_are_gone_at_the_end(terminal, tmp_path):
    run = terminal("demo", "-o", "out", "--points", 15000, cwd=tmp_path)
    assert run.read(120, BAR), run.seen
    run.read(240)
    assert run.process.wait() == 0
    # Every bar is cleared before the table, and the table has none.
    table = run.seen.split(b"products")[0].rsplit(b"\x1b[", 1)[-1]
    assert b"surface, RMS" in table and b" %" not in table.split(b"input")[0]
    assert (tmp_path / "out" / "report.html").exists()


def test_quiet_shows_nothing(terminal, tmp_path):
    run = terminal("demo", "-q", "-o", "out", "--points", 8000, cwd=tmp_path)
    run.read(240)
    assert run.process.wait() == 0 and run.seen == b""


def test_ctrl_c_at_the_keyboard_ends_within_1_s_and_leaves_nothing(terminal, tmp_path):
    run = terminal("demo", "-o", "out", "--points", 60000, cwd=tmp_path)
    assert run.read(120, BAR), run.seen
    pressed = time.monotonic()
    os.write(run.ours, b"\x03")
    run.read(5)
    assert run.process.wait(timeout=5) == 130
    # The promise is 1 s; half a second more for a machine that is busy otherwise.
    assert time.monotonic() - pressed < 1.5
    assert not list(tmp_path.iterdir())
    assert b"\x1b[?25l" not in run.seen or b"\x1b[?25h" in run.seen, "the cursor comes back"
