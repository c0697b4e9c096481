"""The option ``--device``: a device that can compute here, and clear words if it cannot or fails later."""

import argparse
import contextlib
import re
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # for annotations only: importing torch would delay --help
    import torch


def device_of(chosen: argparse.Namespace) -> "torch.device | None":
    """The device given by ``--device``, or None if the option was not given.

    Raises
    ------
    ValueError
        If torch does not know the device, or it cannot compute here.
    """
    import torch

    if chosen.device is None:
        return None
    try:
        device = torch.device(chosen.device)
        works = device.type != "meta" and float(torch.ones(1, device=device).cpu()) == 1
    except (RuntimeError, AssertionError, ImportError) as error:
        raise ValueError(_refusal(chosen.device, re.split(r"\n|\. ", str(error))[0])) from error
    if not works:
        raise ValueError(_refusal(chosen.device, "it holds no numbers"))
    return device


def _refusal(name: str, reason: str) -> str:
    import torch

    gpus = [f"cuda:{index}" for index in range(torch.cuda.device_count())] if torch.cuda.is_available() else []
    short = reason if len(reason) <= 200 else f"{reason[:200].rpartition(' ')[0]} ..."
    return f"--device {name}: PyTorch cannot compute there ({short}); use {' or '.join(['cpu', *gpus])}"


@contextlib.contextmanager
def device_errors() -> Iterator[None]:
    """Within the block, a failure of a GPU becomes a ValueError that says what to do.

    Raises
    ------
    ValueError
        If the memory of a GPU is full, or a GPU reports an error.
    """
    import torch

    try:
        yield
    except torch.OutOfMemoryError as error:
        raise ValueError(
            f"the memory of the GPU is full ({str(error).partition('. ')[0]}); end other programs on it, use fewer "
            "--jobs, or use --device cpu"
        ) from error
    except torch.AcceleratorError as error:
        first = str(error).partition("\n")[0]
        raise ValueError(f"the GPU reports an error ({first}); try once more, or use --device cpu") from error
