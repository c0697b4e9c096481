"""What the number of steps does to a flow: how far it is from the exact one, and from where it should lead."""

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, NullLocator

from meshot.view.style import BLUE, GREY, ORANGE, VERMILLION, WIDTH


def step_errors_figure(
    n_steps: Sequence[int],
    from_exact: Mapping[str, Sequence[float]],
    from_target: Sequence[float],
    marks: Mapping[str, float] | None = None,
) -> Figure:
    """Left, on logarithmic axes, the distance from the exact flow; right the distance from the target.

    Parameters
    ----------
    n_steps : sequence of int
    from_exact : mapping
        Name → for each number of steps how far vertices are from where the exact flow takes them, in mm.
    from_target : sequence of float
        ASSD for each number of steps, in mm.
    marks : mapping, optional
        Heights to mark on the right by a thin line, by what they are.

    Raises
    ------
    ValueError
        If there are not as many values as numbers of steps.
    """
    for name, values in (*from_exact.items(), ("from_target", from_target)):
        if len(values) != len(n_steps):
            raise ValueError(f"{name} has {len(values)} values for {len(n_steps)} numbers of steps; one each is needed")
    figure, (left, right) = plt.subplots(1, 2, figsize=(1.25 * WIDTH, 3.4), layout="constrained")
    for (name, values), colour, marker in zip(from_exact.items(), (BLUE, VERMILLION, ORANGE), "os^", strict=False):
        left.loglog(n_steps, values, marker + "-", color=colour, label=name)
    left.set(xlabel="steps", ylabel="from the exact flow (mm)")
    left.legend()
    right.semilogx(n_steps, from_target, "o-", color=BLUE, label="after the flow")
    for (name, height), dashes in zip((marks or {}).items(), ("--", ":", "-."), strict=False):
        right.axhline(height, color=GREY, linestyle=dashes, linewidth=1.4, label=name)
    right.set(xlabel="steps", ylabel="ASSD from the target (mm)", ylim=(0, None))
    right.legend()
    for ax in (left, right):
        ax.set_xticks(list(n_steps))
        ax.xaxis.set_minor_locator(NullLocator())
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    return figure
