"""Timing and progress reports of computations that consist of stages."""

import contextlib
import time
from collections.abc import Callable, Iterator

#: Called with the name of the stage that begins, the number of finished stages, and the number of stages.
Progress = Callable[[str, int, int], None]


class StageClock:
    """A timer for stages, which also reports progress.

    Parameters
    ----------
    n_stages : int
    progress : callable, optional
        Called at the start of each stage.
    """

    def __init__(self, n_stages: int, progress: Progress | None = None):
        self.n_stages, self.progress = n_stages, progress
        self.cpu_seconds: dict[str, float] = {}
        self.wall_seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure the block's processor time (of all threads) and wall-clock time, in seconds."""
        self._tell(name)
        cpu, wall = time.process_time(), time.perf_counter()
        yield
        self.cpu_seconds[name] = time.process_time() - cpu
        self.wall_seconds[name] = time.perf_counter() - wall

    def end(self) -> None:
        """Report that the last stage is finished."""
        self._tell("")

    def _tell(self, name: str) -> None:
        if self.progress is not None:
            self.progress(name, len(self.cpu_seconds), self.n_stages)
