"""The program: `planish` on the path, and `python -m planish`."""

import signal
import sys


def main() -> None:
    """Runs the program with the command line of this process and ends with its exit status."""
    from ._planish import main as program

    # Python's handler would wait for the interpreter, which waits for the program: the program has handlers of its own.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(program(["planish", *sys.argv[1:]], [sys.executable, "-m", "planish"]))


if __name__ == "__main__":
    main()
