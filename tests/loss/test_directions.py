"""Directions: unit rows, uniform in law, even where they promise to be."""

import numpy as np
import pytest
import torch
from scipy import stats

from meshot import quasi_directions, random_directions
from meshot.loss.directions import require_directions


@pytest.mark.parametrize("make", [random_directions, quasi_directions])
@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_unit_rows_that_a_seed_repeats(make, d):
    directions = make(50, d, 4)
    assert directions.shape == (50, d)
    assert torch.allclose(directions.norm(dim=1), torch.ones(50, dtype=torch.float64))
    assert torch.equal(directions, make(50, d, 4))
    if d > 1:
        assert not torch.equal(directions, make(50, d, 5))
    assert make(4, d, 4, dtype=torch.float32).dtype == torch.float32


def test_a_coordinate_on_the_sphere_is_uniform():
    directions = random_directions(20_000, 3, 0)
    for coordinate in directions.T:
        assert stats.kstest(coordinate.numpy(), stats.uniform(-1, 2).cdf).pvalue > 0.01


def test_a_squared_coordinate_in_six_dimensions_has_a_beta_law():
    squared = random_directions(20_000, 6, 1)[:, 2].square().numpy()
    assert stats.kstest(squared, stats.beta(0.5, 2.5).cdf).pvalue > 0.01


@pytest.mark.parametrize("d", [2, 3, 6])
def test_quasi_directions_integrate_better_than_chance(d):
    """E[θ θᵀ] = I/d: the error of the mean over 256 directions, over 20 seeds."""

    def error(make):
        means = [make(256, d, seed).T @ make(256, d, seed) / 256 for seed in range(20)]
        return np.mean([float((mean - torch.eye(d, dtype=torch.float64) / d).norm()) for mean in means])

    assert error(quasi_directions) < 0.5 * error(random_directions)


def test_bad_requests_are_refused(unchecked):
    with pytest.raises(ValueError, match="n is 0"):
        random_directions(0, 3, 0)
    with pytest.raises(ValueError, match=r"d is 2\.5"):
        quasi_directions(5, 2.5)


def test_doors_of_directions(unchecked):
    points = torch.zeros(4, 3, dtype=torch.float32)
    with pytest.raises(ValueError, match=r"\(n, 3\) is needed"):
        require_directions(torch.eye(2), points)
    with pytest.raises(ValueError, match="length 2"):
        require_directions(2 * torch.eye(3), points)
    with pytest.raises(ValueError, match="NaN"):
        require_directions(torch.full((1, 3), torch.nan), points)
    assert require_directions(torch.eye(3, dtype=torch.float64), points).dtype == torch.float32
