"""Sorting as transport: a page on which a reader drags points and sees them paired, whole in itself, offline."""

from collections.abc import Sequence

import torch

from meshot.errors import as_floating
from meshot.types import Float, Tensor
from meshot.view import Page, live_page, still_of
from meshot_book.figures.lines.line import pairing_figure, pairs_of
from meshot_book.lines import monotone_plan


def sorting_player(
    source: Float[Tensor, " n"],
    target: Float[Tensor, " m"],
    description: str,
    source_masses: Float[Tensor, " n"] | None = None,
    target_masses: Float[Tensor, " m"] | None = None,
    exponents: Sequence[float] = (1, 1.5, 2, 3),
) -> Page:
    """Two rows of points to be dragged, the pairing redrawn at once with its cost, sorted or at random.

    A still picture comes first and stays where scripts may not run. Nothing moves unless the reader moves it. Every
    point can be dragged by mouse or finger, or moved by the arrow keys; up and down change its mass.

    Parameters
    ----------
    source, target : tensor
        Positions where the points start, between 0 and 10.
    description : str
        What is to be seen, for those who do not see it.
    source_masses, target_masses : tensor, optional
        Above zero, of any sum: what "unequal masses" starts from; equal if left out.
    exponents : sequence of float
        The choices of p, each at least 1; the page starts at 2 if it is one of them, else at the first.

    Raises
    ------
    ValueError
        If positions leave the row, masses do not fit, an exponent is below 1, or there is no description.
    """
    if not description.strip():
        raise ValueError("description is empty; say what is to be seen, for readers who do not see it")
    if not exponents or min(exponents) < 1:
        raise ValueError(f"exponents is {tuple(exponents)}; one or more numbers >= 1 are needed: below, sorting fails")
    places = {"source": _positions(source, "source"), "target": _positions(target, "target")}
    masses = {
        "source": _masses(source_masses, places["source"], "source_masses"),
        "target": _masses(target_masses, places["target"], "target_masses"),
    }
    data = {"range": [0, 10], "exponent": 2 if 2 in exponents else exponents[0]}
    data |= {name: values.tolist() for name, values in places.items()}
    data |= {f"{name}_masses": values.tolist() for name, values in masses.items()}
    n_points = len(places["source"]) + len(places["target"])
    return live_page(
        "meshot_book/figures/assets/sorting",
        data,
        f"SortingPlayer({n_points} points; run the cell to move them)",
        alt=description,
        still=_picture(places["source"], places["target"]),
        exponents=[(f"{p:g}", p == data["exponent"]) for p in exponents],
    )


def _positions(values: object, name: str) -> Tensor:
    values = as_floating(values, name).detach().cpu().double()
    if values.ndim != 1 or not len(values) or float(values.min()) < 0 or float(values.max()) > 10:
        raise ValueError(f"{name} has shape {tuple(values.shape)}; (n,) positions between 0 and 10 are needed")
    return values


def _masses(values: object | None, places: Tensor, name: str) -> Tensor:
    values = torch.ones_like(places) if values is None else as_floating(values, name).detach().cpu().double()
    if values.shape != places.shape or float(values.min()) <= 0:
        raise ValueError(f"{name} has shape {tuple(values.shape)}; {tuple(places.shape)} numbers > 0 are needed")
    return values


def _picture(source: Tensor, target: Tensor) -> str:
    """The optimal pairing of equal masses."""
    a, b = (torch.full_like(x, 1 / len(x)) for x in (source, target))
    plan = monotone_plan(source, a, target, b)
    figure = pairing_figure((source, a), (target, b), {"sorted": pairs_of(plan)})
    return still_of(figure)
