"""A stable sort of floats that also returns the permutation, compiled by numba: radix sort with two digits."""

from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel

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
@no_type_check  # the test suite wraps other functions in type checks, which numba cannot compile
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


@njit(**INNER)
@no_type_check
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


@njit(**INNER)
@no_type_check
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


@njit(**INNER)
@no_type_check
def _sort_small(values, ascending, order, scratch):
    """Sort by two digits of a key, then by insertion among equal keys.

    If many values have the same key (because an outlier widens the range), insertion is abandoned for a merge sort.
    Merge sort is also used for values that are not finite, and for ranges so small or large that the scale is not.
    """
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


@njit(**INNER)
@no_type_check
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


@njit(**INNER)
@no_type_check
def _before(value, other):
    return value < other or (other != other and value == value)


@njit(**INNER)
@no_type_check
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


@njit(**INNER)
@no_type_check
def _to_starts(counts):
    start = counts[0] - counts[0]
    for digit in range(len(counts)):
        count = counts[digit]
        counts[digit] = start
        start += count


@njit(**INNER)
@no_type_check
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


@njit(fastmath={"nnan", "nsz"}, **INNER)
@no_type_check
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


@njit(fastmath={"reassoc", "nsz"}, **INNER)
@no_type_check
def _all_finite(values):
    probe = 0.0
    for value in values:
        probe += value * 0.0
    return probe == 0.0
