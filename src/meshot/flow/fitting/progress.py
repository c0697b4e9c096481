"""A progress bar for fits."""

import contextlib
from collections.abc import Callable, Iterator

from tqdm import tqdm

from meshot.flow.fitting.settings import FitSettings


@contextlib.contextmanager
def fit_progress(
    settings: FitSettings, description: str = "fit", disable: bool = False
) -> Iterator[Callable[[int, float], None]]:
    """Yield a ``progress`` callback for :func:`meshot.flow.fitting.fit_flow`.

    It shows a bar with the loss on standard error, unless ``disable`` is true.
    """
    with tqdm(total=settings.n_iterations, desc=description, disable=disable) as bar:

        def report(done: int, loss: float) -> None:
            bar.update(done - bar.n)
            bar.set_postfix(loss=f"{loss:.4g}")

        yield report
