"""The distribution of a projected surface on a line, accurate to roundoff for any orientation of the faces.

A triangle of mass w with projections p₁ ≤ p₂ ≤ p₃ has a tent-shaped density. It rises linearly from p₁ to the value
J = 2w/(p₃ − p₁) at p₂ and falls linearly to p₃, in proportion to the length of the triangle's sections. A segment has a
constant density. The sum over all triangles is linear between neighbouring breakpoints. A cell of the distribution
therefore has a start, an extent, a mass, and a relative change of density a = (f₁ − f₀)/(f₁ + f₀) in [−1, 1].

Pieces of small slope are added as jumps of slope and density, which are summed from left to right, in O(1) per corner.
A face nearly perpendicular to the direction has the slope w/h² with h → 0, and such sums would keep its rounding error.
Pieces of large slope are instead added to O(log V) nodes of a binary tree over the intervals, as densities at both
ends, and passed down to the leaves. These are sums of positive numbers, accurate to a few units in the last place.
"""

from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel

_inner = INNER | {"error_model": "numpy", "forceinline": True}
_GENTLE = 16.0  # largest slope of the pieces that are summed from left to right, in units of mass/extent²


@njit(**_inner)
@no_type_check
def _three_in_order(i, j, k):
    """Three ranks in ascending order."""
    if i > j:
        i, j = j, i
    if j > k:
        j, k = k, j
    if i > j:
        i, j = j, i
    return i, j, k


@njit(**_inner)
@no_type_check
def _spread(tree, size, x, first, last, base, slope, centre):
    """Add the density base + slope · (x − centre) on the intervals [first, last) to the nodes that cover them."""
    low, high, width = first + size, last + size, 1
    while low < high:
        if low & 1:
            tree[low, 0] += base + slope * (x[first] - centre)
            first += width
            tree[low, 1] += base + slope * (x[first] - centre)
            low += 1
        if high & 1:
            high -= 1
            tree[high, 1] += base + slope * (x[last] - centre)
            last -= width
            tree[high, 0] += base + slope * (x[last] - centre)
        low >>= 1
        high >>= 1
        width <<= 1


@njit(**_inner)
@no_type_check
def _push_down(tree, size, x, n):
    """Add the densities of every node to its two children, down to the leaves."""
    width = size
    while width > 1:
        half = width >> 1
        node = size // width
        for start in range(0, n, width):
            if start + width <= n:
                low, middle, high = x[start], x[start + half], x[start + width]
                share = (middle - low) / (high - low) if high > low else 0.5
                between = tree[node, 0] * (1 - share) + tree[node, 1] * share
                tree[2 * node, 0] += tree[node, 0]
                tree[2 * node, 1] += between
                tree[2 * node + 1, 0] += between
                tree[2 * node + 1, 1] += tree[node, 1]
            node += 1
        width = half


@njit(**_inner)
@no_type_check
def _on_grid(slope, grid):
    """The slope rounded to the last place of ``grid``. Sums of such slopes are exact while they stay below ``grid``."""
    return (slope + grid) - grid


@njit(**_inner)
@no_type_check
def _lay_triangles(tree, size, x, rank, cells, weights, mass, jumps, limit):
    grid = 4 * limit
    for k in range(len(cells)):
        i, j, m = _three_in_order(rank[cells[k, 0]], rank[cells[k, 1]], rank[cells[k, 2]])
        up, down, height = x[j] - x[i], x[m] - x[j], x[m] - x[i]
        if height == 0:
            mass[i] += weights[k]
            continue
        peak = 2 * weights[k] / height
        if peak == 0:  # no mass: with two coincident corners the slope would be 0/0
            continue
        if peak <= limit * up and peak <= limit * down:
            rise, fall = _on_grid(peak / up, grid), _on_grid(peak / down, grid)
            jumps[i, 0] += rise
            jumps[j, 0] -= rise + fall
            jumps[m, 0] += fall
            jumps[m, 1] += fall * down - rise * up
            continue
        if peak <= limit * up:
            rise = _on_grid(peak / up, grid)
            jumps[i, 0] += rise
            jumps[j, 0] -= rise
            jumps[j, 1] -= rise * up
        elif up > 0:
            _spread(tree, size, x, i, j, 0.0, peak / up, x[i])
        if peak <= limit * down:
            fall = _on_grid(peak / down, grid)
            jumps[j, 1] += fall * down
            jumps[j, 0] -= fall
            jumps[m, 0] += fall
        elif down > 0:
            _spread(tree, size, x, j, m, 0.0, -peak / down, x[m])


@njit(**_inner)
@no_type_check
def _lay_segments(tree, size, x, rank, cells, weights, mass):
    for k in range(len(cells)):
        i, j = rank[cells[k, 0]], rank[cells[k, 1]]
        i, j = min(i, j), max(i, j)
        if x[j] > x[i]:
            _spread(tree, size, x, i, j, weights[k] / (x[j] - x[i]), 0.0, 0.0)
        else:
            mass[i] += weights[k]


@njit(**_inner)
@no_type_check
def _add(total, lost, term):
    """Kahan summation: the new total, and its excess over the exact one."""
    term -= lost
    larger = total + term
    return larger, (larger - total) - term


@njit(**_inner)
@no_type_check
def _place(projected, order, rank, x):
    """Sort the projections, store the rank of each, and return the extent of the distribution."""
    n = len(projected) - 1
    tiny = 1e-100 * max(abs(projected[order[0]]), abs(projected[order[n]]))  # keeps w/h² finite
    for i in range(n + 1):
        place = projected[order[i]]
        x[i] = place if abs(place) > tiny else 0.0
        rank[order[i]] = i
    return x[n] - x[0]


@njit(**_inner)
@no_type_check
def _share(mass):
    """Divide masses by their sum; raise an error if the sum is NaN, infinite or zero."""
    total = mass.sum()
    if not (total > 0 and total < np.inf):
        raise ValueError(
            "the law of a projected measure has a mass that is NaN, infinite or zero; the coordinates are too large or "
            "too small for float64: scale both measures to a size of about 1"
        )
    for i in range(len(mass)):
        mass[i] /= total


@kernel("the exact sliced loss", 15, error_model="numpy")
@no_type_check
def lay_surface(projected, order, cells, weights, rank, tree, jumps, x, extent, mass, change):
    """Write the cells of the distribution of a projected surface: one per interval between neighbouring vertices.

    A face perpendicular to the direction becomes an atom: mass on the first interval of zero extent between its
    corners. The last cell is a sentinel, which takes all mass that is left over by rounding.
    """
    n, size = len(projected) - 1, len(tree) // 2
    length = _place(projected, order, rank, x)
    tree[:], jumps[:], mass[:] = 0, 0, 0
    if cells.shape[1] == 3:
        limit = _GENTLE / (length * length) if length > 0 else 0.0
        _lay_triangles(tree, size, x, rank, cells, weights, mass, jumps, limit)
    else:
        _lay_segments(tree, size, x, rank, cells, weights, mass)
    _push_down(tree, size, x, n)
    slope, density, lost = 0.0, 0.0, 0.0
    for i in range(n):
        extent[i] = x[i + 1] - x[i]
        slope += jumps[i, 0]
        density, lost = _add(density, lost, jumps[i, 1])
        start = max(tree[size + i, 0] + density, 0.0)
        density, lost = _add(density, lost, slope * extent[i])
        end = max(tree[size + i, 1] + density, 0.0)
        mass[i] += (start + end) / 2 * extent[i]
        change[i] = (end - start) / (end + start) if extent[i] > 0 and end + start > 0 else 0.0
    _share(mass[:n])
    extent[n], mass[n], change[n] = 0.0, np.inf, 0.0


@kernel("the exact sliced loss", 15, error_model="numpy")
@no_type_check
def lay_points(projected, order, weights, x, extent, mass, change):
    """Write the cells of the distribution of projected points: atoms, each followed by a gap, and the sentinel."""
    n = len(projected)
    mass[:] = 0
    change[:] = 0
    extent[:] = 0
    for i in range(n):
        x[2 * i] = x[2 * i + 1] = projected[order[i]]
        mass[2 * i] = weights[order[i]]
        extent[2 * i + 1] = projected[order[min(i + 1, n - 1)]] - projected[order[i]]
    _share(mass[: 2 * n])
    x[2 * n], mass[2 * n] = x[2 * n - 1], np.inf
