"""Sums of a kernel of two varifolds over pairs of points, compiled by numba.

The kernel of two positions x, y and two unit normals with the scalar product u is
``exp(−‖x − y‖² − s (1 − u)) (c₀ + c₁ u + c₂ u²)``. The numbers s, c₀, c₁ and c₂ are the argument ``angular``.

A measure has six rows: three of positions and three of normals. Its columns are ordered so that every block of
``BLOCK`` columns is compact in space. ``low`` and ``high`` are the corners of the boxes around the blocks. Pairs of a
point with a block farther away than ``reach`` are left out.

The loops over pairs become vector instructions only if they call no function of a library. The exponential is
therefore computed here: a polynomial for the fractional part of the exponent, a table for the integral part.
"""

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from meshot._kernels import inner, kernel

#: Number of columns in a block.
BLOCK = 64
_ROWS = 16  # number of points whose sums are computed together
_PER_E = np.log2(np.e)
_MOST = 120.0  # a larger exponent counts as this one: 2^-120 is nothing
_POWERS = 2.0 ** -np.arange(_MOST + 2)
_FRACTION = Chebyshev.interpolate(lambda x: 2.0**-x, 10, domain=[0, 1]).convert(kind=Polynomial).coef


@kernel("the kernel norm", 5)
def sum_kernel(x, start, stop, y, masses, low, high, reach, angular, above, sums, gradients):
    """Write the sums over the points of ``y``, weighted by ``masses``, for the points of ``x`` from start to stop."""
    # ``gradients`` receives the gradients of the sums in the six rows of ``x``, unless it is empty. With ``above``,
    # ``y`` is the same measure as ``x``, and a sum is over the points after the own one.
    runs = np.empty((low.shape[1], 2), np.int64)
    for first in range(start, stop, _ROWS):
        last = min(first + _ROWS, stop)
        for r in range(_near(x[:3, first:last], low, high, reach, runs)):
            begin, end = runs[r, 0] * BLOCK, min(runs[r, 1] * BLOCK, y.shape[1])
            for i in range(first, last):
                begin = max(begin, i + 1) if above else begin
                if gradients.size > 0:
                    sums[i] += _add_gradient(x, i, y, begin, end, masses, angular, gradients)
                else:
                    sums[i] += _sum(x, i, y, begin, end, masses, angular)


@inner(fastmath={"contract", "reassoc"})
def _sum(x, i, y, begin, end, masses, angular):
    """The sum for the point i over some points of ``y``."""
    sharpness, c0, c1, c2 = angular
    y0, y1, y2 = y[0, begin:end], y[1, begin:end], y[2, begin:end]
    n0, n1, n2 = y[3, begin:end], y[4, begin:end], y[5, begin:end]
    x0, x1, x2, m0, m1, m2, mass = x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i], masses[begin:end]
    total = 0.0
    for j in range(len(mass)):
        u = m0 * n0[j] + m1 * n1[j] + m2 * n2[j]
        squared = (x0 - y0[j]) ** 2 + (x1 - y1[j]) ** 2 + (x2 - y2[j]) ** 2
        total += mass[j] * _decay(squared + sharpness * (1 - u)) * (c0 + u * (c1 + u * c2))
    return total


@inner(fastmath={"contract", "reassoc"})
def _add_gradient(x, i, y, begin, end, masses, angular, gradients):
    """As ``_sum``, and add the gradients of the sum to the column i of ``gradients``."""
    sharpness, c0, c1, c2 = angular
    total, a0, a1, a2, b0, b1, b2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    y0, y1, y2 = y[0, begin:end], y[1, begin:end], y[2, begin:end]
    n0, n1, n2 = y[3, begin:end], y[4, begin:end], y[5, begin:end]
    x0, x1, x2, m0, m1, m2, mass = x[0, i], x[1, i], x[2, i], x[3, i], x[4, i], x[5, i], masses[begin:end]
    for j in range(len(mass)):
        d0, d1, d2 = x0 - y0[j], x1 - y1[j], x2 - y2[j]
        u = m0 * n0[j] + m1 * n1[j] + m2 * n2[j]
        decay = mass[j] * _decay(d0 * d0 + d1 * d1 + d2 * d2 + sharpness * (1 - u))
        value = decay * (c0 + u * (c1 + u * c2))
        slope = sharpness * value + decay * (c1 + 2 * u * c2)  # the derivative in u
        total += value
        a0, a1, a2 = a0 + value * d0, a1 + value * d1, a2 + value * d2
        b0, b1, b2 = b0 + slope * n0[j], b1 + slope * n1[j], b2 + slope * n2[j]
    for k, part in enumerate((-2 * a0, -2 * a1, -2 * a2, b0, b1, b2)):
        gradients[k, i] += part
    return total


@inner()
def _near(points, low, high, reach, runs):
    """Write the runs of consecutive blocks within the reach of the box around some points; return their number."""
    count, inside = 0, False
    least, most = np.empty(3), np.empty(3)
    for k in range(3):
        least[k], most[k] = points[k].min(), points[k].max()
    for block in range(low.shape[1]):
        squared = 0.0
        for k in range(3):
            gap = max(least[k] - high[k, block], low[k, block] - most[k], 0.0)
            squared += gap * gap
        was_inside, inside = inside, squared <= reach * reach
        if inside and not was_inside:
            runs[count, 0] = block
            count += 1
        if inside:
            runs[count - 1, 1] = block + 1
    return count


@inner()
def _decay(exponent):
    """exp(−exponent), for an exponent ≥ 0."""
    exponent = exponent * _PER_E
    exponent = exponent if exponent < _MOST else _MOST
    whole = int(exponent)
    x, value = exponent - whole, _FRACTION[10]
    for k in range(9, -1, -1):
        value = value * x + _FRACTION[k]
    return value * _POWERS[whole]
