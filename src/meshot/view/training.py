"""Figures of a training: loss and validation metrics over the steps."""

import os
from collections.abc import Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from meshot.files import whole_file
from meshot.view.style.colours import BLUE, ORANGE, SKY, VERMILLION, WIDTH


def training_figure(log: Sequence[dict]) -> Figure:
    """The loss of every step with its running mean, and below it the validation: Dice, distances in mm, or the loss.

    Parameters
    ----------
    log : sequence of dict
        The log of a :class:`meshot.train.Training`.

    Raises
    ------
    ValueError
        If the log has no step.
    """
    steps = [line for line in log if "loss" in line]
    checks = [line for line in log if "validation_loss" in line]
    if not steps:
        raise ValueError("the log holds no step: nothing was trained yet")
    measured = set().union(*checks)
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(WIDTH, 6.4), layout="constrained", sharex=True)
    at, losses = np.array([line["step"] for line in steps]), np.array([line["loss"] for line in steps])
    width = max(1, len(at) // 30)
    upper.semilogy(at, losses, color=SKY, linewidth=0.6 if width > 1 else 2, label="one step")
    if width > 1:
        mean = np.convolve(losses, np.ones(width) / width, "valid")
        upper.semilogy(at[width - 1 :], mean, color=BLUE, label=f"mean of {width} steps")
    checked = [line["step"] for line in checks]
    upper.set(ylabel="loss")
    if "hausdorff90_mm" in measured:
        _distances(lower, checked, checks)
    elif "dice_left" in measured:
        upper.semilogy(checked, [line["validation_loss"] for line in checks], "o-", color=ORANGE, label="validation")
        upper.set(ylabel="cross-entropy + 1 − Dice")
        _overlap(lower, checked, checks)
    else:
        lower.plot(checked, [line["validation_loss"] for line in checks], "o-", color=ORANGE, label="validation")
        lower.set(ylabel="loss of the validation")
    _plain_ticks(upper)
    lower.set_xlabel("step")
    lower.xaxis.set_major_locator(MaxNLocator(integer=True))
    upper.legend()
    if checks:
        lower.legend()
    return figure


def _plain_ticks(axes: Axes) -> None:
    """Ticks of a logarithmic axis as plain numbers, also between the powers of ten where there are few of them."""
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 100 * low else (1,)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_locator(NullLocator())


def _overlap(axes: Axes, steps: list[int], checks: list[dict]) -> None:
    for side, colour, dashes in (("left", VERMILLION, "-"), ("right", BLUE, "--")):
        axes.plot(steps, [line[f"dice_{side}"] for line in checks], dashes, marker=".", color=colour, label=side)
    axes.set(ylabel="Dice on validation", ylim=(None, 1.0))


def _distances(axes: Axes, steps: list[int], checks: list[dict]) -> None:
    for key, name, colour, dashes in (
        ("hausdorff90_mm", "Hausdorff at 90 %", ORANGE, "--"), ("validation_loss", "ASSD", BLUE, "-"),
    ):  # fmt: skip
        axes.plot(steps, [line[key] for line in checks], dashes, marker=".", color=colour, label=name)
    axes.set(ylabel="on validation (mm)", ylim=(0, None))


def write_training_figure(path: str | os.PathLike, log: Sequence[dict]) -> None:
    """Write the picture of a log to a file, completely or not at all.

    Raises
    ------
    ValueError
        As :func:`meshot.view.training_figure`.
    """
    figure = training_figure(log)
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=120)
    plt.close(figure)
