"""Optimal transport between two distributions on a line, by a simultaneous pass over both quantile functions.

The pass is divided where either function enters a new cell. Within a cell, let ξ be a fraction of its extent, from the
left, and ζ the fraction of its mass on it: ζ = (1 − a)ξ + aξ², where a is the relative change of density. The density
relative to its mean is r = 1 − a + 2aξ = √((1 − a)² + 4aζ). A part of a cell is again such a cell. On a merged piece of
mass dz, x = x₀ + ds·σ and y = y₀ + dt·η, where σ and η solve (1 − a)σ + aσ² = ζ = (1 − b)η + bη². With η = σ + e this
becomes e·(1 − b + 2bσ + be) = (b − a)σ(1 − σ), so that

    x − y = d + (ds − dt)σ − dt·e,    dζ = (1 − a + 2aσ) dσ,

without avoidable cancellation. The value is a sum of squares with positive weights. Gauss–Legendre quadrature in σ is
accurate to roundoff for small a and b (the integrand is analytic up to 1/max(|a|, |b|)). Steeper pieces are halved.
The gradient needs the moments of the potential's slope φ′ over every cell: 2(x − y) for p = 2, sign(x − y) for p = 1.
"""

from typing import no_type_check

import numpy as np
from numba import njit

from meshot._kernels import INNER, kernel

_inner = INNER | {"error_model": "numpy", "forceinline": True}
_FLAT, _STEEP = 4e-3, 0.1  # largest changes of density for which four and eight nodes are accurate to roundoff
_HALVINGS = 14  # if the density starts at zero, the first 2⁻¹⁴ of the extent has 2⁻²⁸ of the mass
_NODES_4, _WEIGHTS_4 = (1 + np.polynomial.legendre.leggauss(4)[0]) / 2, np.polynomial.legendre.leggauss(4)[1] / 2
_NODES_8, _WEIGHTS_8 = (1 + np.polynomial.legendre.leggauss(8)[0]) / 2, np.polynomial.legendre.leggauss(8)[1] / 2


@njit(**_inner)
@no_type_check
def _place(change, share):
    """The fraction ξ of the extent that has the fraction ζ of the mass: (1 − a)ξ + aξ² = ζ, without cancellation."""
    below = 1 - change
    total = below + np.sqrt(max(below * below + 4 * change * share, 0.0))
    return min(2 * share / total, 1.0) if total > 0 else 0.0


@njit(**_inner)
@no_type_check
def _piece(step, share, left, last, change, density, at):
    """The part of a cell with the next ``step`` of its mass: its extent, its change, and the density at its end.

    For a density that decreases, the end is computed from the mass ``left`` behind the part; for one that increases,
    from the ``share`` up to its end. The other way round, digits would cancel.
    """
    if last:
        next_density, extent = 1 + change, 1 - at
    elif change == 0:
        return min(step, 1 - at), 0.0, 1.0
    else:
        squared = (1 - change) ** 2 + 4 * change * share if change > 0 else (1 + change) ** 2 - 4 * change * left
        next_density = np.sqrt(squared)
        total = density + next_density
        extent = min(2 * step / total, 1 - at) if total > 0 else 0.0
    total = density + next_density
    inner = min(max(2 * change * extent / total, -1.0), 1.0) if total > 0 else 0.0
    return extent, inner, next_density


@njit(**_inner)
@no_type_check
def _cut(piece, share):
    """Divide a merged piece into two at a fraction of its mass."""
    d, ds, dt, a, b, dz, at, part, at_target, part_target = piece
    s, t = _place(a, share), _place(b, share)
    below, below_target = 1 - a + a * s, 1 - b + b * t
    above, above_target = 1 + a * s, 1 + b * t
    first = (
        d, ds * s, dt * t,
        a * s / below if below > 0 else 0.0, b * t / below_target if below_target > 0 else 0.0,
        dz * share, at, part * s, at_target, part_target * t,
    )  # fmt: skip
    second = (
        d + ds * s - dt * t, ds * (1 - s), dt * (1 - t),
        a * (1 - s) / above if above > 0 else 0.0, b * (1 - t) / above_target if above_target > 0 else 0.0,
        dz * (1 - share), at + part * s, part * (1 - s), at_target + part_target * t, part_target * (1 - t),
    )  # fmt: skip
    return first, second


@njit(**_inner)
@no_type_check
def _add_moments(moments, weight, slope, at):
    moments[0] += weight * slope
    moments[1] += weight * slope * at
    moments[2] += weight * slope * at * at


@njit(**_inner)
@no_type_check
def _squared(piece, nodes, weights, atoms, wanted, moments, moments_target):
    """∫(x − y)² dz over a piece of small slope. Also adds the moments of ±2(x − y) against dx, or dz at atoms."""
    d, ds, dt, a, b, dz, at, part, at_target, part_target = piece
    cost = 0.0
    for k in range(len(nodes)):
        s = nodes[k]
        rise, density = (b - a) * s * (1 - s), 1 - b + 2 * b * s
        e = 2 * rise / (density + np.sqrt(density * density + 4 * b * rise))
        gap = d + (ds - dt) * s - dt * e
        of_mass = weights[k] * (1 - a + 2 * a * s)
        cost += dz * of_mass * gap * gap
        if wanted[0]:
            _add_moments(moments, dz * of_mass if atoms[0] else ds * weights[k], 2 * gap, at + part * s)
        if wanted[1]:
            t = s + e
            weight = dz * of_mass if atoms[1] else dt * of_mass / (1 - b + 2 * b * t)
            _add_moments(moments_target, weight, -2 * gap, at_target + part_target * t)
    return cost


@njit(error_model="numpy", **INNER)
@no_type_check
def _squared_halved(piece, atoms, wanted, moments, moments_target):
    """∫(x − y)² dz over any piece, halved along its steeper side until its slope is small."""
    waiting, halvings = [piece], [0]
    cost = 0.0
    while waiting:  # at most 2¹⁵ times, since the number of halvings is limited
        piece, done = waiting.pop(), halvings.pop()
        a, b = piece[3], piece[4]
        if done == _HALVINGS or max(abs(a), abs(b)) <= _STEEP:
            cost += _squared(piece, _NODES_8, _WEIGHTS_8, atoms, wanted, moments, moments_target)
        else:
            for half in _cut(piece, 0.5 - (a if abs(a) > abs(b) else b) / 4):
                waiting.append(half)
                halvings.append(done + 1)
    return cost


@njit(**_inner)
@no_type_check
def _crossings(d, ds, dt, a, b):
    """The solutions of x = y, as fractions of the extent ds >= dt in ascending order; 2 stands for no solution."""
    if dt == 0:
        return -d / ds, 2.0
    # η = (d + ds σ)/dt in (1 − a)σ + aσ² = (1 − b)η + bη²
    c2 = a * dt * dt - b * ds * ds
    c1 = (1 - a) * dt * dt - (1 - b) * dt * ds - 2 * b * d * ds
    c0 = -(1 - b) * dt * d - b * d * d
    root = -(c1 + np.copysign(np.sqrt(max(c1 * c1 - 4 * c2 * c0, 0.0)), c1)) / 2
    one = root / c2 if c2 != 0 else 2.0
    other = c0 / root if root != 0 else 2.0
    return min(one, other), max(one, other)


@njit(**_inner)
@no_type_check
def _signed(piece, tie, atoms, wanted, moments, moments_target):
    """|∫(x − y) dz| over a piece on which x − y does not change sign. Within roundoff of zero the sign is zero."""
    d, ds, dt, a, b, dz, at, part, at_target, part_target = piece
    mean = d + ds * (0.5 + a / 6) - dt * (0.5 + b / 6)
    sign = np.sign(mean) if abs(mean) > tie else 0.0
    if wanted[0]:
        _add_extent(moments, dz if atoms[0] else ds, sign, at, part)
    if wanted[1]:
        _add_extent(moments_target, dz if atoms[1] else dt, -sign, at_target, part_target)
    return dz * abs(mean)


@njit(**_inner)
@no_type_check
def _add_extent(moments, weight, sign, at, part):
    moments[0] += weight * sign
    moments[1] += weight * sign * (at + part / 2)
    moments[2] += weight * sign * (at * (at + part) + part * part / 3)


@njit(**_inner)
@no_type_check
def _absolute(piece, tie, atoms, wanted, moments, moments_target):
    """∫|x − y| dz over a piece, divided where x = y."""
    d, ds, dt, a, b = piece[:5]
    if d - dt >= 0 or d + ds <= 0:
        return _signed(piece, tie, atoms, wanted, moments, moments_target)
    if ds >= dt:
        one, other, change = *_crossings(d, ds, dt, a, b), a
    else:
        one, other, change = *_crossings(-d, dt, ds, b, a), b
    cost, done, rest = 0.0, 0.0, piece
    for place in (one, other):
        if 0 < place < 1:
            share = place * (1 - change + change * place)
            if done < share < 1:
                first, rest = _cut(rest, (share - done) / (1 - done))
                cost += _signed(first, tie, atoms, wanted, moments, moments_target)
                done = share
    return cost + _signed(rest, tie, atoms, wanted, moments, moments_target)


@kernel("the exact sliced loss", 15, error_model="numpy")
@no_type_check
def walk(power, source, target, wanted, moments, moments_target):
    """W_p^p between two distributions (x, extent, mass, change), and the moments of φ′ over the cells if ``wanted``.

    The moments are ∫φ′ξᵏ dx for k = 0, 1, 2, where ξ goes from 0 to 1 across the cell. At an atom the first is ∫φ′ dz.

    Raises
    ------
    ValueError
        If a mass is NaN, so that the pass does not reach the end of both distributions.
    """
    x, dx, mass, change = source
    y, dy, mass_target, change_target = target
    tie = 1e-14 * max(abs(x[0]), abs(x[-1]), abs(y[0]), abs(y[-1]))
    i, j, cost = 0, 0, 0.0
    left, share, at, density = mass[0], 0.0, 0.0, 1 - change[0]
    left_target, share_target, at_target, density_target = mass_target[0], 0.0, 0.0, 1 - change_target[0]
    for _ in range(len(x) + len(y) - 2):  # every step completes a cell of at least one side
        if i == len(x) - 1 and j == len(y) - 1:
            break
        last, last_target = left <= left_target, left_target <= left
        dz = min(left, left_target)
        left, left_target = left - dz, left_target - dz
        step = dz / mass[i] if mass[i] > 0 else 1.0
        share += step
        part, a, density = _piece(step, share, left / mass[i], last, change[i], density, at)
        step = dz / mass_target[j] if mass_target[j] > 0 else 1.0
        share_target += step
        part_target, b, density_target = _piece(
            step, share_target, left_target / mass_target[j], last_target, change_target[j], density_target, at_target
        )
        d = x[i] + dx[i] * at - y[j] - dy[j] * at_target
        piece = (d, dx[i] * part, dy[j] * part_target, a, b, dz, at, part, at_target, part_target)
        atoms = (dx[i] == 0, dy[j] == 0)
        if power == 1:
            cost += _absolute(piece, tie, atoms, wanted, moments[i], moments_target[j])
        elif max(abs(a), abs(b)) <= _FLAT:
            cost += _squared(piece, _NODES_4, _WEIGHTS_4, atoms, wanted, moments[i], moments_target[j])
        else:
            cost += _squared_halved(piece, atoms, wanted, moments[i], moments_target[j])
        at, at_target = at + part, at_target + part_target
        if last:
            i += 1
            left, share, at, density = mass[i], 0.0, 0.0, 1 - change[i]
        if last_target:
            j += 1
            left_target, share_target, at_target, density_target = mass_target[j], 0.0, 0.0, 1 - change_target[j]
    if i < len(x) - 1 or j < len(y) - 1:
        raise ValueError("the pass over two distributions did not reach their ends: a mass is NaN; it must be finite")
    return cost
