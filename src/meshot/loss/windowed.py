"""Sliced Wasserstein within windows: transport is compared near by, so that missing mass need not come from afar.

Our own addition: the paper transports everything at once.
"""

import math

import numpy as np
import torch

from meshot.errors import as_floating, require_positive_integer, require_shape
from meshot.loss.directions import Directions, quasi_directions
from meshot.loss.sliced import sliced_wasserstein
from meshot.measure import DiscreteMeasure, Measure, MeasureLike, as_point_measures
from meshot.types import Float, Tensor

#: Where a window ends, in radii: the Gaussian is down to a twentieth there.
REACH = 2.5


def windowed_sliced_wasserstein(
    source: MeasureLike,
    target: MeasureLike,
    centres: Float[Tensor, "K k"],
    radius: float,
    directions: Directions = 100,
    p: float = 2,
) -> Float[Tensor, ""]:
    """The mean over windows of SW_p^p between what two measures are inside them, each taken as a probability measure.

    A window is a Gaussian around a centre, cut at 2.5 radii. Probability measures of surfaces that differ in area here
    and there differ in mass everywhere, and transport carries the difference across the whole shape. Inside a window
    only what is missing *relative to its neighbourhood* has to travel, and not far. Zero between equal measures; not
    symmetric where the centres are drawn from one of the two.

    Parameters
    ----------
    source, target : measure of points, Mesh, Contour, array or tensor
        An (n, d) array or tensor stands for points of equal weight, a mesh for the barycentres of its faces, weighted
        by area.
    centres : tensor
        In the first k coordinates of the measures (three for a varifold: places, not normals).
    radius : float
        Standard deviation of the windows, in the units of the points.
    directions : tensor, array or int
        Unit rows, a set for every window: (K, L, d). Or L, how many even ones to take in each: those of
        :func:`meshot.quasi_directions`, of seed k in window k.
    p : float
        The exponent, at least 1.

    Returns
    -------
    tensor
        In (units of the points)^p. The gradient holds the windows still: it moves points and changes weights as if each
        point kept the share of it that a window sees, so that points are not driven out of windows.

    Raises
    ------
    ValueError
        If an argument is no measure of points, the shapes do not fit, the radius is no
        positive number, or no window holds mass of both measures.

    Examples
    --------
    >>> import numpy as np, torch, meshot
    >>> points = np.random.default_rng(0).normal(size=(50, 3))
    >>> centres = torch.zeros(1, 3, dtype=torch.float64)
    >>> round(float(meshot.windowed_sliced_wasserstein(points, points, centres, radius=1.0)), 9)
    0.0
    """
    source, target = as_point_measures(source, target)
    centres = as_floating(centres, "centres")
    require_shape(centres, "centres", None)
    n_windows, n_dimensions = centres.shape
    if n_dimensions > source.places.shape[1]:
        raise ValueError(
            f"centres has {n_dimensions} coordinates, the points {source.places.shape[1]}: at most as many are needed"
        )
    directions = _sets(directions, n_windows, source.places)
    if not 0 < radius < math.inf:
        raise ValueError(f"radius is {radius!r}; a finite number > 0 is needed, in the units of the points")
    costs = []
    for centre, lines in zip(centres, directions, strict=True):
        inside = _restricted(source, centre, radius), _restricted(target, centre, radius)
        if None not in inside:
            costs.append(sliced_wasserstein(*inside, lines, p))
    if not costs:
        raise ValueError(
            f"none of {n_windows} windows of radius {radius:g} holds mass of both measures: they may lie in different "
            "places, or take a larger radius"
        )
    return torch.stack(costs).mean()


def _sets(directions: Directions, n_windows: int, like: Tensor) -> Float[Tensor, "K L d"]:
    """A set of directions for every window."""
    d = like.shape[1]
    if isinstance(directions, int | np.integer):
        n = require_positive_integer(directions, "directions")
        sets = [quasi_directions(n, d, seed, like.dtype, like.device) for seed in range(n_windows)]
        return torch.stack(sets)
    directions = as_floating(directions, "directions")
    if directions.ndim != 3 or len(directions) != n_windows:
        raise ValueError(
            f"directions has shape {tuple(directions.shape)}; ({n_windows}, L, {d}) is needed, a set for every window, "
            "or a number"
        )
    return directions


def _restricted(measure: Measure, centre: Float[Tensor, " k"], radius: float) -> DiscreteMeasure | None:
    """What a window sees of a measure, as a probability measure; None if that is nothing."""
    places = measure.places.detach()[:, : len(centre)]
    squared = ((places - centre) ** 2).sum(dim=1)
    (inside,) = torch.nonzero(squared < (REACH * radius) ** 2, as_tuple=True)
    weights = measure.weights[inside] * torch.exp(-squared[inside] / (2 * radius**2))
    total = weights.sum()
    if not float(total.detach()) > 0:
        return None
    return DiscreteMeasure(measure.places[inside], weights / total)
