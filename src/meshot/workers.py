"""Worker processes that end with the process that started them, however that ends."""

import multiprocessing
import os
import threading

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
