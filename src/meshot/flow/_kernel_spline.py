"""Cubic B-spline interpolation of a vector field on a lattice, forward and backward, compiled by numba.

Each point depends on 4 × 4 × 4 coefficients of three components. The last two axes are contiguous in memory, so the
coefficients of a point form 16 rows of 12 numbers. The inner loops run over such rows, which the compiler vectorises.
Positions are clipped to the box in which all four neighbouring nodes exist along every axis. The caller divides the
points into chunks, one per thread, because the kernels release the GIL.
"""

import numpy as np

from meshot._kernels import inner, kernel

_FASTMATH = {"contract", "reassoc"}
_inner = inner(fastmath=_FASTMATH)


@_inner
def _clipped(place, n_nodes):
    """The cell that contains ``place`` after clipping to [1, n − 2], and the offset in this cell."""
    place = min(place if place > 1 else 1, n_nodes - 2)  # NaN must not become an index
    cell = min(int(place), n_nodes - 3)
    return cell, place - cell


@_inner
def _weigh(t, weights):
    """The four cubic B-spline weights at offset ``t`` in [0, 1)."""
    s = 1 - t
    weights[0] = s * s * s / 6
    weights[1] = 2 / 3 - t * t * (1 - t / 2)
    weights[2] = 2 / 3 - s * s * (1 - s / 2)
    weights[3] = t * t * t / 6


@_inner
def _slope(t, slopes):
    """The derivatives of the four weights."""
    s = 1 - t
    slopes[0] = -s * s / 2
    slopes[1] = t * (3 * t / 2 - 2)
    slopes[2] = s * (2 - 3 * s / 2)
    slopes[3] = t * t / 2


@kernel("flows on a grid", 5, fastmath=_FASTMATH)
def interpolate(coefficients, places, values):
    """Write to ``values`` the spline at ``places``, which are in units of the lattice spacing."""
    nx, ny, nz, _ = coefficients.shape
    flat = coefficients.reshape(-1)
    weights, row = np.empty((3, 4), places.dtype), np.empty(12, places.dtype)
    for i in range(len(places)):
        (x, u), (y, v), (z, w) = _clipped(places[i, 0], nx), _clipped(places[i, 1], ny), _clipped(places[i, 2], nz)
        _weigh(u, weights[0])
        _weigh(v, weights[1])
        _weigh(w, weights[2])
        row[:] = 0
        for a in range(4):
            for b in range(4):
                start = 3 * (((x - 1 + a) * ny + y - 1 + b) * nz + z - 1)
                weight = weights[0, a] * weights[1, b]
                for m in range(12):
                    row[m] += weight * flat[start + m]
        for k in range(3):
            values[i, k] = 0
            for c in range(4):
                values[i, k] += weights[2, c] * row[3 * c + k]


@kernel("flows on a grid", 5, fastmath=_FASTMATH)
def interpolate_backward(coefficients, places, grad_output, to_coefficients, to_places):
    """Add the gradient with respect to the coefficients to one buffer; write that of the positions to another."""
    nx, ny, nz, _ = coefficients.shape
    flat, to_flat = coefficients.reshape(-1), to_coefficients.reshape(-1)
    weights, slopes = np.empty((3, 4), places.dtype), np.empty((3, 4), places.dtype)
    rows = np.empty((4, 12), places.dtype)
    along_x, along_y, along_z, share = rows[0], rows[1], rows[2], rows[3]
    for i in range(len(places)):
        (x, u), (y, v), (z, w) = _clipped(places[i, 0], nx), _clipped(places[i, 1], ny), _clipped(places[i, 2], nz)
        _weigh(u, weights[0])
        _weigh(v, weights[1])
        _weigh(w, weights[2])
        _slope(u, slopes[0])
        _slope(v, slopes[1])
        _slope(w, slopes[2])
        for c in range(4):
            for k in range(3):
                share[3 * c + k] = weights[2, c] * grad_output[i, k]
        along_x[:], along_y[:], along_z[:] = 0, 0, 0
        for a in range(4):
            for b in range(4):
                start = 3 * (((x - 1 + a) * ny + y - 1 + b) * nz + z - 1)
                weight = weights[0, a] * weights[1, b]
                slope_x, slope_y = slopes[0, a] * weights[1, b], weights[0, a] * slopes[1, b]
                for m in range(12):
                    coefficient = flat[start + m]
                    along_x[m] += slope_x * coefficient
                    along_y[m] += slope_y * coefficient
                    along_z[m] += weight * coefficient
                    to_flat[start + m] += weight * share[m]
        to_places[i] = 0
        inside_x, inside_y, inside_z = (
            1 <= places[i, 0] <= nx - 2,
            1 <= places[i, 1] <= ny - 2,
            1 <= places[i, 2] <= nz - 2,
        )
        for c in range(4):
            for k in range(3):
                to_places[i, 0] += inside_x * share[3 * c + k] * along_x[3 * c + k]
                to_places[i, 1] += inside_y * share[3 * c + k] * along_y[3 * c + k]
                to_places[i, 2] += inside_z * slopes[2, c] * grad_output[i, k] * along_z[3 * c + k]
