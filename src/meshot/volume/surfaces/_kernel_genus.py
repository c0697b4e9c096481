"""The numba kernels of the genus-0 correction: simple points, well-composedness, and region growing."""

import heapq
from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel

OFFSETS = np.array([(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.int64)
CENTRE = 13


def _adjacent_places(connectivity: int, allowed: np.ndarray) -> np.ndarray:
    """Row i lists the positions in the 3³ neighbourhood that are adjacent to position i, padded with -1."""
    table = np.full((27, 26), -1, dtype=np.int64)
    for i in range(27):
        steps = np.abs(OFFSETS - OFFSETS[i])
        near = (steps.max(axis=1) == 1) & (steps.sum(axis=1) <= {6: 1, 26: 3}[connectivity])
        places = np.flatnonzero(near & allowed & allowed[i])
        table[i, : len(places)] = places
    return table


_DISTANCE = np.abs(OFFSETS).sum(axis=1)
_ADJACENT_26 = _adjacent_places(26, _DISTANCE > 0)
_ADJACENT_6 = _adjacent_places(6, (_DISTANCE > 0) & (_DISTANCE < 3))
_FACES = np.flatnonzero(_DISTANCE == 1)
_ALL = np.flatnonzero(_DISTANCE > 0)


@njit(**INNER)
@no_type_check  # the test suite wraps other functions in type checks, which numba cannot compile
def _components(values, wanted, seeds, adjacent):
    """The number of components with the wanted value that contain at least one of the seeds."""
    seen = np.zeros(27, dtype=np.bool_)
    stack = np.empty(27, dtype=np.int64)
    count = 0
    for seed in seeds:
        if values[seed] != wanted or seen[seed]:
            continue
        count += 1
        seen[seed] = True
        stack[0] = seed
        size = 1
        while size:
            size -= 1
            place = stack[size]
            for other in adjacent[place]:
                if other < 0:
                    break
                if values[other] == wanted and not seen[other]:
                    seen[other] = True
                    stack[size] = other
                    size += 1
    return count


@kernel("the correction of topology", 5)
@no_type_check
def is_simple(values):
    """Whether adding the centre keeps the topology: one 26-component of the object, one 6-component of background."""
    return _components(values, True, _ALL, _ADJACENT_26) == 1 and _components(values, False, _FACES, _ADJACENT_6) == 1


@kernel("the correction of topology", 5)
@no_type_check
def stays_well_composed(values):
    """Whether no two voxels of object or background meet only in an edge or corner after the centre is added."""
    for i in (-1, 1):
        for j in (-1, 1):
            for k in (-1, 1):
                x, y, z = 9 * i, 3 * j, k
                a, b, c = values[13 + x], values[13 + y], values[13 + z]
                ab, ac, bc = values[13 + x + y], values[13 + x + z], values[13 + y + z]
                abc = values[13 + x + y + z]
                if (ab and not a and not b) or (ac and not a and not c) or (bc and not b and not c):
                    return False
                if abc and not (a or b or c or ab or ac or bc):
                    return False
                # Two opposite corners are missing from an otherwise full cube; the centre is one of the other six.
                total = int(a) + int(b) + int(c) + int(ab) + int(ac) + int(bc) + int(abc)
                if total == 5 and ((not a and not bc) or (not b and not ac) or (not c and not ab)):
                    return False
    return True


@kernel("the correction of topology", 5)
@no_type_check
def flood(mask, priority, seed):
    """Grow a region from a seed inside a mask, in order of priority, through voxels that keep the topology of a ball.

    ``mask`` and ``priority`` are grids whose outermost layer is background; ``priority`` is lowest first. ``seed`` is
    an index triple.
    """
    shape = mask.shape
    strides = np.array([shape[1] * shape[2], shape[2], 1])
    steps = (OFFSETS * strides).sum(axis=1)
    allowed, order = mask.ravel(), priority.ravel()
    grown = np.zeros(allowed.size, dtype=np.bool_)
    waiting = np.zeros(allowed.size, dtype=np.bool_)
    values = np.zeros(27, dtype=np.bool_)
    start = seed[0] * strides[0] + seed[1] * strides[1] + seed[2]
    heap = [(order[start], start)]
    first = True
    while len(heap):
        _, place = heapq.heappop(heap)
        waiting[place] = False
        for i in range(27):
            values[i] = grown[place + steps[i]]
        if not first and not (is_simple(values) and stays_well_composed(values)):
            continue
        first = False
        grown[place] = True
        for step in steps:
            other = place + step
            if allowed[other] and not grown[other] and not waiting[other]:
                waiting[other] = True
                heapq.heappush(heap, (order[other], other))
    return grown.reshape(shape)
