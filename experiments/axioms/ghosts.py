"""Pairs of different measures that have equal projections along finitely many given directions."""

import itertools

import numpy as np
import torch

from meshot import DiscreteMeasure, quasi_directions, random_directions, sliced_wasserstein, wasserstein


def ghost_pair(shifts: np.ndarray) -> tuple[DiscreteMeasure, DiscreteMeasure]:
    """The sums of an even, and of an odd, number of the ``shifts`` (L, d): 2^(L−1) points each.

    Along a direction perpendicular to a shift, adding this shift does not change the projection. It pairs the points of
    one measure with those of the other, so that both have the same projection.
    """
    chosen = np.array(list(itertools.product([0, 1], repeat=len(shifts))))
    points, odd = chosen @ shifts, chosen.sum(axis=1) % 2 == 1
    return DiscreteMeasure(torch.from_numpy(points[~odd])), DiscreteMeasure(torch.from_numpy(points[odd]))


def measured(n: int, d: int, seed: int) -> dict:
    """SW₂ of such a pair over the given directions and over many others, and its W₂."""
    directions = random_directions(n, d, seed)
    helpers = random_directions(n, d, seed + 1)
    shifts = helpers - (helpers * directions).sum(dim=1, keepdim=True) * directions
    pair = ghost_pair((shifts / shifts.norm(dim=1, keepdim=True)).numpy())
    return {
        "d": d,
        "n_directions": n,
        "n_points": len(pair[0].points),
        "own": float(sliced_wasserstein(*pair, directions)) ** 0.5,
        "others": float(sliced_wasserstein(*pair, quasi_directions(1000, d))) ** 0.5,
        "w2": float(wasserstein(*pair)) ** 0.5,
    }
