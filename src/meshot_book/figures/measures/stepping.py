"""What the number of steps does to a flow: how far it is from the exact one, and from where it should lead."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from meshot.view import BLUE, GREY, ORANGE, VERMILLION, WIDTH


def step_errors_figure(
    n_steps: Sequence[int],
    from_exact: Mapping[str, Sequence[float]],
    from_target: Sequence[float],
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """Above, on logarithmic axes, the distance from the exact flow; below, the distance from the target.

    Parameters
    ----------
    n_steps : sequence of int
    from_exact : mapping
        Name → for each number of steps how far vertices are from where the exact flow takes them, in mm.
    from_target : sequence of float
        ASSD for each number of steps, in mm.
    marks : mapping, optional
        Heights to mark in the lower panel by a thin line, by what they are.

    Raises
    ------
    ValueError
        If there are not as many values as numbers of steps.
    """
    for name, values in (*from_exact.items(), ("from_target", from_target)):
        if len(values) != len(n_steps):
            raise ValueError(f"{name} has {len(values)} values for {len(n_steps)} numbers of steps; one each is needed")
    figure, (upper, lower) = plt.subplots(2, 1, figsize=(WIDTH, 6.4), layout="constrained", sharex=True)
    for (name, values), colour, marker in zip(from_exact.items(), (BLUE, VERMILLION, ORANGE), "os^", strict=False):
        upper.loglog(n_steps, values, marker + "-", color=colour, label=name)
    upper.set(ylabel="from the exact flow (mm)")
    upper.legend()
    lower.semilogx(n_steps, from_target, "o-", color=BLUE, label="after the flow")
    for (name, height), dashes in zip((marks or {}).items(), ("--", ":", "-."), strict=False):
        lower.axhline(height, color=GREY, linestyle=dashes, linewidth=2, label=name)
    lower.set(xlabel="steps", ylabel="ASSD from the target (mm)", ylim=(0, None))
    lower.legend()
    for ax in (upper, lower):
        ax.set_xticks(list(n_steps))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    return figure
