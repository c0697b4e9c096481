"""Error bars from directions and from windows: unbiased, as wide as they should be, and clear about what is missing."""

import math

import numpy as np
import pytest
import torch

import problems
from meshot import (
    DiscreteMeasure,
    sliced_wasserstein,
    sliced_wasserstein_estimate,
    surface,
    windowed_sliced_wasserstein,
)
from meshot.loss import error_bar, windowed
from meshot.loss.directions import random_directions
from meshot.loss.error_bar import SlicedEstimate, windowed_sliced_wasserstein_estimate
from meshot.mesh.shapes import icosphere
from meshot_book.lines import directions_for_translation, translation_spread
from refusals import refuses

SETTINGS = [("random", 40), ("orthogonal", 42), ("quasi", 40)]
settings = pytest.mark.parametrize(("sampling", "n_directions"), SETTINGS)


def estimates(problem, sampling, n_directions, n_draws=250):
    generator = np.random.default_rng(7)
    return [
        sliced_wasserstein_estimate(problem.source, problem.target, n_directions, generator, problem.p, sampling)
        for _ in range(n_draws)
    ]


@settings
@pytest.mark.parametrize("problem", [problems.dilation(3, 12, 3, 1.8), problems.two_diracs(3, 1)], ids=lambda p: p.name)
def test_unbiased_and_covering(problem, sampling, n_directions):
    """Over 250 draws: the mean is the closed form, the stated variance is the variance, 95 % intervals hold it."""
    found = estimates(problem, sampling, n_directions)
    values, errors = np.array([e.value for e in found]), np.array([e.standard_error for e in found])
    spread = values.std(ddof=1)
    assert values.mean() == pytest.approx(problem.sliced, abs=4 * spread / 250**0.5 + 1e-12)
    if spread > 1e-12 * problem.sliced:
        assert np.square(errors).mean() == pytest.approx(spread**2, rel=0.25)
        covered = np.mean([low <= problem.sliced <= high for low, high in (e.interval() for e in found)])
        assert 0.91 < covered < 0.985


def test_orthogonal_blocks_have_no_error_for_p_two():
    problem = problems.translation(1, 30, 3)
    estimate = sliced_wasserstein_estimate(problem.source, problem.target, 12, 0, sampling="orthogonal")
    assert estimate.value == pytest.approx(problem.sliced, rel=1e-12)
    assert estimate.relative_error < 1e-12


def test_random_directions_are_the_replicates():
    source, target = problems.cloud(0, 20, 3), problems.cloud(1, 25, 3, weighted=True)
    estimate = sliced_wasserstein_estimate(source, target, 30, 5)
    directions = random_directions(30, 3, 5)
    costs = [float(sliced_wasserstein(source, target, theta[None])) for theta in directions]
    assert estimate.value == pytest.approx(np.mean(costs), rel=1e-12)
    assert estimate.standard_error == pytest.approx(np.std(costs, ddof=1) / math.sqrt(30), rel=1e-10)
    assert (estimate.n_directions, estimate.n_replicates) == (30, 30)


def test_blocks_are_whole_and_replicates_are_turned_apart():
    source, target = problems.cloud(0, 20, 3), problems.cloud(1, 25, 3)
    orthogonal = sliced_wasserstein_estimate(source, target, 10, 0, sampling="orthogonal")
    assert (orthogonal.n_directions, orthogonal.n_replicates) == (12, 4)
    quasi = sliced_wasserstein_estimate(source, target, 42, 0, sampling="quasi", n_replicates=5)
    assert (quasi.n_directions, quasi.n_replicates) == (45, 5)
    assert quasi.standard_error > 0


def test_even_sets_have_shorter_bars():
    problem = problems.dilation(3, 12, 3, 1.8)
    bars = {s: np.mean([e.relative_error for e in estimates(problem, s, 60, 30)]) for s, _ in SETTINGS}
    assert bars["quasi"] < 0.5 * bars["random"]
    assert bars["orthogonal"] < 1e-10


def test_continuous_measures_and_single_precision():
    pair = surface(icosphere(2)), surface(icosphere(2, 1.5))
    low, high = sliced_wasserstein_estimate(*pair, 20, 0).interval(0.99)
    assert high == pytest.approx(low, rel=0.05)
    assert (low + high) / 2 == pytest.approx(0.25 / 3, rel=0.1)
    single = [DiscreteMeasure(problems.cloud(seed, 9, 3).points.float().requires_grad_()) for seed in (0, 1)]
    double = [DiscreteMeasure(m.points.detach().double()) for m in single]
    one, two = (sliced_wasserstein_estimate(*pair, 20, 0) for pair in (single, double))
    assert one.value == pytest.approx(two.value, rel=1e-5)


@pytest.mark.parametrize("d", [2, 3, 6, 50])
@pytest.mark.parametrize("p", [1, 2, 3])
def test_spread_of_a_translation(d, p):
    costs = random_directions(200_000, d, 0)[:, 0].abs().pow(p)
    assert translation_spread(d, p) == pytest.approx(float(costs.std() / costs.mean()), rel=0.03)
    if p == 2:
        assert translation_spread(d) == pytest.approx(math.sqrt(2 * (d - 1) / (d + 2)), rel=1e-12)


def test_a_line_has_no_spread():
    assert translation_spread(1) == 0
    assert directions_for_translation(0.01, 1) == 1


def test_how_many_directions():
    assert directions_for_translation(0.01, 3) == 8000
    assert directions_for_translation(0.1, 3) == 80
    estimate = SlicedEstimate(2.0, 0.2, 100, 100)
    assert estimate.directions_needed(0.05) == 400
    assert estimate.directions_needed(10.0) == 1
    assert SlicedEstimate(0.0, 0.0, 100, 100).directions_needed(0.01) == 1
    problem = problems.translation(1, 30, 3)
    first = sliced_wasserstein_estimate(problem.source, problem.target, 2000, 0)
    assert first.directions_needed(0.01) == pytest.approx(8000, rel=0.1)


def test_intervals_widen_with_doubt_and_stop_at_zero():
    few, many = SlicedEstimate(1.0, 0.1, 3, 3), SlicedEstimate(1.0, 0.1, 300, 300)
    assert few.interval()[1] > many.interval()[1] > many.interval(0.5)[1]
    assert many.interval()[1] == pytest.approx(1 + 1.968 * 0.1, abs=1e-4)
    assert few.interval()[1] == pytest.approx(1 + 4.302653 * 0.1, abs=1e-6)  # two degrees of freedom
    assert few.interval(0.999)[0] == 0


def windowed_pair(seed=0):
    source, target = problems.cloud(seed, 60, 3, True), problems.cloud(seed + 1, 45, 3, True)
    return source, target


def windowed_truth(source, target, radius, n_directions, p):
    """The mean over all centres, by mass: one window at a time, with many directions for each."""
    lines, costs, masses = random_directions(n_directions, 3, 5)[None], [], []
    for place, mass in zip(target.points, target.weights):
        try:
            costs.append(float(windowed_sliced_wasserstein(source, target, place[None], radius, lines, p)))
        except ValueError:  # no mass of the source
            continue
        masses.append(float(mass))
    return np.average(costs, weights=masses), len(costs)


@pytest.mark.parametrize(("radius", "p"), [(0.6, 1), (0.15, 2)])
def test_windows_unbiased_and_covering(radius, p):
    """Over 200 draws: the mean is that over all centres, the variance as stated, and 95 % intervals hold it."""
    source, target = windowed_pair()
    truth, n_counted = windowed_truth(source, target, radius, 2000, p)
    assert (n_counted < 45) == (radius == 0.15)  # small windows may miss the source
    generator = np.random.default_rng(3)
    found = [windowed_sliced_wasserstein_estimate(source, target, 30, radius, generator, 8, p) for _ in range(200)]
    values, errors = np.array([e.value for e in found]), np.array([e.standard_error for e in found])
    spread = values.std(ddof=1)
    assert values.mean() == pytest.approx(truth, abs=4 * spread / 200**0.5 + 0.01 * truth)
    assert np.square(errors).mean() == pytest.approx(spread**2, rel=0.3)
    covered = np.mean([low <= truth <= high for low, high in (e.interval() for e in found)])
    assert 0.89 < covered < 0.99
    assert {e.n_directions for e in found} == {30 * 8}
    assert all(e.n_replicates == 30 for e in found) == (radius == 0.6)


def test_the_value_is_that_of_the_loss_in_the_same_windows(monkeypatch):
    source, target = windowed_pair()
    kept = {}

    def drawn(*arguments):
        kept["windows"] = windowed.drawn_windows(*arguments)
        return kept["windows"]

    monkeypatch.setattr(error_bar, "drawn_windows", drawn)
    for dtype, tolerance in ((torch.float64, 1e-12), (torch.float32, 1e-6)):
        pair = [DiscreteMeasure(m.points.to(dtype).requires_grad_(), m.weights.to(dtype)) for m in (source, target)]
        estimate = windowed_sliced_wasserstein_estimate(*pair, 30, 0.6, 2, 5, 1)
        centres, sets = kept["windows"]
        loss = windowed_sliced_wasserstein(*pair, centres, 0.6, sets, 1)
        assert estimate.value == pytest.approx(float(loss.detach()), rel=tolerance)


def test_more_windows_for_a_smaller_error():
    source, target = windowed_pair()
    few, many = (windowed_sliced_wasserstein_estimate(source, target, n, 0.6, 0) for n in (200, 800))
    assert few.directions_needed(many.relative_error) / 16 == pytest.approx(800, rel=0.4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"n_windows": 0}, "n_windows is 0"),
        ({"n_directions": 0}, "n_directions is 0"),
        ({"n_windows": 1}, "1 of 1 windows holds mass of both measures; an error bar needs at least two"),
        ({"target": problems.cloud(1, 45, 3).points + 100}, r"none of 5 windows of radius 0\.6 holds mass of both"),
        ({"radius": -1}, "radius is -1"),
    ],
)
def test_doors_of_windows(unchecked, change, words):
    source, target = windowed_pair()
    given = {"source": source, "target": target, "n_windows": 5, "radius": 0.6, "generator": 0}
    refuses(words, windowed_sliced_wasserstein_estimate, **given | change)


@pytest.mark.parametrize(
    ("n_directions", "more", "words"),
    [
        (10, {"sampling": "sobol"}, "sampling is 'sobol'; one of random, orthogonal, quasi"),
        (1, {}, "1 directions make 1 replicate of random"),
        (3, {"sampling": "orthogonal"}, r"3 directions make 1 replicate of orthogonal sampling in R\^3"),
        (10, {"sampling": "quasi", "n_replicates": 1}, "1 replicate of quasi"),
        (0, {}, "n_directions is 0"),
        (5, {"sampling": "quasi", "n_replicates": 0}, "n_replicates is 0"),
        (5, {"p": 0.5}, r"p is 0\.5"),
    ],
)
def test_doors(unchecked, n_directions, more, words):
    with pytest.raises(ValueError, match=words):
        sliced_wasserstein_estimate(problems.cloud(0, 5, 3), problems.cloud(1, 5, 3), n_directions, 0, **more)


@pytest.mark.parametrize(
    ("compute", "words"),
    [
        (lambda: SlicedEstimate(1.0, 0.1, 3, 3).interval(95), "level is 95"),
        (lambda: SlicedEstimate(1.0, 0.1, 3, 3).directions_needed(0), "relative_error is 0"),
        (lambda: directions_for_translation(-0.1, 3), r"relative_error is -0\.1"),
        (lambda: translation_spread(3, 0), "p is 0"),
        (lambda: translation_spread(0), "d is 0"),
    ],
)
def test_doors_of_numbers(unchecked, compute, words):
    refuses(words, compute)
