"""What holds for every pair of measures: over many drawn ones, with ties, empty weights and single points."""

import functools
import itertools

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from drawn_pairs import EXPONENTS, SEEDS, drawn

from meshot import (
    DiscreteMeasure,
    SurfaceMeasure,
    orthogonal_directions,
    random_directions,
    sliced_wasserstein,
    wasserstein,
)

few = functools.partial(drawn, n_examples=40)


@st.composite
def measures(draw, count=2):
    """``count`` measures in one space: coarse places (ties are common), integer weights (zeros, too), 1 to 9 points."""
    d = draw(st.sampled_from([1, 2, 3, 6]))
    generator = np.random.default_rng(draw(SEEDS))
    found = []
    for n in draw(st.lists(st.integers(1, 9), min_size=count, max_size=count)):
        coarse, equal = draw(st.booleans()), draw(st.booleans())
        points = generator.normal(size=(n, d)) * 2
        weights = np.ones(n) if equal else generator.integers(0, 5, n).astype(float)
        weights[generator.integers(n)] += not equal
        points = np.round(points) if coarse else points
        found.append(DiscreteMeasure(torch.from_numpy(points), torch.from_numpy(weights / weights.sum())))
    return found


@st.composite
def soups(draw, count=2):
    """``count`` continuous measures: loose triangles or segments in R² to R⁴, some of them collapsed."""
    d, corners = draw(st.sampled_from([2, 3, 4])), draw(st.sampled_from([2, 3]))
    generator, found = np.random.default_rng(draw(SEEDS)), []
    for n in draw(st.lists(st.integers(1, 6), min_size=count, max_size=count)):
        places = generator.normal(size=(n + corners, d))
        places = np.round(places) if draw(st.booleans()) else places
        cells = np.array([generator.permutation(n + corners)[:corners] for _ in range(n)])
        weights = generator.random(n) + 0.1
        tensors = (torch.from_numpy(x) for x in (places, cells, weights / weights.sum()))
        found.append(SurfaceMeasure(*tensors))
    return found


def dimension(measure):
    return (measure.vertices if isinstance(measure, SurfaceMeasure) else measure.points).shape[1]


def lines(measure, seed, n=4):
    return random_directions(n, dimension(measure), seed)


def frames(measure, seed, n_blocks=2):
    d = dimension(measure)
    return orthogonal_directions(n_blocks * d, d, seed)


def cost(source, target, directions, p):
    return float(sliced_wasserstein(source, target, directions, p))


def distance(source, target, directions, p):
    return cost(source, target, directions, p) ** (1 / p)


def moved(measure, change):
    if isinstance(measure, SurfaceMeasure):
        return SurfaceMeasure(change(measure.vertices), measure.cells, measure.weights)
    return DiscreteMeasure(change(measure.points), measure.weights)


def mean(measure):
    return measure.weights @ measure.points


def about(value):
    return pytest.approx(value, rel=1e-11, abs=1e-12)


@few(measures(), EXPONENTS, SEEDS)
def test_symmetric_and_never_negative(pair, p, seed):
    value = cost(*pair, lines(pair[0], seed), p)
    assert value >= 0
    assert value == about(cost(*pair[::-1], lines(pair[0], seed), p))


@few(measures(1), EXPONENTS, SEEDS)
def test_zero_between_names_of_one_measure(single, p, seed):
    """Points in another order, one of them split in two, and one more without weight: the same measure."""
    (measure,), generator = single, np.random.default_rng(seed)
    points, weights = measure.points.numpy(), measure.weights.numpy()
    split = generator.integers(len(points))
    points = np.concatenate([points, points[split : split + 1], generator.normal(size=(1, points.shape[1]))])
    weights = np.append(weights, [0.25 * weights[split], 0])
    weights[split] *= 0.75
    order = generator.permutation(len(points))
    other = DiscreteMeasure(torch.from_numpy(points[order]), torch.from_numpy(weights[order] / weights.sum()))
    assert distance(measure, other, lines(measure, seed), p) < (1e-11 if p == 1 else 1e-15 ** (1 / p) * 20)
    third = DiscreteMeasure(torch.zeros(1, points.shape[1], dtype=torch.float64))
    assert cost(measure, third, lines(measure, seed), p) == about(cost(other, third, lines(measure, seed), p))


@few(measures(3), EXPONENTS, SEEDS)
def test_triangle_inequality(triple, p, seed):
    directions = lines(triple[0], seed)
    legs = [distance(a, b, directions, p) for a, b in itertools.combinations(triple, 2)]
    assert max(legs) <= sum(legs) - max(legs) + 1e-11


@few(measures(3), st.sampled_from([1, 2]))
def test_triangle_inequality_of_transport(triple, p):
    legs = [float(wasserstein(a, b, p)) ** (1 / p) for a, b in itertools.combinations(triple, 2)]
    assert max(legs) <= sum(legs) - max(legs) + 1e-7


@few(measures(), SEEDS)
def test_a_shift_adds_its_square(pair, seed):
    """For p = 2: the distance of the means, |Δ|²/d over whole frames, plus that of the centred measures."""
    directions, gap = frames(pair[0], seed), mean(pair[0]) - mean(pair[1])
    centred = [moved(m, lambda x, m=m: x - mean(m)) for m in pair]
    expected = float(gap.square().sum()) / dimension(pair[0]) + cost(*centred, directions, 2)
    assert cost(*pair, directions, 2) == about(expected)


@few(measures(), EXPONENTS, SEEDS, st.sampled_from([-3.0, 0.01, 0.5, 100.0]))
def test_turning_changes_nothing_and_scaling_acts_with_the_exponent(pair, p, seed, factor):
    directions, turn = lines(pair[0], seed), frames(pair[0], seed + 1, 1)
    after = [moved(m, lambda x: factor * x @ turn.T) for m in pair]
    expected = abs(factor) ** p * cost(*pair, directions, p)
    assert cost(*after, directions @ turn.T, p) == pytest.approx(expected, rel=1e-10, abs=1e-12)


@few(measures(), SEEDS)
def test_rising_in_the_exponent(pair, seed):
    found = [distance(*pair, lines(pair[0], seed), p) for p in (1, 1.5, 2, 3, 6)]
    assert all(a <= b * (1 + 1e-11) + 1e-12 for a, b in itertools.pairwise(found))


@few(measures(), SEEDS)
def test_below_transport(pair, seed):
    """SW₁ ≤ W₁ whatever the directions; SW₂ ≤ W₂/√d over whole frames, where the mean of θθᵀ is I/d."""
    assert cost(*pair, lines(pair[0], seed), 1) <= float(wasserstein(*pair, 1)) * (1 + 1e-9) + 1e-9
    bound = float(wasserstein(*pair, 2)) / dimension(pair[0])
    assert cost(*pair, frames(pair[0], seed), 2) <= bound * (1 + 1e-9) + 1e-9


@few(soups(3), st.sampled_from([1, 2]), SEEDS)
def test_axioms_of_continuous_measures(triple, p, seed):
    directions = lines(triple[0], seed)
    legs = [distance(a, b, directions, p) for a, b in itertools.combinations(triple, 2)]
    assert min(legs) >= 0
    assert max(legs) <= sum(legs) - max(legs) + 1e-9
    assert distance(triple[1], triple[0], directions, p) == pytest.approx(legs[0], rel=1e-9, abs=1e-9)
    assert distance(triple[0], triple[0], directions, p) == pytest.approx(0, abs=1e-9)


@few(soups(), st.sampled_from([1, 2]), SEEDS)
def test_cutting_cells_changes_nothing(pair, p, seed):
    first, directions = pair[0], lines(pair[0], seed)
    start, end, rest = first.cells[:, :1], first.cells[:, 1:2], first.cells[:, 2:]
    middle = len(first.vertices) + torch.arange(len(first.cells))[:, None]
    halves = torch.cat([torch.cat([start, middle, rest], dim=1), torch.cat([middle, end, rest], dim=1)])
    vertices = torch.cat([first.vertices, (first.vertices[start[:, 0]] + first.vertices[end[:, 0]]) / 2])
    cut = SurfaceMeasure(vertices, halves, first.weights.repeat(2) / 2)
    assert cost(cut, pair[1], directions, p) == pytest.approx(cost(*pair, directions, p), rel=1e-9, abs=1e-11)
    assert cost(cut, first, directions, p) < 1e-11


@few(soups(), st.sampled_from([1, 2]), SEEDS, st.sampled_from([-2.0, 0.1, 30.0]))
def test_rigid_motion_and_scaling_of_continuous_measures(pair, p, seed, factor):
    directions, turn = lines(pair[0], seed), frames(pair[0], seed + 1, 1)
    shift = torch.from_numpy(np.random.default_rng(seed).normal(size=dimension(pair[0])))
    after = [moved(m, lambda x: factor * x @ turn.T + shift) for m in pair]
    expected = abs(factor) ** p * cost(*pair, directions, p)
    assert cost(*after, directions @ turn.T, p) == pytest.approx(expected, rel=1e-9, abs=1e-11 * abs(factor) ** p)
