"""The gradient of 1D transport between projected measures, from moments of the potential's slope over the cells.

Let φ be the optimal potential. Moving a projected vertex changes the cost at the rate w·E[bφ′] for each triangle of
mass w at it, where b is the barycentric weight of the vertex and E the mean over the triangle. Changing the mass of a
triangle by dw changes the cost by E[φ] dw. On the rising piece let u go from 0 to 1 between p₁ and p₂. The density is
J·u (J = 2/(p₃ − p₁) at mass one), and the section at u connects the point u on the edge p₁p₂ with the point u·h₁/H on
the edge p₁p₃. The means of b over the section are therefore linear in u. The falling piece is analogous, with v from 0
to 1 between p₃ and p₂. So only M₁ = ∫φ′u dx and M₂ = ∫φ′u² dx over both pieces are needed. By integration by parts,
E[φ] = φ(p₂) + (J/2)(h₂·M₂(v) − h₁·M₂(u)).

Differences of antiderivatives of φ would lose precision on short pieces, by a factor of 1/h² or 1/h³. The moments are
taken from a disjoint sparse table instead. At the highest binary digit in which the first and the last interval of a
piece differ, there is a multiple of that power of two between them, called the pivot. Moments are summed outwards from
all such pivots. Two entries then give the moments of the piece, and no sum extends beyond it. One level of the table
is stored at a time.
"""

import math
from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel

_inner = INNER | {"error_model": "numpy", "forceinline": True}


@njit(**_inner)
@no_type_check
def _split(x, rank, cells, ends):
    """Write the first and last rank of both pieces of every cell: rising and falling, or the single piece twice."""
    for k in range(len(cells)):
        low, high = rank[cells[k, 0]], rank[cells[k, 1]]
        low, high = min(low, high), max(low, high)
        middle = high
        if cells.shape[1] == 3:
            other = rank[cells[k, 2]]
            low, middle, high = min(low, other), max(low, min(high, other)), max(high, other)
        ends[2 * k, 0], ends[2 * k, 1] = low, middle
        ends[2 * k + 1, 0], ends[2 * k + 1, 1] = (low, high) if cells.shape[1] == 2 else (middle, high)


@njit(**_inner)
@no_type_check
def _level(first, last):
    """The number of binary digits up to the highest one in which the first and the last interval differ."""
    return math.frexp(float(first ^ (last - 1)))[1]


@njit(**_inner)
@no_type_check
def _by_level(x, ends, order, starts, longest):
    """Sort the pieces of positive extent by level (counting sort); find the longest of each level, in intervals."""
    starts[:] = 0
    longest[:] = 0
    for piece in range(len(ends)):
        first, last = ends[piece]
        if x[last] > x[first]:
            level = _level(first, last)
            starts[level + 2] += 1
            longest[level] = max(longest[level], last - first)
    for level in range(len(starts) - 1):
        starts[level + 1] += starts[level]
    for piece in range(len(ends)):
        first, last = ends[piece]
        if x[last] > x[first]:
            level = _level(first, last)
            order[starts[level + 1]] = piece
            starts[level + 1] += 1


@njit(**_inner)
@no_type_check
def _sum_outward(x, extent, moments, pivot, start, stop, step, table):
    """Write ∫φ′|x − x_pivot|ᵏ dx from the pivot to the far end of each interval, starting with ``start``."""
    zero, one, two = 0.0, 0.0, 0.0
    for i in range(start, stop, step):
        width = extent[i] * step
        if width != 0:
            offset = (x[i] - x[pivot]) * step
            zero += moments[i, 0]
            one += offset * moments[i, 0] + width * moments[i, 1]
            two += offset * offset * moments[i, 0] + 2 * offset * width * moments[i, 1] + width * width * moments[i, 2]
        table[i, 0], table[i, 1], table[i, 2] = zero, one, two


@njit(**_inner)
@no_type_check
def _fill(x, extent, moments, level, reach, table):
    """Fill one level of the table. At level zero every entry covers one interval."""
    n = len(x) - 1
    half = 1 << (level - 1) if level > 0 else 1
    if level == 0:
        for i in range(n):
            _sum_outward(x, extent, moments, i, i, i + 1, 1, table)
    else:
        for pivot in range(half, n, 2 * half):
            _sum_outward(x, extent, moments, pivot, pivot - 1, pivot - 1 - min(half, reach), -1, table)
            _sum_outward(x, extent, moments, pivot, pivot, min(pivot + min(half, reach), n), 1, table)


@njit(**_inner)
@no_type_check
def _look_up(x, ends, pieces, level, table, sums):
    """Write ∫φ′u dx and ∫φ′u² dx of the pieces of one level. u rises on even pieces and falls on odd ones."""
    for piece in pieces:
        first, last = ends[piece]
        scale = 1 / (x[last] - x[first]) if piece & 1 == 0 else -1 / (x[last] - x[first])
        centre = x[first] if piece & 1 == 0 else x[last]
        right = table[last - 1]
        zero, one, two = right[0], right[1], right[2]
        pivot = first
        if level > 0:
            pivot = ((last - 1) >> (level - 1)) << (level - 1)
            left = table[first]
            zero, one, two = zero + left[0], one - left[1], two + left[2]
        u = (x[pivot] - centre) * scale
        sums[piece, 0] = u * zero + scale * one
        sums[piece, 1] = u * (u * zero + 2 * scale * one) + scale * scale * two


@njit(**_inner)
@no_type_check
def _sum_pieces(law, moments, rank, cells, ends, order, starts, longest, table, sums):
    x, extent = law[0], law[1]
    _split(x, rank, cells, ends)
    _by_level(x, ends, order, starts, longest)
    sums[:] = 0
    for level in range(len(longest)):
        if starts[level + 1] > starts[level]:
            _fill(x, extent, moments, level, longest[level], table)
            _look_up(x, ends, order[starts[level] : starts[level + 1]], level, table, sums)


@njit(**_inner)
@no_type_check
def _triangle_gradient(x, i, j, m, rising, falling, weight, gradient):
    """Write w·E[bφ′] for the corners, in order, and return E[φ] − φ(p₂)."""
    height = x[m] - x[i]
    up, down, tent = (x[j] - x[i]) / height, (x[m] - x[j]) / height, weight / height  # tent: half the peak J
    low, high = rising[1] * up, falling[1] * down
    gradient[0] = tent * (2 * rising[0] - rising[1] - low + high)
    gradient[1] = tent * (rising[1] + falling[1])
    gradient[2] = tent * (low + 2 * falling[0] - falling[1] - high)
    return high - low


@njit(**_inner)
@no_type_check
def _in_order(cell, rank, at):
    """Write the corners of a cell in ascending order of their projections."""
    for c in range(len(cell)):
        at[c] = cell[c]
    for c in range(len(cell) * (len(cell) - 1) // 2):  # compare 0 and 1, then 1 and 2, then 0 and 1
        left = c & 1
        if rank[at[left]] > rank[at[left + 1]]:
            at[left], at[left + 1] = at[left + 1], at[left]


@njit(**_inner)
@no_type_check
def _potential(moments, extent, potential):
    """Write φ at the starts of the cells, with φ = 0 at the first."""
    potential[0] = 0.0
    for i in range(len(moments) - 1):
        potential[i + 1] = potential[i] + (moments[i, 0] if extent[i] > 0 else 0.0)


@kernel("the exact sliced loss", 15, error_model="numpy")
@no_type_check
def surface_gradient(law, moments, cells, weights, rank, work, to_projected, to_weights):
    """Write the gradient in the projected vertices, and add the gradient in the weights, for one direction.

    If a cell is perpendicular to the direction, its mass may be transported to several positions. The cost then has a
    kink, and the result is the mean of φ′ over the mass, which lies between the one-sided derivatives.
    """
    x, extent, mass, _ = law
    ends, order, starts, longest, table, sums, potential = work
    corners = cells.shape[1]
    _sum_pieces(law, moments, rank, cells, ends, order, starts, longest, table, sums)
    _potential(moments, extent, potential)
    to_projected[:] = 0
    total, mean, gradient, at = weights.sum(), 0.0, np.empty(3), np.empty(3, np.int64)
    for k in range(len(cells)):
        _in_order(cells[k], rank, at)
        first, middle, last = rank[at[0]], rank[at[1]], rank[at[corners - 1]]
        value, share = potential[middle], weights[k] / total
        if x[first] == x[last]:
            gradient[:] = share * moments[first, 0] / mass[first] / corners if mass[first] > 0 else 0.0
        elif corners == 3:
            value += _triangle_gradient(x, first, middle, last, sums[2 * k], sums[2 * k + 1], share, gradient)
        else:
            length = x[last] - x[first]
            gradient[0], gradient[1] = share * sums[2 * k + 1, 0] / length, share * sums[2 * k, 0] / length
            value -= sums[2 * k, 0]
        for c in range(corners):
            to_projected[at[c]] += gradient[c]
        to_weights[k] += value / total
        mean += share * value / total
    to_weights -= mean


@kernel("the exact sliced loss", 15, error_model="numpy")
@no_type_check
def points_gradient(law, moments, order, weights, potential, to_projected, to_weights):
    """Write the gradient in the projected points, and add the gradient in the weights, for one direction."""
    _potential(moments, law[1], potential)
    total, mean = weights.sum(), 0.0
    for i in range(len(order)):
        to_projected[order[i]] = moments[2 * i, 0]
        mean += weights[order[i]] * potential[2 * i] / total
    for i in range(len(order)):
        to_weights[order[i]] += (potential[2 * i] - mean) / total
