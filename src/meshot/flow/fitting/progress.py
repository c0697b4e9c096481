"""A bar that shows how far a fit has come."""

import contextlib
from collections.abc import Callable, Iterator

from tqdm import tqdm

from meshot.flow.fitting.settings import FitSettings


@contextlib.contextmanager
def fit_progress(
    settings: FitSettings, description: str = "fit", disable: bool = False
) -> Iterator[Callable[[int, float], None]]:
    """A ``progress`` for :func:`meshot.flow.fitting.fit_flow`: a bar with the loss, on standard error, or none."""
    with tqdm(total=settings.n_iterations, desc=description, disable=disable) as bar:

        def report(done: int, loss: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{loss:.4g}")

        yield report
