"""Distances from triangles to nearby voxels, and their propagation to the other voxels, compiled by numba."""

from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel


@no_type_check
@njit(**INNER)
def nearest_on_triangle(p, a, b, c):
    """The point of a triangle nearest to ``p``.

    References
    ----------
    Ericson, *Real-Time Collision Detection*, 2005, section 5.1.5.
    """
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


@no_type_check
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


@no_type_check
@kernel("distances to a surface", 5)
def spread_nearest(squared, foot, sizes, n_rounds):
    """Propagate nearest points between the 26 neighbours to voxels outside the band, forward and backward, in place.

    References
    ----------
    Danielsson, *Euclidean distance mapping*, 1980.
    """
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
