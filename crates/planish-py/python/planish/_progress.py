"""The bar of `progress=True`: tqdm's where it is installed, in terminals and notebooks, else a line on stderr."""

import sys
from typing import Any


class Bar:
    """Called with the name of the running stage and the share (0 to 1) that is done."""

    def __init__(self) -> None:
        self._bar: Any = None
        self._width = 0
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(total=100.0, bar_format="{desc:>9} {bar} {percentage:3.0f} % {elapsed}<{remaining}")

    def __call__(self, stage: str, share: float) -> None:
        if self._bar is not None:
            self._bar.set_description_str(stage, refresh=False)
            self._bar.n = 100.0 * share
            self._bar.refresh()
        elif sys.stderr is not None and sys.stderr.isatty():
            line = f"\r{stage:>9} {100 * share:3.0f} %"
            self._width = max(self._width, len(line))
            sys.stderr.write(line)
            sys.stderr.flush()

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
        elif self._width:
            sys.stderr.write("\r" + " " * self._width + "\r")
