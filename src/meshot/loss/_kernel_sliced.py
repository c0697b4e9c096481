"""A stable sort of floats that also returns the permutation, compiled by numba: radix sort with two digits."""

import math

import numpy as np

from meshot._kernels import inner, kernel

#: The largest array that is sorted directly. Larger ones are first divided into ranges that fit into the cache.
SMALL = 1 << 17
_RANGES = 256
_MAX_BITS = 11


def sort_scratch(n: int) -> tuple[np.ndarray, ...]:
    """Buffers for sorting ``n`` values: two for keys, one each for values and indices, and counts."""
    size = min(n, SMALL)
    keys, spare = np.empty(size, np.uint64), np.empty(size, np.uint64)
    return keys, spare, np.empty(size), np.empty(size, np.uint32), np.empty((2, 1 << _MAX_BITS), np.uint32)


@kernel("the sliced loss", 10)
def sort(values, ascending, order, scratch):
    """Write the sorted values to ``ascending`` and the permutation (uint32) to ``order``, as NumPy's stable sort."""
    if len(values) <= SMALL:
        _sort_small(values, ascending, order, scratch)
        return
    low, high = _extremes(values)
    scale = (_RANGES - 1) / (high - low) if high > low else 0.0
    if not (_all_finite(values) and scale < np.inf and high - low < np.inf):
        _sort_any(values, ascending, order)
        return
    stops = _deal(values, low, scale, ascending, order)
    start = 0
    for stop in stops:
        _sort_range(ascending[start:stop], order[start:stop], scratch)
        start = stop


@inner()
def _deal(values, low, scale, dealt, indices):
    """Copy values and indices to their ranges, in the original order; return the end of each range."""
    places = np.zeros(_RANGES, np.uint64)
    for value in values:
        places[np.uint64((value - low) * scale)] += np.uint64(1)
    _to_starts(places)
    for i in range(len(values)):
        range_of = np.uint64((values[i] - low) * scale)
        place = places[range_of]
        places[range_of] = place + np.uint64(1)
        dealt[place] = values[i]
        indices[place] = i
    return places.astype(np.int64)


@inner()
def _sort_range(values, indices, scratch):
    """Sort the values of one range in place, and their indices with them."""
    n = len(values)
    if n <= SMALL:
        copied, copied_indices = scratch[2][:n], scratch[3][:n]
        for i in range(n):
            copied[i], copied_indices[i] = values[i], indices[i]
        _sort_small(copied, values, indices, scratch)
    else:
        copied, copied_indices = values.copy(), indices.copy()
        _sort_any(copied, values, indices)
    for i in range(n):
        indices[i] = copied_indices[indices[i]]


@inner()
def _sort_small(values, ascending, order, scratch):
    """Sort by two digits of a key, then by insertion among equal keys."""
    # If many values have the same key (because an outlier widens the range), insertion is abandoned for a merge sort.
    # Merge sort is also used for values that are not finite, and for ranges so small or large that the scale is not.
    n = len(values)
    if n == 0:
        return
    bits = 4
    while bits < _MAX_BITS and (1 << (2 * bits - 3)) < n:
        bits += 1
    low, high = _extremes(values)
    scale = ((1 << (2 * bits)) - 1) / (high - low) if high > low else 0.0
    if _all_finite(values) and scale < np.inf and high - low < np.inf:
        _digits(values, low, scale, bits, order, scratch)
        for i in range(n):
            ascending[i] = values[order[i]]
        if _insertion(ascending, order, 8 * n):
            return
    _sort_any(values, ascending, order)


@inner()
def _sort_any(values, ascending, order):
    """Merge sort. NaN comes last, as in NumPy."""
    n, width = len(values), 1
    merged = np.empty(n, np.uint32)
    for i in range(n):
        order[i] = i
    while width < n:
        for start in range(0, n, 2 * width):
            middle, stop = min(start + width, n), min(start + 2 * width, n)
            left, right = start, middle
            for i in range(start, stop):
                # Take the right one only if it is strictly less than the left one, so that the sort is stable.
                if right < stop and (left == middle or _before(values[order[right]], values[order[left]])):
                    merged[i] = order[right]
                    right += 1
                else:
                    merged[i] = order[left]
                    left += 1
        for i in range(n):
            order[i] = merged[i]
        width *= 2
    for i in range(n):
        ascending[i] = values[order[i]]


@inner()
def _before(value, other):
    return value < other or (other != other and value == value)


@inner()
def _digits(values, low, scale, bits, order, scratch):
    """The permutation that sorts by a key of two digits of ``bits`` bits each: the relative position in the range."""
    keys, spare, counts = scratch[0], scratch[1], scratch[4]
    first, second = counts[0, : 1 << bits], counts[1, : 1 << bits]
    for i in range(len(first)):
        first[i] = second[i] = 0
    mask, digit, one = np.uint64((1 << bits) - 1), np.uint64(bits), np.uint32(1)
    for i in range(len(values)):
        key = np.uint64(np.uint32((values[i] - low) * scale))
        first[key & mask] += one
        second[key >> digit] += one
        keys[i] = (key << np.uint64(32)) | np.uint64(i)
    _to_starts(first)
    _to_starts(second)
    for i in range(len(values)):
        entry = keys[i]
        column = (entry >> np.uint64(32)) & mask
        spare[first[column]] = entry
        first[column] += one
    for i in range(len(values)):
        entry = spare[i]
        column = entry >> (np.uint64(32) + digit)
        order[second[column]] = np.uint32(entry)
        second[column] += one


@inner()
def _to_starts(counts):
    start = counts[0] - counts[0]
    for digit in range(len(counts)):
        count = counts[digit]
        counts[digit] = start
        start += count


@inner()
def _insertion(ascending, order, budget):
    """Insertion sort in place of nearly sorted values; False if more than ``budget`` moves would be needed."""
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


@inner(fastmath={"nnan", "nsz"})
def _extremes(values):
    """Minimum and maximum, in four independent chains each, which the processor can compute in parallel."""
    a = b = c = d = values[0]
    e = f = g = h = values[0]
    n = len(values)
    for i in range(0, n - 3, 4):
        a, b, c, d = min(a, values[i]), min(b, values[i + 1]), min(c, values[i + 2]), min(d, values[i + 3])
        e, f, g, h = max(e, values[i]), max(f, values[i + 1]), max(g, values[i + 2]), max(h, values[i + 3])
    for i in range(n - n % 4, n):
        a, e = min(a, values[i]), max(e, values[i])
    return min(min(a, b), min(c, d)), max(max(e, f), max(g, h))


@inner(fastmath={"reassoc", "nsz"})
def _all_finite(values):
    probe = 0.0
    for value in values:
        probe += value * 0.0
    return probe == 0.0


# Sliced transport compiled by numba: value and gradient in one pass per direction.
#
# For every direction, the kernel projects both measures, sorts them, passes over both quantile functions
# simultaneously, and writes the gradients in the order of the points. The caller gives each thread some of the
# directions, because the kernels release the GIL. All computation is in double precision.

_BLOCK = 512  # number of points whose coordinates fit into the first-level cache for use by several directions


@kernel("the sliced loss", 10)
def walk_lines(directions, group, p, x, y, costs, tops):
    """Write W_p^p along every direction to ``costs``, with the gradients in positions and weights along each."""
    # A side is (columns, weights, values, steps, ends, order, gradients, drops, scratch, to_columns, to_weights).
    # ``columns`` has the points with shape (d, n), one row per coordinate; the next six are buffers. A row of
    # ``gradients`` is the gradient in the projected positions along one direction. The gradient in the weights is the
    # entry of ``tops`` minus a row of ``drops``. If a side has no such rows, or they are empty, these gradients are not
    # computed. There are rows for ``group`` directions, which are computed together; their sums are added to the last
    # two, if these are not empty.
    nowhere = np.empty(0)
    wanted_x, wanted_y = len(x[6]) > 0, len(y[6]) > 0
    paired = x[7].size == 0 and y[7].size == 0 and _are_equal(x[1], y[1])
    ends = x[1].cumsum() if paired else nowhere
    for start in range(0, len(directions), group):
        lines = directions[start : start + group]
        project(x[0], lines, x[2])
        project(y[0], lines, y[2])
        for k in range(len(lines)):
            gradients_x, drops_x = (x[6][k], x[7][k]) if wanted_x else (nowhere, nowhere)
            gradients_y, drops_y = (y[6][k], y[7][k]) if wanted_y else (nowhere, nowhere)
            if paired:
                n = len(ends)
                sort(y[2][k][:n], y[3][:n], y[5][:n], y[8])
                sort(x[2][k][:n], x[3][:n], x[5][:n], x[8])
                costs[start + k] = _walk_pairs(x[3], x[5], y[3], y[5], ends, p, gradients_x, gradients_y)
                continue
            _quantiles(y[2][k], y[1], y[3], y[5], y[4], y[8])
            _quantiles(x[2][k], x[1], x[3], x[5], x[4], x[8])
            cost, last = _walk(x[3], x[4], x[5], y[3], y[4], y[5], p, gradients_x, drops_x, gradients_y, drops_y)
            costs[start + k] = cost
            if wanted_x:
                tops[start + k, 0] = _close(gradients_x, drops_x, x[5]) + last / 2
            if wanted_y:
                tops[start + k, 1] = _close(gradients_y, drops_y, y[5]) + last / 2
        add_up(x, lines)
        add_up(y, lines)


@inner(fastmath={"contract"})
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


@inner()
def _quantiles(values, weights, steps, order, ends, scratch):
    """The quantile function of a projected measure: its steps in ascending order, and the end of each in [0, 1]."""
    # The last entry of every array is an additional step: it repeats the last position and takes the mass that rounding
    # leaves on the other side. ``values`` may share memory with ``ends``, which is filled later.
    n = len(weights)
    sort(values[:n], steps[:n], order[:n], scratch)
    steps[n], order[n] = steps[n - 1], n
    mass = 0.0
    for i in range(n):
        mass += weights[order[i]]
        ends[i] = mass
    ends[n] = np.inf


@inner(fastmath={"contract"})
def _power(gap, p):
    """|gap|^p and its derivative."""
    if p == 2.0:
        return gap * gap, 2 * gap
    size = abs(gap)
    if p == 1.0:
        return size, np.sign(gap)
    return size**p, p * size ** (p - 1) * np.sign(gap)


@inner()
def _are_equal(weights, others):
    """Whether all masses of both sides are the same, so that transport pairs the sorted points."""
    return len(weights) == len(others) and np.all(weights == weights[0]) and np.all(others == weights[0])


@inner(fastmath={"contract"})
def _walk_pairs(x, x_order, y, y_order, ends, p, x_gradients, y_gradients):
    """What :func:`_walk` returns and writes for points of equal mass, to the last bit, without its empty cells."""
    done, total = 0.0, 0.0
    x_wanted, y_wanted = len(x_gradients) > 0, len(y_gradients) > 0
    for i in range(len(ends)):
        cost, slope = _power(x[i] - y[i], p)
        mass = ends[i] - done
        done = ends[i]
        total += mass * cost
        if x_wanted:
            x_gradients[x_order[i]] = mass * slope
        if y_wanted:
            y_gradients[y_order[i]] = -mass * slope
    return total


@inner(fastmath={"contract"})
def _walk(x, x_ends, x_order, y, y_ends, y_order, p, x_gradients, x_drops, y_gradients, y_drops):
    """W_p^p on a line: a pass over the cells of [0, 1], each of which ends where a step of F⁻¹ or G⁻¹ ends."""
    # Writes the derivatives in the positions to the gradients. The derivative in the weights is a potential. It
    # decreases by c − c′ where a step of its own side ends and the cost changes from c to c′; the sum of these
    # decreases up to each step is written to the drops. Both are written at every cell of a step, so that the last
    # value remains. Which side ends is unpredictable for the processor, so the loop has no branch on it. Each iteration
    # waits for the comparison of the previous one. The ends are therefore compared as integers, which is faster;
    # non-negative floats have the same order as their bits.
    one = np.uint64(1)
    i, j, x_took, y_took = np.uint64(0), np.uint64(0), np.uint64(0), np.uint64(0)
    done, before, total, x_gradient, y_gradient, x_drop, y_drop = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    x_bits, y_bits = x_ends.view(np.int64), y_ends.view(np.int64)
    x_wanted, y_wanted = len(x_gradients) > 0, len(y_gradients) > 0
    x_weighted, y_weighted = len(x_drops) > 0, len(y_drops) > 0
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
            x_gradient += mass * slope
            x_gradients[x_order[i]] = x_gradient
            x_gradient *= one - x_takes
            if x_weighted:
                x_drop += x_took * (before - cost)
                x_drops[x_order[i]] = x_drop
        if y_wanted:
            y_gradient -= mass * slope
            y_gradients[y_order[j]] = y_gradient
            y_gradient *= x_takes
            if y_weighted:
                y_drop += y_took * (before - cost)
                y_drops[y_order[j]] = y_drop
        x_took, y_took = x_takes, one - x_takes
        i, j, done, before = i + x_took, j + y_took, end, cost
    return total, before


@inner()
def _close(gradients, drops, order):
    """Add the gradient of the additional step to the last point, and return the total decrease of the potential."""
    # The caller adds half of the cost at the upper end to it. Then the sums of masses times potentials of both sides
    # add up to the total cost, as in the dual problem.
    n = len(order) - 1
    gradients[order[n - 1]] += gradients[n]
    return drops[order[n - 1]] if len(drops) > 0 else 0.0


@kernel("the sliced loss", 10, fastmath={"contract"})
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


@inner()
def add_up(side, lines):
    """Add the gradients of a group of directions to the sums of a side, if it has sums."""
    if len(side[9]) > 0 or len(side[10]) > 0:
        spread(side[6], side[7], lines, 0, len(side[1]), side[9], side[10])


# The points of a measure that lie in a spatial window, compiled by numba.


@kernel("the windowed loss", 2)
def find_in_window(columns, centre, radius, reach, chosen, factors):
    """Write the indices of the points nearer to the centre than ``reach``, and their Gaussian factors; return how many.

    ``columns`` has the positions with shape (k, n). The buffers have the length n. The loop that selects has no branch,
    because the processor cannot predict which points are near.
    """
    k, n = columns.shape
    limit, count, squared = reach * reach, 0, np.empty(_BLOCK)
    for start in range(0, n, _BLOCK):
        stop = min(start + _BLOCK, n)
        for axis in range(k):
            column, place = columns[axis, start:stop], centre[axis]
            for i in range(len(column)):
                gap = column[i] - place
                squared[i] = gap * gap + (squared[i] if axis > 0 else 0.0)
        for i in range(stop - start):
            chosen[count] = start + i
            factors[count] = squared[i]
            count += squared[i] < limit
    for i in range(count):
        factors[i] = math.exp(-factors[i] / (2 * radius * radius))
    return count
