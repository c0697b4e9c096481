"""Planted errors that a reader chooses, small to large, with what each metric says: whole in itself, offline."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np

from meshot.mesh import Mesh
from meshot.view import Page, live_page, still_of
from meshot_book.figures.measures.planted import Window, round_length, sections_figure

SEEN = 2.0


@dataclasses.dataclass(frozen=True, eq=False)
class PlantedState:
    """One error of one size.

    Parameters
    ----------
    size : str
        In words, with its unit.
    mesh : Mesh
    values : sequence of str
        What each metric says, as it is to be read.
    ratios : sequence of float
        Each value over its yardstick; infinite where the yardstick is zero.
    """

    size: str
    mesh: Mesh
    values: Sequence[str]
    ratios: Sequence[float]


def planted_player(
    target: Mesh,
    errors: Mapping[str, tuple[Window, Sequence[PlantedState]]],
    metrics: Sequence[str],
    description: str,
    note: str,
) -> Page:
    """A page with a choice of errors, a slider for the size, a section through the surface and a bar for each metric.

    A bar is as long as the value over its yardstick, on a logarithmic scale from a tenth to a hundred times, and grey
    up to twice the yardstick. A still picture comes first and stays where scripts may not run.

    Parameters
    ----------
    target : Mesh
    errors : mapping
        By name: where to look, and the states in the order of the slider.
    metrics : sequence of str
    description : str
        What is to be seen, for those who do not see it.
    note : str
        Under the bars: what the yardstick is.

    Raises
    ------
    ValueError
        If there is no description, no error, or a state has not one value and one ratio for each metric.
    """
    if not description.strip():
        raise ValueError("description is empty; say what is to be seen, for readers who do not see it")
    if not errors or not all(states for _, states in errors.values()):
        raise ValueError("errors is empty, or one of them has no state; each needs at least one")
    for name, (_, states) in errors.items():
        if any(len(state.values) != len(metrics) or len(state.ratios) != len(metrics) for state in states):
            raise ValueError(f"{name!r} does not have one value and one ratio for each of {len(metrics)} metrics")
    listed = [_error(name, target, *error) for name, error in errors.items()]
    return live_page(
        "meshot_book/figures/assets/planted",
        {"metrics": list(metrics), "errors": listed, "seen": SEEN},
        f"PlantedPlayer({len(errors)} errors; run the cell to choose one)",
        alt=description,
        still=_picture(target, errors),
        names=list(errors),
        note=note,
    )


def _error(name: str, target: Mesh, window: Window, states: Sequence[PlantedState]) -> dict:
    listed = [
        {
            "size": state.size,
            "lines": _flat(window, state.mesh),
            "values": list(state.values),
            "ratios": [None if math.isinf(ratio) else float(f"{ratio:.3g}") for ratio in state.ratios],
        }
        for state in states
    ]
    frame = {"half": window.half, "bar": round_length(window.half)}
    return {"name": name} | frame | {"target": _flat(window, target), "states": listed}


def _flat(window: Window, mesh: Mesh) -> list[float]:
    """The segments as plain numbers in hundredths of the half window, cut off beyond twice of it."""
    places = np.clip(100 * window.lines(mesh) / window.half, -200, 200)
    return [round(float(x), 1) for x in places.reshape(-1)]


def _picture(target: Mesh, errors: Mapping[str, tuple[Window, Sequence[PlantedState]]]) -> str:
    panels = {name: (window, states[-1].mesh) for name, (window, states) in errors.items()}
    return still_of(sections_figure(panels, target))
