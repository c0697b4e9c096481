"""The points of a measure that lie in a spatial window, compiled by numba."""

import math
from typing import no_type_check

import numpy as np

from meshot._kernels import kernel

_BLOCK = 512  # number of points whose squared distances fit into the first-level cache


@kernel("the windowed loss", 2)
@no_type_check  # the test suite wraps other functions in type checks, which numba cannot compile
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
