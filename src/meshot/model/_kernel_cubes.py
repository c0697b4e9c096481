"""Numba kernels for image features at visited voxels: voxel lookup, cubes of voxels, trilinear interpolation.

A grid is stored as a flat array, the last axis varying fastest. ``row_of`` holds the row of features of each voxel, or
-1. Positions are in voxels of the grid and lie inside it.
"""

import numpy as np

from meshot._kernels import inner, kernel


@kernel("the deformation network", 5)
def visit(places, shape, row_of, first_row):
    """Assign rows to the voxels around the positions that have none yet; return them in the order of first visit."""
    new = np.empty(8 * len(places), np.int64)
    count = 0
    for i in range(len(places)):
        x, y, z = _lower(places[i], shape)
        for corner in range(8):
            voxel = _voxel(x, y, z, corner, shape)
            if row_of[voxel] < 0:
                row_of[voxel] = first_row + count
                new[count] = voxel
                count += 1
    return new[:count].copy()


@kernel("the deformation network", 5)
def cut_cubes(padded, voxels, shape, size, cubes):
    """Copy the size³ values around each voxel into ``cubes``, from a grid padded by half a cube on every side."""
    for i in range(len(voxels)):
        z = voxels[i] % shape[2]
        y = voxels[i] // shape[2] % shape[1]
        x = voxels[i] // (shape[2] * shape[1])
        k = 0
        for a in range(size):
            for b in range(size):
                row = padded[x + a, y + b]
                for c in range(size):
                    cubes[i, k] = row[z + c]
                    k += 1


@kernel("the deformation network", 5, fastmath={"contract"})
def interpolate(places, shape, row_of, values, found):
    """Add the interpolated features of every position to ``found``."""
    weights = np.empty(8, values.dtype)
    for i in range(len(places)):
        x, y, z = _lower(places[i], shape)
        _weigh(places[i, 0] - x, places[i, 1] - y, places[i, 2] - z, weights)
        out = found[i]
        for corner in range(8):
            row, weight = values[row_of[_voxel(x, y, z, corner, shape)]], weights[corner]
            for c in range(len(out)):
                out[c] += weight * row[c]


@kernel("the deformation network", 5, fastmath={"contract", "reassoc"})
def carry_back(places, shape, row_of, values, grad_output, value_gradient, place_gradient):
    """Add the gradients with respect to feature rows and positions to ``value_gradient`` and ``place_gradient``."""
    weights, dots = np.empty(8, values.dtype), np.empty(8, values.dtype)
    for i in range(len(places)):
        x, y, z = _lower(places[i], shape)
        a, b, c = places[i, 0] - x, places[i, 1] - y, places[i, 2] - z
        _weigh(a, b, c, weights)
        given = grad_output[i]
        for corner in range(8):
            at, weight = row_of[_voxel(x, y, z, corner, shape)], weights[corner]
            row, into = values[at], value_gradient[at]
            dot = weight * 0
            for k in range(len(given)):
                into[k] += weight * given[k]
                dot += row[k] * given[k]
            dots[corner] = dot
        for corner in range(8):
            ax, by, cz = corner >> 2, corner >> 1 & 1, corner & 1
            wa, wb, wc = a if ax else 1 - a, b if by else 1 - b, c if cz else 1 - c
            place_gradient[i, 0] += (dots[corner] if ax else -dots[corner]) * wb * wc
            place_gradient[i, 1] += (dots[corner] if by else -dots[corner]) * wa * wc
            place_gradient[i, 2] += (dots[corner] if cz else -dots[corner]) * wa * wb


@inner()
def _lower(place, shape):
    """The voxel with the lowest indices among the eight around a position."""
    return min(int(place[0]), shape[0] - 2), min(int(place[1]), shape[1] - 2), min(int(place[2]), shape[2] - 2)


@inner()
def _voxel(x, y, z, corner, shape):
    return ((x + (corner >> 2)) * shape[1] + y + (corner >> 1 & 1)) * shape[2] + z + (corner & 1)


@inner()
def _weigh(a, b, c, weights):
    for corner in range(8):
        weights[corner] = (
            (a if corner >> 2 else 1 - a) * (b if corner >> 1 & 1 else 1 - b) * (c if corner & 1 else 1 - c)
        )
