"""The error bar from the directions: unbiased, as wide as it should be, and honest about what it does not know."""

import math

import numpy as np
import pytest

import problems
from meshot import DiscreteMeasure, sliced_wasserstein, sliced_wasserstein_estimate, surface
from meshot.loss import error_bar
from meshot.loss.directions import random_directions
from meshot.loss.error_bar import SlicedEstimate, directions_for_translation, translation_spread
from meshot.mesh.shapes.solids import icosphere

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


def test_doors(unchecked):
    source, target = problems.cloud(0, 5, 3), problems.cloud(1, 5, 3)
    with pytest.raises(ValueError, match="sampling is 'sobol'; one of random, orthogonal, quasi"):
        sliced_wasserstein_estimate(source, target, 10, 0, sampling="sobol")
    with pytest.raises(ValueError, match="1 directions make 1 replicate of random"):
        sliced_wasserstein_estimate(source, target, 1, 0)
    with pytest.raises(ValueError, match=r"3 directions make 1 replicate of orthogonal sampling in R\^3"):
        sliced_wasserstein_estimate(source, target, 3, 0, sampling="orthogonal")
    with pytest.raises(ValueError, match="1 replicate of quasi"):
        sliced_wasserstein_estimate(source, target, 10, 0, sampling="quasi", n_replicates=1)
    with pytest.raises(ValueError, match="n_directions is 0"):
        sliced_wasserstein_estimate(source, target, 0, 0)
    with pytest.raises(ValueError, match="n_replicates is 0"):
        sliced_wasserstein_estimate(source, target, 5, 0, sampling="quasi", n_replicates=0)
    with pytest.raises(ValueError, match=r"p is 0\.5"):
        sliced_wasserstein_estimate(source, target, 5, 0, p=0.5)
    with pytest.raises(ValueError, match="level is 95"):
        SlicedEstimate(1.0, 0.1, 3, 3).interval(95)
    with pytest.raises(ValueError, match="relative_error is 0"):
        SlicedEstimate(1.0, 0.1, 3, 3).directions_needed(0)
    with pytest.raises(ValueError, match=r"relative_error is -0\.1"):
        directions_for_translation(-0.1, 3)
    with pytest.raises(ValueError, match="p is 0"):
        translation_spread(3, 0)
    with pytest.raises(ValueError, match="d is 0"):
        error_bar.translation_spread(0)
