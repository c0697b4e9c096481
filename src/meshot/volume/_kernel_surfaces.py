"""Distances from triangles to nearby voxels, and their propagation to the other voxels, compiled by numba."""

import heapq

import numpy as np

from meshot._kernels import inner, kernel


@inner()
def nearest_on_triangle(p, a, b, c):
    """The point of a triangle nearest to ``p``."""
    ab, ac, ap = b - a, c - a, p - a
    d1, d2 = np.dot(ab, ap), np.dot(ac, ap)
    if d1 <= 0 and d2 <= 0:
        return a
    bp = p - b
    d3, d4 = np.dot(ab, bp), np.dot(ac, bp)
    if d3 >= 0 and d4 <= d3:
        return b
    vc = d1 * d4 - d3 * d2
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        return a + d1 / (d1 - d3) * ab
    cp = p - c
    d5, d6 = np.dot(ab, cp), np.dot(ac, cp)
    if d6 >= 0 and d5 <= d6:
        return c
    vb = d5 * d2 - d1 * d6
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        return a + d2 / (d2 - d6) * ac
    va = d3 * d6 - d5 * d4
    if va <= 0 and d4 >= d3 and d5 >= d6:
        return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b)
    total = va + vb + vc
    return a + vb / total * ab + vc / total * ac


@kernel("distances to a surface", 5)
def nearest_in_band(corners, sizes, shape, band):
    """Squared distance to the mesh, and nearest point, for every voxel centre (index · size) within ``band``."""
    squared = np.full(shape, np.inf)
    foot = np.zeros((*shape, 3))
    low, high = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    p = np.empty(3)
    for f in range(len(corners)):
        for axis in range(3):
            ends = corners[f, :, axis]
            low[axis] = max(0, int(np.ceil((ends.min() - band) / sizes[axis])))
            high[axis] = min(shape[axis] - 1, int(np.floor((ends.max() + band) / sizes[axis])))
        for i in range(low[0], high[0] + 1):
            p[0] = i * sizes[0]
            for j in range(low[1], high[1] + 1):
                p[1] = j * sizes[1]
                for k in range(low[2], high[2] + 1):
                    p[2] = k * sizes[2]
                    q = nearest_on_triangle(p, corners[f, 0], corners[f, 1], corners[f, 2])
                    d = (p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 + (p[2] - q[2]) ** 2
                    # Outside the band, a triangle whose box does not contain the voxel may be nearer.
                    if d <= band * band and d < squared[i, j, k]:
                        squared[i, j, k] = d
                        foot[i, j, k] = q
    return squared, foot


@kernel("distances to a surface", 5)
def spread_nearest(squared, foot, sizes, n_rounds):
    """Propagate nearest points between the 26 neighbours to voxels outside the band, forward and backward, in place."""
    shape = squared.shape
    far = np.isinf(squared)
    for sweep in range(2 * n_rounds):
        for step in range(squared.size):
            index = step if sweep % 2 == 0 else squared.size - 1 - step
            i, rest = divmod(index, shape[1] * shape[2])
            j, k = divmod(rest, shape[2])
            if not far[i, j, k]:
                continue
            for x in range(max(i - 1, 0), min(i + 2, shape[0])):
                for y in range(max(j - 1, 0), min(j + 2, shape[1])):
                    for z in range(max(k - 1, 0), min(k + 2, shape[2])):
                        if np.isinf(squared[x, y, z]):
                            continue
                        d = (i * sizes[0] - foot[x, y, z, 0]) ** 2
                        d += (j * sizes[1] - foot[x, y, z, 1]) ** 2 + (k * sizes[2] - foot[x, y, z, 2]) ** 2
                        if d < squared[i, j, k]:
                            squared[i, j, k] = d
                            foot[i, j, k] = foot[x, y, z]


# The numba kernels of the genus-0 correction: simple points, well-composedness, and region growing.

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


@inner()
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
def is_simple(values):
    """Whether adding the centre keeps the topology: one 26-component of the object, one 6-component of background."""
    return _components(values, True, _ALL, _ADJACENT_26) == 1 and _components(values, False, _FACES, _ADJACENT_6) == 1


@kernel("the correction of topology", 5)
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
