"""The distribution of a projected surface on a line, accurate to roundoff for any orientation of the faces.

A triangle of mass w with projections p₁ ≤ p₂ ≤ p₃ has a tent-shaped density. It rises linearly from p₁ to the value
J = 2w/(p₃ − p₁) at p₂ and falls linearly to p₃, in proportion to the length of the triangle's sections. A segment has a
constant density. The sum over all triangles is linear between neighbouring breakpoints. A cell of the distribution
therefore has a start, an extent, a mass, and a relative change of density a = (f₁ − f₀)/(f₁ + f₀) in [−1, 1].

Pieces of small slope are added as jumps of slope and density, which are summed from left to right, in O(1) per corner.
A face nearly perpendicular to the direction has the slope w/h² with h → 0, and such sums would keep its rounding error.
Pieces of large slope are instead added to O(log V) nodes of a binary tree over the intervals, as densities at both
ends, and passed down to the leaves. These are sums of positive numbers, accurate to a few units in the last place.
"""

import math

import numpy as np

from meshot._kernels import inner, kernel

_inner = inner(error_model="numpy", forceinline=True)
_GENTLE = 16.0  # largest slope of the pieces that are summed from left to right, in units of mass/extent²


@_inner
def _three_in_order(i, j, k):
    """Three ranks in ascending order."""
    if i > j:
        i, j = j, i
    if j > k:
        j, k = k, j
    if i > j:
        i, j = j, i
    return i, j, k


@_inner
def _spread(tree, size, x, first, last, base, slope, centre):
    """Add the density base + slope · (x − centre) on the intervals [first, last) to the nodes that cover them."""
    low, high, width = first + size, last + size, 1
    while low < high:
        if low & 1:
            tree[low, 0] += base + slope * (x[first] - centre)
            first += width
            tree[low, 1] += base + slope * (x[first] - centre)
            low += 1
        if high & 1:
            high -= 1
            tree[high, 1] += base + slope * (x[last] - centre)
            last -= width
            tree[high, 0] += base + slope * (x[last] - centre)
        low >>= 1
        high >>= 1
        width <<= 1


@_inner
def _push_down(tree, size, x, n):
    """Add the densities of every node to its two children, down to the leaves."""
    width = size
    while width > 1:
        half = width >> 1
        node = size // width
        for start in range(0, n, width):
            if start + width <= n:
                low, middle, high = x[start], x[start + half], x[start + width]
                share = (middle - low) / (high - low) if high > low else 0.5
                between = tree[node, 0] * (1 - share) + tree[node, 1] * share
                tree[2 * node, 0] += tree[node, 0]
                tree[2 * node, 1] += between
                tree[2 * node + 1, 0] += between
                tree[2 * node + 1, 1] += tree[node, 1]
            node += 1
        width = half


@_inner
def _on_grid(slope, grid):
    """The slope rounded to the last place of ``grid``. Sums of such slopes are exact while they stay below ``grid``."""
    return (slope + grid) - grid


@_inner
def _lay_triangles(tree, size, x, rank, cells, weights, mass, jumps, limit):
    grid = 4 * limit
    for k in range(len(cells)):
        i, j, m = _three_in_order(rank[cells[k, 0]], rank[cells[k, 1]], rank[cells[k, 2]])
        up, down, height = x[j] - x[i], x[m] - x[j], x[m] - x[i]
        if height == 0:
            mass[i] += weights[k]
            continue
        peak = 2 * weights[k] / height
        if peak == 0:  # no mass: with two coincident corners the slope would be 0/0
            continue
        if peak <= limit * up and peak <= limit * down:
            rise, fall = _on_grid(peak / up, grid), _on_grid(peak / down, grid)
            jumps[i, 0] += rise
            jumps[j, 0] -= rise + fall
            jumps[m, 0] += fall
            jumps[m, 1] += fall * down - rise * up
            continue
        if peak <= limit * up:
            rise = _on_grid(peak / up, grid)
            jumps[i, 0] += rise
            jumps[j, 0] -= rise
            jumps[j, 1] -= rise * up
        elif up > 0:
            _spread(tree, size, x, i, j, 0.0, peak / up, x[i])
        if peak <= limit * down:
            fall = _on_grid(peak / down, grid)
            jumps[j, 1] += fall * down
            jumps[j, 0] -= fall
            jumps[m, 0] += fall
        elif down > 0:
            _spread(tree, size, x, j, m, 0.0, -peak / down, x[m])


@_inner
def _lay_segments(tree, size, x, rank, cells, weights, mass):
    for k in range(len(cells)):
        i, j = rank[cells[k, 0]], rank[cells[k, 1]]
        i, j = min(i, j), max(i, j)
        if x[j] > x[i]:
            _spread(tree, size, x, i, j, weights[k] / (x[j] - x[i]), 0.0, 0.0)
        else:
            mass[i] += weights[k]


@_inner
def _add(total, lost, term):
    """Kahan summation: the new total, and its excess over the exact one."""
    term -= lost
    larger = total + term
    return larger, (larger - total) - term


@_inner
def _place(projected, order, rank, x):
    """Sort the projections, store the rank of each, and return the extent of the distribution."""
    n = len(projected) - 1
    tiny = 1e-100 * max(abs(projected[order[0]]), abs(projected[order[n]]))  # keeps w/h² finite
    for i in range(n + 1):
        place = projected[order[i]]
        x[i] = place if abs(place) > tiny else 0.0
        rank[order[i]] = i
    return x[n] - x[0]


@_inner
def _share(mass):
    """Divide masses by their sum; raise an error if the sum is NaN, infinite or zero."""
    total = mass.sum()
    if not (total > 0 and total < np.inf):
        raise ValueError(
            "the law of a projected measure has a mass that is NaN, infinite or zero; the coordinates are too large or "
            "too small for float64: scale both measures to a size of about 1"
        )
    for i in range(len(mass)):
        mass[i] /= total


@kernel("the exact sliced loss", 15, error_model="numpy")
def lay_surface(projected, order, cells, weights, rank, tree, jumps, x, extent, mass, change):
    """Write the cells of the distribution of a projected surface: one per interval between neighbouring vertices."""
    # A face perpendicular to the direction becomes an atom: mass on the first interval of zero extent between its
    # corners. The last cell is a sentinel, which takes all mass that is left over by rounding.
    n, size = len(projected) - 1, len(tree) // 2
    length = _place(projected, order, rank, x)
    tree[:], jumps[:], mass[:] = 0, 0, 0
    if cells.shape[1] == 3:
        limit = _GENTLE / (length * length) if length > 0 else 0.0
        _lay_triangles(tree, size, x, rank, cells, weights, mass, jumps, limit)
    else:
        _lay_segments(tree, size, x, rank, cells, weights, mass)
    _push_down(tree, size, x, n)
    slope, density, lost = 0.0, 0.0, 0.0
    for i in range(n):
        extent[i] = x[i + 1] - x[i]
        slope += jumps[i, 0]
        density, lost = _add(density, lost, jumps[i, 1])
        start = max(tree[size + i, 0] + density, 0.0)
        density, lost = _add(density, lost, slope * extent[i])
        end = max(tree[size + i, 1] + density, 0.0)
        mass[i] += (start + end) / 2 * extent[i]
        change[i] = (end - start) / (end + start) if extent[i] > 0 and end + start > 0 else 0.0
    _share(mass[:n])
    extent[n], mass[n], change[n] = 0.0, np.inf, 0.0


@kernel("the exact sliced loss", 15, error_model="numpy")
def lay_points(projected, order, weights, x, extent, mass, change):
    """Write the cells of the distribution of projected points: atoms, each followed by a gap, and the sentinel."""
    n = len(projected)
    mass[:] = 0
    change[:] = 0
    extent[:] = 0
    for i in range(n):
        x[2 * i] = x[2 * i + 1] = projected[order[i]]
        mass[2 * i] = weights[order[i]]
        extent[2 * i + 1] = projected[order[min(i + 1, n - 1)]] - projected[order[i]]
    _share(mass[: 2 * n])
    x[2 * n], mass[2 * n] = x[2 * n - 1], np.inf


# Optimal transport between two distributions on a line, by a simultaneous pass over both quantile functions.
#
# The pass is divided where either function enters a new cell. Within a cell, let ξ be a fraction of its extent, from
# the left, and ζ the fraction of its mass on it: ζ = (1 − a)ξ + aξ², where a is the relative change of density. The
# density relative to its mean is r = 1 − a + 2aξ = √((1 − a)² + 4aζ). A part of a cell is again such a cell. On a
# merged piece of mass dz, x = x₀ + ds·σ and y = y₀ + dt·η, where σ and η solve (1 − a)σ + aσ² = ζ = (1 − b)η + bη².
# With η = σ + e this becomes e·(1 − b + 2bσ + be) = (b − a)σ(1 − σ), so that
#
#     x − y = d + (ds − dt)σ − dt·e,    dζ = (1 − a + 2aσ) dσ,
#
# without avoidable cancellation. The value is a sum of squares with positive weights. Gauss–Legendre quadrature in σ is
# accurate to roundoff for small a and b (the integrand is analytic up to 1/max(|a|, |b|)). Steeper pieces are halved.
# The gradient needs the moments of the potential's slope φ′ over every cell: 2(x − y) for p = 2, sign(x − y) for p = 1.

_FLAT, _STEEP = 4e-3, 0.1  # largest changes of density for which four and eight nodes are accurate to roundoff
_HALVINGS = 14  # if the density starts at zero, the first 2⁻¹⁴ of the extent has 2⁻²⁸ of the mass
_NODES_4, _WEIGHTS_4 = (1 + np.polynomial.legendre.leggauss(4)[0]) / 2, np.polynomial.legendre.leggauss(4)[1] / 2
_NODES_8, _WEIGHTS_8 = (1 + np.polynomial.legendre.leggauss(8)[0]) / 2, np.polynomial.legendre.leggauss(8)[1] / 2


@_inner
def _position_of_share(change, share):
    """The fraction ξ of the extent that has the fraction ζ of the mass: (1 − a)ξ + aξ² = ζ, without cancellation."""
    below = 1 - change
    total = below + np.sqrt(max(below * below + 4 * change * share, 0.0))
    return min(2 * share / total, 1.0) if total > 0 else 0.0


@_inner
def _piece(step, share, left, last, change, density, at):
    """The part of a cell with the next ``step`` of its mass: its extent, its change, and the density at its end."""
    # For a density that decreases, the end is computed from the mass ``left`` behind the part; for one that increases,
    # from the ``share`` up to its end. The other way round, digits would cancel.
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


@_inner
def _cut(piece, share):
    """Divide a merged piece into two at a fraction of its mass."""
    d, ds, dt, a, b, dz, at, part, at_target, part_target = piece
    s, t = _position_of_share(a, share), _position_of_share(b, share)
    below, below_target = 1 - a + a * s, 1 - b + b * t
    above, above_target = 1 + a * s, 1 + b * t
    change, change_target = a * s / below if below > 0 else 0.0, b * t / below_target if below_target > 0 else 0.0
    first = (d, ds * s, dt * t, change, change_target, dz * share, at, part * s, at_target, part_target * t)
    change = a * (1 - s) / above if above > 0 else 0.0
    change_target = b * (1 - t) / above_target if above_target > 0 else 0.0
    rest = (dz * (1 - share), at + part * s, part * (1 - s), at_target + part_target * t, part_target * (1 - t))
    second = (d + ds * s - dt * t, ds * (1 - s), dt * (1 - t), change, change_target, *rest)
    return first, second


@_inner
def _add_moments(moments, weight, slope, at):
    moments[0] += weight * slope
    moments[1] += weight * slope * at
    moments[2] += weight * slope * at * at


@_inner
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


@inner(error_model="numpy")
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


@_inner
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


@_inner
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


@_inner
def _add_extent(moments, weight, sign, at, part):
    moments[0] += weight * sign
    moments[1] += weight * sign * (at + part / 2)
    moments[2] += weight * sign * (at * (at + part) + part * part / 3)


@_inner
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
def walk(power, source, target, wanted, moments, moments_target):
    """W_p^p between two distributions (x, extent, mass, change), and the moments of φ′ over the cells if ``wanted``."""
    # The moments are ∫φ′ξᵏ dx for k = 0, 1, 2, where ξ goes from 0 to 1 across the cell. At an atom the first is ∫φ′
    # dz.
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


# The gradient of 1D transport between projected measures, from moments of the potential's slope over the cells.
#
# Let φ be the optimal potential. Moving a projected vertex changes the cost at the rate w·E[bφ′] for each triangle of
# mass w at it, where b is the barycentric weight of the vertex and E the mean over the triangle. Changing the mass of a
# triangle by dw changes the cost by E[φ] dw. On the rising piece let u go from 0 to 1 between p₁ and p₂. The density is
# J·u (J = 2/(p₃ − p₁) at mass one), and the section at u connects the point u on the edge p₁p₂ with the point u·h₁/H on
# the edge p₁p₃. The means of b over the section are therefore linear in u. The falling piece is analogous, with v from
# 0 to 1 between p₃ and p₂. So only M₁ = ∫φ′u dx and M₂ = ∫φ′u² dx over both pieces are needed. By integration by parts,
# E[φ] = φ(p₂) + (J/2)(h₂·M₂(v) − h₁·M₂(u)).
#
# Differences of antiderivatives of φ would lose precision on short pieces, by a factor of 1/h² or 1/h³. The moments are
# taken from a disjoint sparse table instead. At the highest binary digit in which the first and the last interval of a
# piece differ, there is a multiple of that power of two between them, called the pivot. Moments are summed outwards
# from all such pivots. Two entries then give the moments of the piece, and no sum extends beyond it. One level of the
# table is stored at a time.


@_inner
def _split(x, rank, cells, ends):
    """Write the first and last rank of both pieces of every cell: rising and falling, or the single piece twice."""
    for k in range(len(cells)):
        low, high = rank[cells[k, 0]], rank[cells[k, 1]]
        low, high = min(low, high), max(low, high)
        middle = high
        if cells.shape[1] == 3:
            other = rank[cells[k, 2]]
            low, middle, high = min(low, other), max(low, min(high, other)), max(high, other)
        ends[2 * k, 0], ends[2 * k, 1] = low, middle
        ends[2 * k + 1, 0], ends[2 * k + 1, 1] = (low, high) if cells.shape[1] == 2 else (middle, high)


@_inner
def _level(first, last):
    """The number of binary digits up to the highest one in which the first and the last interval differ."""
    return math.frexp(float(first ^ (last - 1)))[1]


@_inner
def _by_level(x, ends, order, starts, longest):
    """Sort the pieces of positive extent by level (counting sort); find the longest of each level, in intervals."""
    starts[:] = 0
    longest[:] = 0
    for piece in range(len(ends)):
        first, last = ends[piece]
        if x[last] > x[first]:
            level = _level(first, last)
            starts[level + 2] += 1
            longest[level] = max(longest[level], last - first)
    for level in range(len(starts) - 1):
        starts[level + 1] += starts[level]
    for piece in range(len(ends)):
        first, last = ends[piece]
        if x[last] > x[first]:
            level = _level(first, last)
            order[starts[level + 1]] = piece
            starts[level + 1] += 1


@_inner
def _sum_outward(x, extent, moments, pivot, start, stop, step, table):
    """Write ∫φ′|x − x_pivot|ᵏ dx from the pivot to the far end of each interval, starting with ``start``."""
    zero, one, two = 0.0, 0.0, 0.0
    for i in range(start, stop, step):
        width = extent[i] * step
        if width != 0:
            offset = (x[i] - x[pivot]) * step
            zero += moments[i, 0]
            one += offset * moments[i, 0] + width * moments[i, 1]
            two += offset * offset * moments[i, 0] + 2 * offset * width * moments[i, 1] + width * width * moments[i, 2]
        table[i, 0], table[i, 1], table[i, 2] = zero, one, two


@_inner
def _fill(x, extent, moments, level, reach, table):
    """Fill one level of the table. At level zero every entry covers one interval."""
    n = len(x) - 1
    half = 1 << (level - 1) if level > 0 else 1
    if level == 0:
        for i in range(n):
            _sum_outward(x, extent, moments, i, i, i + 1, 1, table)
    else:
        for pivot in range(half, n, 2 * half):
            _sum_outward(x, extent, moments, pivot, pivot - 1, pivot - 1 - min(half, reach), -1, table)
            _sum_outward(x, extent, moments, pivot, pivot, min(pivot + min(half, reach), n), 1, table)


@_inner
def _look_up(x, ends, pieces, level, table, sums):
    """Write ∫φ′u dx and ∫φ′u² dx of the pieces of one level. u rises on even pieces and falls on odd ones."""
    for piece in pieces:
        first, last = ends[piece]
        scale = 1 / (x[last] - x[first]) if piece & 1 == 0 else -1 / (x[last] - x[first])
        centre = x[first] if piece & 1 == 0 else x[last]
        right = table[last - 1]
        zero, one, two = right[0], right[1], right[2]
        pivot = first
        if level > 0:
            pivot = ((last - 1) >> (level - 1)) << (level - 1)
            left = table[first]
            zero, one, two = zero + left[0], one - left[1], two + left[2]
        u = (x[pivot] - centre) * scale
        sums[piece, 0] = u * zero + scale * one
        sums[piece, 1] = u * (u * zero + 2 * scale * one) + scale * scale * two


@_inner
def _sum_pieces(law, moments, rank, cells, ends, order, starts, longest, table, sums):
    x, extent = law[0], law[1]
    _split(x, rank, cells, ends)
    _by_level(x, ends, order, starts, longest)
    sums[:] = 0
    for level in range(len(longest)):
        if starts[level + 1] > starts[level]:
            _fill(x, extent, moments, level, longest[level], table)
            _look_up(x, ends, order[starts[level] : starts[level + 1]], level, table, sums)


@_inner
def _triangle_gradient(x, i, j, m, rising, falling, weight, gradient):
    """Write w·E[bφ′] for the corners, in order, and return E[φ] − φ(p₂)."""
    height = x[m] - x[i]
    up, down, tent = (x[j] - x[i]) / height, (x[m] - x[j]) / height, weight / height  # tent: half the peak J
    low, high = rising[1] * up, falling[1] * down
    gradient[0] = tent * (2 * rising[0] - rising[1] - low + high)
    gradient[1] = tent * (rising[1] + falling[1])
    gradient[2] = tent * (low + 2 * falling[0] - falling[1] - high)
    return high - low


@_inner
def _in_order(cell, rank, at):
    """Write the corners of a cell in ascending order of their projections."""
    for c in range(len(cell)):
        at[c] = cell[c]
    for c in range(len(cell) * (len(cell) - 1) // 2):  # compare 0 and 1, then 1 and 2, then 0 and 1
        left = c & 1
        if rank[at[left]] > rank[at[left + 1]]:
            at[left], at[left + 1] = at[left + 1], at[left]


@_inner
def _potential(moments, extent, potential):
    """Write φ at the starts of the cells, with φ = 0 at the first."""
    potential[0] = 0.0
    for i in range(len(moments) - 1):
        potential[i + 1] = potential[i] + (moments[i, 0] if extent[i] > 0 else 0.0)


@kernel("the exact sliced loss", 15, error_model="numpy")
def surface_gradient(law, moments, cells, weights, rank, work, to_projected, to_weights):
    """Write the gradient in the projected vertices, and add the gradient in the weights, for one direction."""
    # If a cell is perpendicular to the direction, its mass may be transported to several positions. The cost then has a
    # kink, and the result is the mean of φ′ over the mass, which lies between the one-sided derivatives.
    x, extent, mass, _ = law
    ends, order, starts, longest, table, sums, potential = work
    corners = cells.shape[1]
    _sum_pieces(law, moments, rank, cells, ends, order, starts, longest, table, sums)
    _potential(moments, extent, potential)
    to_projected[:] = 0
    total, mean, gradient, at = weights.sum(), 0.0, np.empty(3), np.empty(3, np.int64)
    for k in range(len(cells)):
        _in_order(cells[k], rank, at)
        first, middle, last = rank[at[0]], rank[at[1]], rank[at[corners - 1]]
        value, share = potential[middle], weights[k] / total
        if x[first] == x[last]:
            gradient[:] = share * moments[first, 0] / mass[first] / corners if mass[first] > 0 else 0.0
        elif corners == 3:
            value += _triangle_gradient(x, first, middle, last, sums[2 * k], sums[2 * k + 1], share, gradient)
        else:
            length = x[last] - x[first]
            gradient[0], gradient[1] = share * sums[2 * k + 1, 0] / length, share * sums[2 * k, 0] / length
            value -= sums[2 * k, 0]
        for c in range(corners):
            to_projected[at[c]] += gradient[c]
        to_weights[k] += value / total
        mean += share * value / total
    to_weights -= mean


@kernel("the exact sliced loss", 15, error_model="numpy")
def points_gradient(law, moments, order, weights, potential, to_projected, to_weights):
    """Write the gradient in the projected points, and add the gradient in the weights, for one direction."""
    _potential(moments, law[1], potential)
    total, mean = weights.sum(), 0.0
    for i in range(len(order)):
        to_projected[order[i]] = moments[2 * i, 0]
        mean += weights[order[i]] * potential[2 * i] / total
    for i in range(len(order)):
        to_weights[order[i]] += (potential[2 * i] - mean) / total
