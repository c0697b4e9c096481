"""The gradient of transport on a line, from the moments of the potential's slope over the cells of a law.

If the optimal potential is φ, moving a projected vertex changes the cost by w·E[bφ′] for each triangle of mass w at it,
b the barycentric weight of the vertex and E the mean over the triangle; changing the mass of a triangle by dw changes
it by E[φ] dw. On the rising piece, with u from 0 to 1 between p₁ and p₂, the tent is J·u (J = 2/(p₃ − p₁) at mass one)
and the section at u runs from the point u on the edge p₁p₂ to the point u·h₁/H on the edge p₁p₃, so that the means
of b over it are linear in u; likewise with v from 0 to 1 between p₃ and p₂. Hence all that is needed are M₁ = ∫φ′u dx
and M₂ = ∫φ′u² dx over both pieces, and by parts E[φ] = φ(p₂) + (J/2)(h₂·M₂(v) − h₁·M₂(u)).

Differences of antiderivatives of φ would lose these moments on short pieces. They are gathered from the binary tree
over the cells that also laid the densities: O(log V) nodes a piece, sums of positive weights again.
"""

from typing import no_type_check

import numpy as np
from numba import njit

_options = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(inline="always")
@no_type_check
def _collect(tree, size, x, n):
    """The moments over every node from those over its two children."""
    width = 2
    while width <= size:
        half = width >> 1
        node = size // width
        for start in range(0, n, width):
            if start + width <= n:
                low, middle, high = x[start], x[start + half], x[start + width]
                share = (middle - low) / (high - low) if high > low else 0.5
                rest, left, right = 1 - share, tree[2 * node], tree[2 * node + 1]
                tree[node, 0] = left[0] + right[0]
                tree[node, 1] = share * (left[1] + right[0]) + rest * right[1]
                tree[node, 2] = (
                    share * share * (left[2] + right[0]) + 2 * share * rest * right[1] + rest * rest * right[2]
                )
            node += 1
        width <<= 1


@njit(inline="always")
@no_type_check
def _gather(tree, size, x, first, last, centre, scale):
    """∫φ′u dx and ∫φ′u² dx over the intervals [first, last), u = (x − centre)·scale."""
    low, high, width = first + size, last + size, 1
    one, two = 0.0, 0.0
    while low < high:
        if low & 1:
            start, step = (x[first] - centre) * scale, (x[first + width] - x[first]) * scale
            one += start * tree[low, 0] + step * tree[low, 1]
            two += start * (start * tree[low, 0] + 2 * step * tree[low, 1]) + step * step * tree[low, 2]
            first += width
            low += 1
        if high & 1:
            high -= 1
            start, step = (x[last - width] - centre) * scale, (x[last] - x[last - width]) * scale
            one += start * tree[high, 0] + step * tree[high, 1]
            two += start * (start * tree[high, 0] + 2 * step * tree[high, 1]) + step * step * tree[high, 2]
            last -= width
        low >>= 1
        high >>= 1
        width <<= 1
    return one, two


@njit(inline="always")
@no_type_check
def _pull_triangle(tree, size, x, i, j, m, weight, pull):
    """Write w·E[bφ′] for the corners in order, and return E[φ] − φ(p₂)."""
    up, down, height = x[j] - x[i], x[m] - x[j], x[m] - x[i]
    one, two, other_one, other_two = 0.0, 0.0, 0.0, 0.0
    if up > 0:
        one, two = _gather(tree, size, x, i, j, x[i], 1 / up)
    if down > 0:
        other_one, other_two = _gather(tree, size, x, j, m, x[m], -1 / down)
    tent = weight / height  # half the peak J
    low, high = two * (up / height), other_two * (down / height)
    pull[0] = tent * (2 * one - two - low + high)
    pull[1] = tent * (two + other_two)
    pull[2] = tent * (low + 2 * other_one - other_two - high)
    return (down * other_two - up * two) / height


@njit(inline="always")
@no_type_check
def _pull_segment(tree, size, x, i, j, weight, pull):
    """As for a triangle, for a box; E[φ] − φ of the upper end."""
    length = x[j] - x[i]
    toward_upper, _ = _gather(tree, size, x, i, j, x[i], 1 / length)
    toward_lower, _ = _gather(tree, size, x, i, j, x[j], -1 / length)
    pull[0], pull[1] = weight * toward_lower / length, weight * toward_upper / length
    return -toward_upper


@njit(inline="always")
@no_type_check
def _potential(moments, extent, potential):
    """φ at the starts of the cells, zero at the first."""
    potential[0] = 0.0
    for i in range(len(moments) - 1):
        potential[i + 1] = potential[i] + (moments[i, 0] if extent[i] > 0 else 0.0)


@njit(**_options)
@no_type_check
def pull_surface(law, moments, cells, weights, rank, tree, potential, to_projected, to_weights):
    """Write the gradient in the projected vertices, and add that in the weights, of one direction.

    Where a cell is perpendicular to the direction its mass may be split among several places, and transport has a kink:
    it is given the mean of φ′ over its mass, which lies between the one-sided derivatives.
    """
    x, extent, mass, _ = law
    n, size, corners = len(x) - 1, len(tree) // 2, cells.shape[1]
    for i in range(n):
        for k in range(3):
            tree[size + i, k] = moments[i, k] if extent[i] > 0 else 0.0
    _collect(tree, size, x, n)
    _potential(moments, extent, potential)
    to_projected[:] = 0
    total, mean, pull, at = weights.sum(), 0.0, np.empty(3), np.empty(3, np.int64)
    for k in range(len(cells)):
        for c in range(corners):
            at[c] = cells[k, c]
        for c in range(corners * (corners - 1) // 2):  # sorted by rank: compare 0-1, 1-2, 0-1
            if rank[at[c & 1]] > rank[at[(c & 1) + 1]]:
                at[c & 1], at[(c & 1) + 1] = at[(c & 1) + 1], at[c & 1]
        first, middle, last = rank[at[0]], rank[at[corners - 2]], rank[at[corners - 1]]
        value = potential[rank[at[1]]]
        share = weights[k] / total
        if x[first] == x[last]:
            pull[:] = share * moments[first, 0] / mass[first] / corners if mass[first] > 0 else 0.0
        elif corners == 3:
            value += _pull_triangle(tree, size, x, first, middle, last, share, pull)
        else:
            value += _pull_segment(tree, size, x, first, last, share, pull)
        for c in range(corners):
            to_projected[at[c]] += pull[c]
        to_weights[k] += value / total
        mean += share * value / total
    to_weights -= mean


@njit(**_options)
@no_type_check
def pull_points(law, moments, order, weights, potential, to_projected, to_weights):
    """Write the gradient in the projected points, and add that in the weights, of one direction."""
    _potential(moments, law[1], potential)
    total, mean = weights.sum(), 0.0
    for i in range(len(order)):
        to_projected[order[i]] = moments[2 * i, 0]
        mean += weights[order[i]] * potential[2 * i] / total
    for i in range(len(order)):
        to_weights[order[i]] += (potential[2 * i] - mean) / total
