"""Work in stages: how long each takes, and a word to whoever waits."""

import contextlib
import time
from collections.abc import Callable, Iterator

#: Is told which stage begins, how many are done, and how many there are.
Progress = Callable[[str, int, int], None]


class StageClock:
    """Seconds of each stage, in the order in which they were begun.

    Parameters
    ----------
    n_stages : int
    progress : callable, optional
        Called as each stage begins.
    """

    def __init__(self, n_stages: int, progress: Progress | None = None):
        self.n_stages, self.progress = n_stages, progress
        self.cpu_seconds: dict[str, float] = {}
        self.wall_seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time what happens in the block: processor time of all threads, and time by the clock."""
        self._tell(name)
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        self.cpu_seconds[name] = time.process_time() - cpu
        self.wall_seconds[name] = time.perf_counter() - wall

    def end(self) -> None:
        """Say that the last stage is done."""
        self._tell("")

    def _tell(self, name: str) -> None:
        if self.progress is not None:
            self.progress(name, len(self.cpu_seconds), self.n_stages)
