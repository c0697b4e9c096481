"""Unbalanced transport on a line with the cost |x − y| and a Kullback–Leibler penalty, compiled by numba.

Let zᵥ be the distinct positions of both sides, ℓᵥ the gaps between them, aᵥ and bᵥ the masses there. The dual problem
is to maximise ``ρ Σ aᵥ (1 − exp(−fᵥ/ρ)) + bᵥ (1 − exp(fᵥ/ρ))`` subject to ``|fᵥ₊₁ − fᵥ| ≤ ℓᵥ``. A primal-dual
interior-point method solves it. The matrix of every Newton step is tridiagonal, so that a step takes O(n + m)
operations.
"""

import math

import numpy as np

from meshot._kernels import inner, kernel
from meshot.loss._kernel_sliced import add_up, project, sort

_TOLERANCE = 1e-10  # on the duality gap, relative to the value
_MOST = 200  # Newton steps; about 25 are usual


@kernel("the unbalanced loss", 8)
def unbalanced_lines(directions, group, scale, x, y, costs, tops):
    """Write the unbalanced cost along every direction, and the gradients, as ``walk_lines`` does for transport."""
    # ``scale`` is ρ. The gradients in the weights are ρ (1 − exp(−f/ρ)) for the source, ρ (1 − exp(f/ρ)) for the
    # target.
    n, m = len(x[1]), len(y[1])
    nodes, masses, work = np.empty((2, max(n, m)), np.int64), np.empty((2, n + m)), np.empty((10, n + m))
    for start in range(0, len(directions), group):
        lines = directions[start : start + group]
        project(x[0], lines, x[2])
        project(y[0], lines, y[2])
        for k in range(len(lines)):
            sorted_masses(y[2][k], y[1], y[3], y[5], y[4], y[8])
            sorted_masses(x[2][k], x[1], x[3], x[5], x[4], x[8])
            size = _place(x[3], x[4], n, y[3], y[4], m, nodes, masses, work[0])
            costs[start + k] = _solve(masses[0][:size], masses[1][:size], scale, work)
            flows, potentials = work[1][: size - 1], work[2][:size]
            if len(x[6]) > 0:
                _write(1.0, x[5], nodes[0][:n], flows, potentials, scale, x[6][k], x[7][k])
            if len(y[6]) > 0:
                _write(-1.0, y[5], nodes[1][:m], flows, potentials, scale, y[6][k], y[7][k])
        add_up(x, lines)
        add_up(y, lines)


@inner()
def _place(x, x_masses, n, y, y_masses, m, nodes, masses, gaps):
    """The distinct positions in ascending order: gaps, masses of both sides, position of every point; their number."""
    i, j, node, last = 0, 0, -1, -np.inf
    for _ in range(n + m):
        of_x = j == m or (i < n and x[i] <= y[j])
        here = x[i] if of_x else y[j]
        if here > last:
            if node >= 0:
                gaps[node] = here - last
            node += 1
            masses[0, node], masses[1, node], last = 0.0, 0.0, here
        if of_x:
            masses[0, node] += x_masses[i]
            nodes[0, i] = node
            i += 1
        else:
            masses[1, node] += y_masses[j]
            nodes[1, j] = node
            j += 1
    return node + 1


@inner()
def _solve(a, b, scale, work):
    """The value. The gaps are the first row of ``work``; the flows |u| and the potentials are left in the next two."""
    # The constraints are f' − f ≤ ℓ with multipliers ``up`` and slacks ``above``, and f − f' ≤ ℓ with ``down`` and
    # ``below``.
    n = len(a)
    gaps, flows, f, up, down = work[0][:n], work[1][:n], work[2][:n], work[3][:n], work[4][:n]
    above, below, excess, weights, right = work[5][:n], work[6][:n], work[7][:n], work[8][:n], work[9][:n]
    f[:] = 0.0
    for v in range(n - 1):
        above[v] = below[v] = gaps[v]
        up[v] = down[v] = scale / n / gaps[v]
    value = 0.0
    for _ in range(_MOST):
        value, gap, unmet = _state(a, b, scale, f, up, down, above, below)
        if gap + scale * unmet <= _TOLERANCE * value + 1e-14 * scale:
            break
        target = 0.1 * gap / (2 * n)
        _eliminate(a, b, scale, f, up, down, above, below, target, excess, weights, right)
        step = _substitute(n, scale, up, down, above, below, target, excess, weights, right)
        _move(n, step, f, up, down, above, below, target, right, weights)
    for v in range(n - 1):
        flows[v] = up[v] + down[v]
    return value


@inner()
def _state(a, b, scale, f, up, down, above, below):
    """The dual value, the duality gap, and how far the flows are from meeting the masses."""
    value, gap, unmet, flow = 0.0, 0.0, 0.0, 0.0
    for v in range(len(a)):
        kept, kept_other = a[v] * math.exp(-f[v] / scale), b[v] * math.exp(f[v] / scale)
        value += scale * (a[v] - kept + b[v] - kept_other)
        excess = kept - kept_other - flow
        if v < len(a) - 1:
            flow = up[v] - down[v]
            excess += flow
            gap += up[v] * above[v] + down[v] * below[v]
        unmet += abs(excess)
    return value, gap, unmet


@inner()
def _eliminate(a, b, scale, f, up, down, above, below, target, excess, weights, right):
    """Forward elimination. A pivot is ``excess`` + ``weights``, both positive, so that nothing is cancelled."""
    before = 0.0
    for v in range(len(a)):
        kept, kept_other = a[v] * math.exp(-f[v] / scale), b[v] * math.exp(f[v] / scale)
        entry, curvature = kept - kept_other - before, (kept + kept_other) / scale
        if v > 0:
            share = weights[v - 1] / (excess[v - 1] + weights[v - 1])
            curvature += share * excess[v - 1]
            entry += share * right[v - 1]
        weights[v] = 0.0
        if v < len(a) - 1:
            weights[v] = up[v] / above[v] + down[v] / below[v]
            before = target / above[v] - target / below[v]
            entry += before
        excess[v], right[v] = curvature, entry


@inner()
def _substitute(n, scale, up, down, above, below, target, excess, weights, right):
    """Back substitution: ``right`` becomes the step in f, ``weights`` that in f' − f. Returns the part to take."""
    step, following = 1.0, right[n - 1] / excess[n - 1]
    right[n - 1], largest = following, abs(following)
    for v in range(n - 2, -1, -1):
        pivot = excess[v] + weights[v]
        rise = (excess[v] * following - right[v]) / pivot
        following = (right[v] + weights[v] * following) / pivot
        right[v], weights[v], largest = following, rise, max(largest, abs(following))
        ups, downs = target / above[v] + up[v] / above[v] * rise, target / below[v] - down[v] / below[v] * rise
        for value, change in ((above[v], -rise), (below[v], rise), (up[v], ups - up[v]), (down[v], downs - down[v])):
            if change * step < -0.95 * value:
                step = -0.95 * value / change
    return min(step, 2 * scale / largest) if largest > 0 else step


@inner()
def _move(n, step, f, up, down, above, below, target, right, rises):
    """Take a part of the step."""
    for v in range(n):
        f[v] += step * right[v]
    for v in range(n - 1):
        rise = rises[v]
        up[v] += step * (target / above[v] + up[v] / above[v] * rise - up[v])
        down[v] += step * (target / below[v] - down[v] / below[v] * rise - down[v])
        above[v] -= step * rise
        below[v] += step * rise


@inner()
def _write(sign, order, nodes, flows, potentials, scale, gradients, drops):
    """The derivatives in the positions, and minus those in the weights, for the points of one side."""
    for k in range(len(nodes)):
        v = nodes[k]
        before = flows[v - 1] if v > 0 else 0.0
        after = flows[v] if v < len(flows) else 0.0
        gradients[order[k]] = before - after
        if len(drops) > 0:
            drops[order[k]] = -scale * (1 - math.exp(-sign * potentials[v] / scale))


# Partial transport on a line with the cost |x − y|, exact for any masses, compiled by numba.
#
# Let M be the difference of both distribution functions, a step function with levels Mᵥ on intervals of length ℓᵥ. Let
# the cost of mass that is removed or added be λ = reach/2 per unit. The partial cost is then the minimum of ``Σ ℓᵥ |Mᵥ
# − wᵥ| + λ Σ |wᵥ₊₁ − wᵥ|`` over step functions w that vanish outside: the flow across an interval is Mᵥ − wᵥ, and a
# jump of w is mass that is removed or added there. This is denoising by total variation. It is solved by messages from
# left to right, whose derivatives are step functions with values in [−λ, λ]; two heaps hold their steps.


@kernel("the partial loss", 8)
def partial_lines(directions, group, reach, x, y, costs, tops):
    """Write the partial cost along every direction, and the gradients, as ``walk_lines`` does for transport."""
    # The gradient in the weights of the source is a potential f with values in [−λ, λ]; in those of the target it is
    # −f.
    n, m = len(x[1]), len(y[1])
    gaps, levels, low, high = np.empty(n + m), np.empty(n + m), np.empty(n + m), np.empty(n + m)
    flows, jumps = np.empty(n + m), np.empty(n + m)
    from_x, heaps = np.empty(n + m, np.bool_), np.empty((2, n + m), np.int32)
    for start in range(0, len(directions), group):
        lines = directions[start : start + group]
        project(x[0], lines, x[2])
        project(y[0], lines, y[2])
        for k in range(len(lines)):
            sorted_masses(y[2][k], y[1], y[3], y[5], y[4], y[8])
            sorted_masses(x[2][k], x[1], x[3], x[5], x[4], x[8])
            _merge(x[3], x[4], n, y[3], y[4], m, gaps, levels, from_x)
            _find_bounds(gaps, levels, reach, low, high, flows, heaps)
            costs[start + k] = _find_flows(gaps, levels, reach, low, high, flows, jumps)
            if len(x[6]) > 0 or len(y[6]) > 0:
                potentials = levels
                _find_potentials(gaps, flows, jumps, reach / 2, low, high, potentials)
                if len(x[6]) > 0:
                    _write_partial(True, from_x, x[5], flows, potentials, x[6][k], x[7][k])
                if len(y[6]) > 0:
                    _write_partial(False, from_x, y[5], flows, potentials, y[6][k], y[7][k])
        add_up(x, lines)
        add_up(y, lines)


@inner()
def sorted_masses(values, weights, steps, order, masses, scratch):
    """Positions and masses in ascending order. ``values`` may share memory with ``masses``, which is filled later."""
    n = len(weights)
    sort(values[:n], steps[:n], order[:n], scratch)
    for i in range(n):
        masses[i] = weights[order[i]]


@inner()
def _merge(x, x_masses, n, y, y_masses, m, gaps, levels, from_x):
    """The points of both sides in ascending order: gaps to the next, and the mass of x minus that of y so far."""
    i, j, level, last = 0, 0, 0.0, 0.0
    for k in range(n + m):
        from_x[k] = j == m or (i < n and x[i] <= y[j])
        if from_x[k]:
            here, mass, i = x[i], x_masses[i], i + 1
        else:
            here, mass, j = y[j], -y_masses[j], j + 1
        if k > 0:
            gaps[k - 1] = here - last
        level += mass
        levels[k], last = level, here
    gaps[n + m - 1] = 0.0
    levels[n + m - 1] = 0.0  # outside, where w vanishes


@inner()
def _find_bounds(gaps, levels, reach, low, high, rest, heaps):
    """The interval in which every w lies at best, whatever follows to the right."""
    # ``rest`` holds the height of the step of the derivative at each level. A gap adds a step of twice its length. Its
    # length is then cut off at either end, so that the heights sum to ``reach`` again.
    outside = len(levels) - 1
    rest[:] = 0.0
    rest[outside] = reach
    heaps[0, 0] = heaps[1, 0] = outside
    n_low, n_high, alive = 1, 1, 1
    for v in range(outside):
        if gaps[v] > 0:
            rest[v] = 2 * gaps[v]
            n_low = _push(heaps[0], n_low, levels, 1.0, v)
            n_high = _push(heaps[1], n_high, levels, -1.0, v)
            alive += 1
            n_low, alive = _cut(heaps[0], n_low, levels, 1.0, rest, gaps[v], alive)
            n_high, alive = _cut(heaps[1], n_high, levels, -1.0, rest, gaps[v], alive)
            n_low, alive = _cut(heaps[0], n_low, levels, 1.0, rest, 0.0, alive)
            if alive == 1:  # without roundoff
                rest[heaps[0, 0]] = reach
        low[v], high[v] = levels[heaps[0, 0]], levels[heaps[1, 0]]


@inner()
def _cut(heap, size, levels, sign, rest, amount, alive):
    """Reduce the first steps of a heap by ``amount`` in total, and drop those of height zero; one always remains."""
    while True:
        first = heap[0]
        if rest[first] > amount or (alive == 1 and rest[first] > 0):
            if alive > 1:
                rest[first] -= amount
            return size, alive
        if rest[first] > 0:
            amount -= rest[first]
            rest[first] = 0.0
            alive -= 1
        size = _pop(heap, size, levels, sign)


@inner()
def _push(heap, size, levels, sign, item):
    """Add an item to a heap that is ordered by level, ascending if the sign is 1, descending if it is −1."""
    child, key = size, sign * levels[item]
    while child > 0:
        parent = (child - 1) >> 1
        if sign * levels[heap[parent]] <= key:
            break
        heap[child] = heap[parent]
        child = parent
    heap[child] = item
    return size + 1


@inner()
def _pop(heap, size, levels, sign):
    """Remove the first item of a heap."""
    size -= 1
    item, parent = heap[size], 0
    key = sign * levels[item]
    while 2 * parent + 1 < size:
        child = 2 * parent + 1
        if child + 1 < size and sign * levels[heap[child + 1]] < sign * levels[heap[child]]:
            child += 1
        if sign * levels[heap[child]] >= key:
            break
        heap[parent] = heap[child]
        parent = child
    heap[parent] = item
    return size


@inner()
def _find_flows(gaps, levels, reach, low, high, flows, jumps):
    """The flow across every gap and the mass that is removed (> 0) or added at every point, from right to left."""
    w, total = 0.0, 0.0
    flows[-1] = 0.0
    for v in range(len(gaps) - 2, -1, -1):
        left = min(max(w, low[v]), high[v])
        flows[v], jumps[v + 1] = levels[v] - left, w - left
        total += gaps[v] * abs(flows[v]) + reach / 2 * abs(jumps[v + 1])
        w = left
    jumps[0] = w
    return total + reach / 2 * abs(w)


@inner()
def _find_potentials(gaps, flows, jumps, most, low, high, potentials):
    """A dual solution: it falls by the length of a gap along a flow, and is ±λ where mass is removed or added."""
    # From left to right, the interval of the values that are still possible; from right to left, a choice.
    a, b = -most, most
    for v in range(len(gaps)):
        if v > 0:
            falls = gaps[v - 1] * np.sign(flows[v - 1])
            spare = 0.0 if flows[v - 1] != 0 else gaps[v - 1]
            a, b = min(max(a - falls - spare, -most), most), max(min(b - falls + spare, most), -most)
        if jumps[v] != 0:
            a = b = most * np.sign(jumps[v])
        low[v], high[v] = min(a, b), max(a, b)
    value = (a + b) / 2
    for v in range(len(gaps) - 1, -1, -1):
        value = min(max(value + gaps[v] * np.sign(flows[v]), low[v]), high[v])
        potentials[v] = value


@inner()
def _write_partial(of_x, from_x, order, flows, potentials, gradients, drops):
    """The derivatives in the positions, and minus those in the weights, for the points of one side."""
    k, sign = 0, 1.0 if of_x else -1.0
    for v in range(len(flows)):
        if from_x[v] == of_x:
            before = abs(flows[v - 1]) if v > 0 else 0.0
            gradients[order[k]] = before - abs(flows[v])
            if len(drops) > 0:
                drops[order[k]] = -sign * potentials[v]
            k += 1
