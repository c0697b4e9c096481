"""Sliced transport along one direction at a time, value and gradient in one pass, in numba.

For every direction: project both measures, sort, walk both quantile functions at once, and leave the gradients where
the points came from. Memory is that of one direction, whatever their number. The caller gives each thread its share
of the directions: the kernels release the GIL. Everything is in double precision.
"""

from typing import no_type_check

import numpy as np
from numba import njit

_DIGIT_BITS = 11
_DIGITS = 1 << _DIGIT_BITS
_options = {"cache": True, "nogil": True}


@njit(**_options)
@no_type_check  # the test suite wraps every other function in checks, which numba cannot compile
def add_directions(source, source_weights, target, target_weights, directions, p, costs, to_source, to_target, masses):
    """W_p^p along every direction, in ``costs``, and the sums of its gradients over the directions, in the buffers.

    ``source``, ``target`` and their gradients are (d, n): one row per coordinate, so that projecting is d long
    additions. ``masses`` holds the gradients in the weights of both sides. A buffer without entries is not wanted.
    """
    n, m = source.shape[1], target.shape[1]
    x, x_ends, x_pull, x_drop = np.empty(n + 1), np.empty(n + 1), np.empty(n + 1), np.empty(n + 1)
    y, y_ends, y_pull, y_drop = np.empty(m + 1), np.empty(m + 1), np.empty(m + 1), np.empty(m + 1)
    x_order, y_order, values = np.empty(n, np.int32), np.empty(m, np.int32), np.empty(max(n, m))
    keys, spare = np.empty(max(n, m), np.uint64), np.empty(max(n, m), np.uint64)
    for line in range(len(directions)):
        direction = directions[line]
        _quantiles(source, source_weights, direction, values[:n], x, x_order, x_ends, keys, spare)
        _quantiles(target, target_weights, direction, values[:m], y, y_order, y_ends, keys, spare)
        costs[line] = _walk(x, x_ends, y, y_ends, p, x_pull, y_pull, x_drop, y_drop)
        if to_source.size:
            _spread(x_pull, x_order, direction, values[:n], to_source)
        if to_target.size:
            _spread(y_pull, y_order, direction, values[:m], to_target)
        if masses.size:
            _add_potential(x_drop, x_order, masses[:n])
            _add_potential(y_drop, y_order, masses[n:])


@njit(**_options)
@no_type_check
def _quantiles(columns, weights, direction, values, steps, order, ends, keys, spare):
    """The quantile function of a projected measure: its steps in ascending order, and where in [0, 1] each ends."""
    n = len(values)
    _project(columns, direction, values)
    sort(values, steps[:n], order, keys, spare)
    steps[n] = steps[n - 1]
    mass = 0.0
    for i in range(n):
        mass += weights[order[i]]
        ends[i] = mass
    ends[n] = np.inf


@njit(fastmath={"contract"}, **_options)
@no_type_check
def _project(columns, direction, out):
    out[:] = direction[0] * columns[0]
    for k in range(1, len(direction)):
        for i in range(len(out)):
            out[i] += direction[k] * columns[k, i]


@njit(fastmath={"contract"}, **_options)
@no_type_check
def _spread(pull, order, direction, values, columns):
    """Add ``pull`` · ``direction`` to the points that the sorted entries came from."""
    n = len(order)
    pull[n - 1] += pull[n]
    for i in range(n):
        values[order[i]] = pull[i]
    for k in range(len(direction)):
        for i in range(n):
            columns[k, i] += direction[k] * values[i]


@njit(**_options)
@no_type_check
def _add_potential(drop, order, masses):
    n = len(order)
    for i in range(n):
        masses[order[i]] += drop[n] - drop[i]


@njit(**_options)
@no_type_check
def sort(values, ascending, order, keys, spare):
    """A stable sort: radix on 22 bits of the range, then insertion for what shares a key.

    Where values crowd in few keys (an outlier stretches the range), insertion is abandoned for a merge sort.
    """
    n = len(values)
    low, high, finite = values[0], values[0], True
    for i in range(n):
        low, high = min(low, values[i]), max(high, values[i])
        finite &= abs(values[i]) < np.inf
    scale = (_DIGITS * _DIGITS - 1) / (high - low) if high > low else 0.0
    # What overflowed has no key; neither does a range so small, or so large, that the scale leaves the numbers.
    if finite and scale < np.inf and high - low < np.inf:
        _radix(values, low, scale, ascending, order, keys, spare)
        if _insertion(ascending, order, 8 * n):
            return
    order[:] = np.argsort(values, kind="mergesort")
    ascending[:] = values[order]


@njit(**_options)
@no_type_check
def _radix(values, low, scale, ascending, order, keys, spare):
    n = len(values)
    first, second = np.zeros(_DIGITS, np.int64), np.zeros(_DIGITS, np.int64)
    for i in range(n):
        key = np.int64((values[i] - low) * scale)
        first[key & (_DIGITS - 1)] += 1
        second[key >> _DIGIT_BITS] += 1
        keys[i] = (key << 32) | i
    _to_starts(first)
    _to_starts(second)
    for i in range(n):
        digit = np.int64(keys[i] >> 32) & (_DIGITS - 1)
        spare[first[digit]] = keys[i]
        first[digit] += 1
    for i in range(n):
        digit = np.int64(spare[i] >> (32 + _DIGIT_BITS))
        keys[second[digit]] = spare[i]
        second[digit] += 1
    for i in range(n):
        index = np.int64(keys[i] & 0xFFFFFFFF)
        order[i] = index
        ascending[i] = values[index]


@njit(**_options)
@no_type_check
def _to_starts(counts):
    start = 0
    for digit in range(len(counts)):
        count = counts[digit]
        counts[digit] = start
        start += count


@njit(**_options)
@no_type_check
def _insertion(ascending, order, budget):
    """Sort in place what is nearly sorted; False if more than ``budget`` moves would be needed."""
    for i in range(1, len(ascending)):
        value = ascending[i]
        if ascending[i - 1] > value:
            index, j = order[i], i
            while j > 0 and ascending[j - 1] > value:
                ascending[j], order[j] = ascending[j - 1], order[j - 1]
                j -= 1
            ascending[j], order[j] = value, index
            budget -= i - j
            if budget < 0:
                return False
    return True


@njit(inline="always")
@no_type_check
def _power(gap, p):
    """|gap|^p and its derivative."""
    if p == 2.0:
        return gap * gap, 2 * gap
    size = abs(gap)
    if p == 1.0:
        return size, np.sign(gap)
    return size**p, p * size ** (p - 1) * np.sign(gap)


@njit(fastmath={"contract"}, **_options)
@no_type_check
def _walk(x, x_ends, y, y_ends, p, x_pull, y_pull, x_drop, y_drop):
    """W_p^p on a line: one cell of [0, 1] after the other, each ending where a step of F⁻¹ or of G⁻¹ ends.

    The last entry of every array is a step beyond the end: it repeats the last position, and takes the mass that
    rounding leaves over on the other side. Leaves the gradient in the positions in the pulls. The gradient in the
    weights is a potential: it drops by c − c′ where a step of its own side ends and the cost goes from c to c′; the
    sum of these drops up to each step is left in the drops. Which side ends is a coin toss that no processor can
    predict, so that there is no branch on it.
    """
    i, j, done, total = 0, 0, 0.0, 0.0
    x_dropped, y_dropped, before, x_took, y_took = 0.0, 0.0, 0.0, 0, 0
    x_pull[:], y_pull[:] = 0.0, 0.0
    for _ in range(len(x) + len(y) - 2):
        cost, slope = _power(x[i] - y[j], p)
        x_dropped += x_took * (before - cost)
        y_dropped += y_took * (before - cost)
        x_drop[i], y_drop[j] = x_dropped, y_dropped
        x_took = int(x_ends[i] <= y_ends[j])
        y_took = 1 - x_took
        end = min(x_ends[i], y_ends[j])
        total += (end - done) * cost
        x_pull[i] += (end - done) * slope
        y_pull[j] -= (end - done) * slope
        i, j, done, before = i + x_took, j + y_took, end, cost
    # The cost at the top is shared, so that masses times potentials sum to the whole cost, as duality has it.
    x_drop[-1], y_drop[-1] = x_drop[-2] + before / 2, y_drop[-2] + before / 2
    return total
