"""Sliced transport compiled by numba: value and gradient in one pass per direction.

For every direction, the kernel projects both measures, sorts them, passes over both quantile functions simultaneously,
and writes the gradients in the order of the points. The caller gives each thread some of the directions, because the
kernels release the GIL. All computation is in double precision.
"""

from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel
from meshot.loss._kernel_sort import sort

_BLOCK = 512  # number of points whose coordinates fit into the first-level cache for use by several directions


@kernel("the sliced loss", 10)
@no_type_check  # the test suite wraps other functions in type checks, which numba cannot compile
def walk_lines(directions, p, x, y, costs, tops):
    """Write W_p^p along every direction to ``costs``, with the gradients in positions and weights along each.

    A side is (columns, weights, values, steps, ends, order, gradients, drops, scratch). ``columns`` has the points with
    shape (d, n), one row per coordinate; the others are buffers. A row of ``gradients`` is the gradient in the
    projected positions along one direction. The gradient in the weights is the entry of ``tops`` minus a row of
    ``drops``. If a side has no such rows, its gradients are not computed.
    """
    project(x[0], directions, x[2])
    project(y[0], directions, y[2])
    nowhere = np.empty(0)
    for line in range(len(directions)):
        wanted_x, wanted_y = len(x[6]) > 0, len(y[6]) > 0
        _quantiles(y[2][line], y[1], y[3], y[5], y[4], y[8])
        _quantiles(x[2][line], x[1], x[3], x[5], x[4], x[8])
        gradients_x, drops_x = (x[6][line], x[7][line]) if wanted_x else (nowhere, nowhere)
        gradients_y, drops_y = (y[6][line], y[7][line]) if wanted_y else (nowhere, nowhere)
        costs[line], last = _walk(x[3], x[4], x[5], y[3], y[4], y[5], p, gradients_x, drops_x, gradients_y, drops_y)
        if wanted_x:
            tops[line, 0] = _close(gradients_x, drops_x, x[5]) + last / 2
        if wanted_y:
            tops[line, 1] = _close(gradients_y, drops_y, y[5]) + last / 2


@njit(fastmath={"contract"}, **INNER)
@no_type_check
def project(columns, directions, values):
    """⟨direction, point⟩ for all pairs, in blocks, so that coordinates are read once for all directions."""
    d, n = columns.shape
    for start in range(0, n, _BLOCK):
        stop = min(start + _BLOCK, n)
        for line in range(len(directions)):
            row = values[line, start:stop]
            column, share = columns[0, start:stop], directions[line, 0]
            for i in range(len(row)):
                row[i] = share * column[i]
            for k in range(1, d):
                column, share = columns[k, start:stop], directions[line, k]
                for i in range(len(row)):
                    row[i] += share * column[i]


@njit(**INNER)
@no_type_check
def _quantiles(values, weights, steps, order, ends, scratch):
    """The quantile function of a projected measure: its steps in ascending order, and the end of each in [0, 1].

    The last entry of every array is an additional step: it repeats the last position and takes the mass that rounding
    leaves on the other side. ``values`` may share memory with ``ends``, which is filled later.
    """
    n = len(weights)
    sort(values[:n], steps[:n], order[:n], scratch)
    steps[n], order[n] = steps[n - 1], n
    mass = 0.0
    for i in range(n):
        mass += weights[order[i]]
        ends[i] = mass
    ends[n] = np.inf


@njit(fastmath={"contract"}, **INNER)
@no_type_check
def _power(gap, p):
    """|gap|^p and its derivative."""
    if p == 2.0:
        return gap * gap, 2 * gap
    size = abs(gap)
    if p == 1.0:
        return size, np.sign(gap)
    return size**p, p * size ** (p - 1) * np.sign(gap)


@njit(fastmath={"contract"}, **INNER)
@no_type_check
def _walk(x, x_ends, x_order, y, y_ends, y_order, p, x_gradients, x_drops, y_gradients, y_drops):
    """W_p^p on a line: a pass over the cells of [0, 1], each of which ends where a step of F⁻¹ or G⁻¹ ends.

    Writes the derivatives in the positions to the gradients. The derivative in the weights is a potential. It decreases
    by c − c′ where a step of its own side ends and the cost changes from c to c′; the sum of these decreases up to each
    step is written to the drops. Both are written at every cell of a step, so that the last value remains. Which side
    ends is unpredictable for the processor, so the loop has no branch on it. Each iteration waits for the comparison of
    the previous one. The ends are therefore compared as integers, which is faster; non-negative floats have the same
    order as their bits.
    """
    one = np.uint64(1)
    i, j, x_took, y_took = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    done, before, total, x_gradient, y_gradient, x_drop, y_drop = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x_bits, y_bits = x_ends.view(np.int64), y_ends.view(np.int64)
    x_wanted, y_wanted = len(x_gradients) > 0, len(y_gradients) > 0
    if x_wanted:  # the additional step may not be reached
        x_gradients[-1] = 0.0
    if y_wanted:
        y_gradients[-1] = 0.0
    for _ in range(len(x_order) + len(y_order) - 2):
        cost, slope = _power(x[i] - y[j], p)
        x_takes = np.uint64(x_bits[i] <= y_bits[j])
        end = min(x_ends[i], y_ends[j])
        mass = end - done
        total += mass * cost
        if x_wanted:
            x_drop += x_took * (before - cost)
            x_gradient += mass * slope
            x_gradients[x_order[i]], x_drops[x_order[i]] = x_gradient, x_drop
            x_gradient *= one - x_takes
        if y_wanted:
            y_drop += y_took * (before - cost)
            y_gradient -= mass * slope
            y_gradients[y_order[j]], y_drops[y_order[j]] = y_gradient, y_drop
            y_gradient *= x_takes
        x_took, y_took = x_takes, one - x_takes
        i, j, done, before = i + x_took, j + y_took, end, cost
    return total, before


@njit(**INNER)
@no_type_check
def _close(gradients, drops, order):
    """Add the gradient of the additional step to the last point, and return the total decrease of the potential.

    The caller adds half of the cost at the upper end to it. Then the sums of masses times potentials of both sides add
    up to the total cost, as in the dual problem.
    """
    n = len(order) - 1
    gradients[order[n - 1]] += gradients[n]
    return drops[order[n - 1]]


@kernel("the sliced loss", 10, fastmath={"contract"})
@no_type_check
def spread(gradients, drops, directions, start, stop, columns, masses):
    """Add the gradients of all directions, in order, for the points from ``start`` to ``stop``."""
    for left in range(start, stop, _BLOCK):
        right = min(left + _BLOCK, stop)
        for line in range(len(directions)):
            row = gradients[line, left:right]
            for k in range(len(columns)):
                column, share = columns[k, left:right], directions[line, k]
                for i in range(len(row)):
                    column[i] += share * row[i]
            if len(masses):
                for i in range(left, right):
                    masses[i] -= drops[line, i]
