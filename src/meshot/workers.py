"""Worker processes that end with the process that started them, however that ends."""

import multiprocessing
import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import torch


def begin_worker() -> None:
    """Use one thread of torch, and end when the process that started this one has ended; for a pool's ``initializer``.

    A process that is killed cannot stop its workers, and these would wait for work for ever.
    """
    torch.set_num_threads(1)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(parent: multiprocessing.process.BaseProcess) -> None:
    parent.join()
    os._exit(1)


# Division of work into chunks, one per thread, for kernels that release the GIL.

Result = TypeVar("Result")


def in_chunks(
    work: Callable[[int, int], Result], n_items: int, smallest: int = 1, n_threads: int | None = None
) -> list[Result]:
    """The results of ``work(start, stop)`` on contiguous chunks that cover ``range(n_items)``, in order."""
    # There are ``n_threads`` chunks, by default ``torch.get_num_threads()``, or fewer so that each has at least
    # ``smallest`` items. The number depends on nothing else. Sums over chunks are therefore the same in every run with
    # the same number of threads.
    n_chunks = max(1, min(n_threads or torch.get_num_threads(), n_items // smallest))
    bounds = [n_items * i // n_chunks for i in range(n_chunks + 1)]
    if n_chunks == 1:
        return [work(0, n_items)]
    with ThreadPoolExecutor(n_chunks) as pool:
        return list(pool.map(work, bounds[:-1], bounds[1:]))
