"""Slow twins of the exact sliced loss: laws summed cell by cell, quantile functions inverted, then quadrature."""

import itertools

import numpy as np

NODES, WEIGHTS = np.polynomial.legendre.leggauss(40)


def share_below(places, corners, weights, x):
    """F(x): the mass of projected triangles or segments at or below each x, one cell after the other."""
    total = np.zeros_like(x)
    for cell, weight in zip(np.sort(places[corners], axis=1), weights, strict=True):
        low, high, middle = cell[0], cell[-1], cell[len(cell) // 2] if len(cell) == 3 else None
        if low == high:
            total += weight * (x >= low)
        elif middle is None:
            total += weight * np.clip((x - low) / (high - low), 0, 1)
        else:
            rising = np.square(np.clip(x, low, middle) - low) / ((middle - low) * (high - low)) if middle > low else 0
            falling = (
                np.square(high - np.clip(x, middle, high)) / ((high - middle) * (high - low)) if high > middle else 0
            )
            total += weight * np.where(x < middle, rising, 1 - falling)
    return total


def breakpoints(places, corners, weights):
    """The ends of the intervals on which F is quadratic, and F at them and at the midpoints between."""
    x = np.unique(places[corners])
    if len(x) == 1:
        x = np.append(x, x + 1)  # an interval to point at, without mass
    before = share_below(places, corners, weights, np.nextafter(x, -np.inf))
    at = share_below(places, corners, weights, x)
    return x, before, at, share_below(places, corners, weights, (x[1:] + x[:-1]) / 2)


def quantile(law, z):
    """F⁻¹(z) by the quadratic through F at the two ends and the midpoint of the interval that holds z."""
    x, before, at, middle = law
    k = np.clip(np.searchsorted(at, z) - 1, 0, len(x) - 2)
    f0, f1, fm = at[k], before[k + 1], middle[k]
    a, b = 2 * (f1 + f0 - 2 * fm), 4 * fm - f1 - 3 * f0  # F = f0 + b u + a u², u from 0 to 1
    rest = np.clip(z - f0, 0, f1 - f0)
    with np.errstate(invalid="ignore", divide="ignore"):
        u = 2 * rest / (b + np.sqrt(np.maximum(b * b + 4 * a * rest, 0)))
    inside = x[k] + np.where(z < f1, np.clip(u, 0, 1), 1) * (x[k + 1] - x[k])
    return np.where(z <= at[0], x[0], inside)


def squared_cost(source, target):
    """W₂² of two laws (places, corners, weights) by Gauss–Legendre between merged quantile breakpoints.

    Where a density is zero the quantile function is a square root: z = c + h·u²(3 − 2u) makes it smooth, and the
    intervals are halved toward both ends, where a density may be nearly zero.
    """
    laws = breakpoints(*source), breakpoints(*target)
    ends = np.unique(np.concatenate([np.clip(f, 0, 1) for law in laws for f in (law[1], law[2], [0.0, 1.0])]))
    toward = 2.0 ** -np.arange(1, 12)
    cuts = np.concatenate([[0], toward[::-1], (1 - toward)[1:], [1]])
    total = 0.0
    for start, stop in itertools.pairwise(ends):
        for low, high in itertools.pairwise(cuts):
            u = low + (high - low) * (NODES + 1) / 2
            z = start + (stop - start) * u * u * (3 - 2 * u)
            dz = (stop - start) * 6 * u * (1 - u) * (high - low) * WEIGHTS / 2
            total += float((np.square(quantile(laws[0], z) - quantile(laws[1], z)) * dz).sum())
    return total


def absolute_cost(source, target):
    """W₁ = ∫|F − G| dx: between merged breakpoints F − G is a quadratic, cut at its roots and integrated by Simpson."""
    ends = np.unique(np.concatenate([source[0][source[1]].ravel(), target[0][target[1]].ravel()]))
    total = 0.0
    for low, high in itertools.pairwise(ends):
        u = np.array([0.25, 0.5, 0.75])
        inner = low + (high - low) * u
        gaps = share_below(*source, inner) - share_below(*target, inner)
        difference = np.polynomial.Polynomial.fit(u, gaps, 2, domain=[0, 1])
        roots = difference.trim(1e-13).roots()  # a leading coefficient of roundoff would spoil the other root
        cuts = np.sort([0, 1, *(root.real for root in roots if abs(root.imag) < 1e-12 and 0 < root.real < 1)])
        for a, b in itertools.pairwise(cuts):
            sixth = difference(a) + 4 * difference((a + b) / 2) + difference(b)
            total += (high - low) * (b - a) * abs(sixth) / 6
    return float(total)


def sliced_cost(source, target, directions, p):
    """The mean over directions for two measures with ``vertices``, ``cells`` and ``weights``."""
    cost = {1: absolute_cost, 2: squared_cost}[p]
    costs = []
    for theta in directions.numpy():
        sides = [(m.vertices.numpy() @ theta, m.cells.numpy(), m.weights.numpy()) for m in (source, target)]
        costs.append(cost(*sides))
    return float(np.mean(costs))
