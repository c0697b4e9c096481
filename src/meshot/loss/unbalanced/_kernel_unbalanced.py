"""Unbalanced transport on a line with the cost |x − y| and a Kullback–Leibler penalty, compiled by numba.

Let zᵥ be the distinct positions of both sides, ℓᵥ the gaps between them, aᵥ and bᵥ the masses there. The dual problem
is to maximise ``ρ Σ aᵥ (1 − exp(−fᵥ/ρ)) + bᵥ (1 − exp(fᵥ/ρ))`` subject to ``|fᵥ₊₁ − fᵥ| ≤ ℓᵥ``. A primal-dual
interior-point method solves it. The matrix of every Newton step is tridiagonal, so that a step takes O(n + m)
operations.
"""

import math
from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel
from meshot.loss._kernel_sliced import project
from meshot.loss.unbalanced._kernel_partial import sorted_masses

_TOLERANCE = 1e-10  # on the duality gap, relative to the value
_MOST = 200  # Newton steps; about 25 are usual


@kernel("the unbalanced loss", 8)
@no_type_check  # the test suite wraps other functions in type checks, which numba cannot compile
def unbalanced_lines(directions, scale, x, y, costs, tops):
    """Write the unbalanced cost along every direction, and the gradients, as ``walk_lines`` does for transport.

    ``scale`` is ρ. The gradients in the weights are ρ (1 − exp(−f/ρ)) for the source, ρ (1 − exp(f/ρ)) for the target.
    """
    project(x[0], directions, x[2])
    project(y[0], directions, y[2])
    n, m = len(x[1]), len(y[1])
    nodes, masses, work = np.empty((2, max(n, m)), np.int64), np.empty((2, n + m)), np.empty((10, n + m))
    for line in range(len(directions)):
        sorted_masses(y[2][line], y[1], y[3], y[5], y[4], y[8])
        sorted_masses(x[2][line], x[1], x[3], x[5], x[4], x[8])
        size = _place(x[3], x[4], n, y[3], y[4], m, nodes, masses, work[0])
        costs[line] = _solve(masses[0][:size], masses[1][:size], scale, work)
        flows, potentials = work[1][: size - 1], work[2][:size]
        if len(x[6]) > 0:
            _write(1.0, x[5], nodes[0][:n], flows, potentials, scale, x[6][line], x[7][line])
        if len(y[6]) > 0:
            _write(-1.0, y[5], nodes[1][:m], flows, potentials, scale, y[6][line], y[7][line])


@njit(**INNER)
@no_type_check
def _place(x, x_masses, n, y, y_masses, m, nodes, masses, gaps):
    """The distinct positions in ascending order: gaps, masses of both sides, position of every point; their number."""
    i, j, node, last = 0, 0, -1, -np.inf
    for _ in range(n + m):
        of_x = j == m or (i < n and x[i] <= y[j])
        here = x[i] if of_x else y[j]
        if here > last:
            if node >= 0:
                gaps[node] = here - last
            node += 1
            masses[0, node], masses[1, node], last = 0.0, 0.0, here
        if of_x:
            masses[0, node] += x_masses[i]
            nodes[0, i] = node
            i += 1
        else:
            masses[1, node] += y_masses[j]
            nodes[1, j] = node
            j += 1
    return node + 1


@njit(**INNER)
@no_type_check
def _solve(a, b, scale, work):
    """The value. The gaps are the first row of ``work``; the flows |u| and the potentials are left in the next two.

    The constraints are f' − f ≤ ℓ with multipliers ``up`` and slacks ``above``, and f − f' ≤ ℓ with ``down`` and
    ``below``.
    """
    n = len(a)
    gaps, flows, f, up, down = work[0][:n], work[1][:n], work[2][:n], work[3][:n], work[4][:n]
    above, below, excess, weights, right = work[5][:n], work[6][:n], work[7][:n], work[8][:n], work[9][:n]
    f[:] = 0.0
    for v in range(n - 1):
        above[v] = below[v] = gaps[v]
        up[v] = down[v] = scale / n / gaps[v]
    value = 0.0
    for _ in range(_MOST):
        value, gap, unmet = _state(a, b, scale, f, up, down, above, below)
        if gap + scale * unmet <= _TOLERANCE * value + 1e-14 * scale:
            break
        target = 0.1 * gap / (2 * n)
        _eliminate(a, b, scale, f, up, down, above, below, target, excess, weights, right)
        step = _substitute(n, scale, up, down, above, below, target, excess, weights, right)
        _move(n, step, f, up, down, above, below, target, right, weights)
    for v in range(n - 1):
        flows[v] = up[v] + down[v]
    return value


@njit(**INNER)
@no_type_check
def _state(a, b, scale, f, up, down, above, below):
    """The dual value, the duality gap, and how far the flows are from meeting the masses."""
    value, gap, unmet, flow = 0.0, 0.0, 0.0, 0.0
    for v in range(len(a)):
        kept, kept_other = a[v] * math.exp(-f[v] / scale), b[v] * math.exp(f[v] / scale)
        value += scale * (a[v] - kept + b[v] - kept_other)
        excess = kept - kept_other - flow
        if v < len(a) - 1:
            flow = up[v] - down[v]
            excess += flow
            gap += up[v] * above[v] + down[v] * below[v]
        unmet += abs(excess)
    return value, gap, unmet


@njit(**INNER)
@no_type_check
def _eliminate(a, b, scale, f, up, down, above, below, target, excess, weights, right):
    """Forward elimination. A pivot is ``excess`` + ``weights``, both positive, so that nothing is cancelled."""
    before = 0.0
    for v in range(len(a)):
        kept, kept_other = a[v] * math.exp(-f[v] / scale), b[v] * math.exp(f[v] / scale)
        entry, curvature = kept - kept_other - before, (kept + kept_other) / scale
        if v > 0:
            share = weights[v - 1] / (excess[v - 1] + weights[v - 1])
            curvature += share * excess[v - 1]
            entry += share * right[v - 1]
        weights[v] = 0.0
        if v < len(a) - 1:
            weights[v] = up[v] / above[v] + down[v] / below[v]
            before = target / above[v] - target / below[v]
            entry += before
        excess[v], right[v] = curvature, entry


@njit(**INNER)
@no_type_check
def _substitute(n, scale, up, down, above, below, target, excess, weights, right):
    """Back substitution: ``right`` becomes the step in f, ``weights`` that in f' − f. Returns the part to take."""
    step, following = 1.0, right[n - 1] / excess[n - 1]
    right[n - 1], largest = following, abs(following)
    for v in range(n - 2, -1, -1):
        pivot = excess[v] + weights[v]
        rise = (excess[v] * following - right[v]) / pivot
        following = (right[v] + weights[v] * following) / pivot
        right[v], weights[v], largest = following, rise, max(largest, abs(following))
        ups, downs = target / above[v] + up[v] / above[v] * rise, target / below[v] - down[v] / below[v] * rise
        for value, change in ((above[v], -rise), (below[v], rise), (up[v], ups - up[v]), (down[v], downs - down[v])):
            if change * step < -0.95 * value:
                step = -0.95 * value / change
    return min(step, 2 * scale / largest) if largest > 0 else step


@njit(**INNER)
@no_type_check
def _move(n, step, f, up, down, above, below, target, right, rises):
    """Take a part of the step."""
    for v in range(n):
        f[v] += step * right[v]
    for v in range(n - 1):
        rise = rises[v]
        up[v] += step * (target / above[v] + up[v] / above[v] * rise - up[v])
        down[v] += step * (target / below[v] - down[v] / below[v] * rise - down[v])
        above[v] -= step * rise
        below[v] += step * rise


@njit(**INNER)
@no_type_check
def _write(sign, order, nodes, flows, potentials, scale, gradients, drops):
    """The derivatives in the positions, and minus those in the weights, for the points of one side."""
    for k in range(len(nodes)):
        v = nodes[k]
        before = flows[v - 1] if v > 0 else 0.0
        after = flows[v] if v < len(flows) else 0.0
        gradients[order[k]] = before - after
        drops[order[k]] = -scale * (1 - math.exp(-sign * potentials[v] / scale))
