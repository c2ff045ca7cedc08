"""Progress of a run: a bar of tqdm if it is installed, else a line on the standard error output."""

from __future__ import annotations

import sys
import time
from typing import Any

# Shorter runs show nothing.
DELAY = 0.5


class Progress:
    """Shows how far a run has come from `start` to `until`; silent where nobody looks."""

    def __init__(self, start: float, until: float, wanted: bool) -> None:
        is_seen = "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())
        self.shows = wanted and is_seen and until > start
        self.start, self.until, self.at = start, until, start
        self.begin = time.monotonic()
        self.bar: Any = None
        self.has_line = False

    def __enter__(self) -> Progress:
        if self.shows:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return self
            layout = "{percentage:3.0f}%|{bar}| t = {n:.4g} of {total:.4g} [{elapsed}<{remaining}]"
            self.bar = tqdm(total=self.until, initial=self.start, delay=DELAY, bar_format=layout, leave=False)
        return self

    def update(self, at: float) -> None:
        """Shows that the run has come to the time `at`."""
        if self.bar is not None:
            self.bar.update(at - self.at)
        elif self.shows and time.monotonic() - self.begin > DELAY:
            share = (at - self.start) / (self.until - self.start)
            print(f"\rt = {at:.4g} of {self.until:.4g} ({share:.0%}) ", end="", file=sys.stderr, flush=True)
            self.has_line = True
        self.at = at

    def __exit__(self, *_: object) -> None:
        if self.bar is not None:
            self.bar.close()
        elif self.has_line:
            print(file=sys.stderr)
