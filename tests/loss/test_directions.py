"""Directions: unit rows, uniform in law, even where they promise to be."""

import functools
import itertools

import numpy as np
import pytest
import torch
from scipy import optimize, stats

from meshot import orthogonal_directions, quasi_directions, random_directions
from meshot.loss import directions as quasi_sets
from meshot.loss.directions import require_directions
from refusals import refuses

EYE = {d: torch.eye(d, dtype=torch.float64) for d in (2, 3, 5, 6)}
METHODS = [
    (name, only or d) for name, (_, only) in quasi_sets.CONSTRUCTIONS.items() for d in ((only,) if only else (2, 3, 6))
]
methods = pytest.mark.parametrize(("method", "d"), METHODS)


#: Every way to draw directions, and a dimension.
MAKERS = [
    *itertools.product((random_directions, orthogonal_directions, quasi_directions), (1, 2, 3, 6)),
    *((functools.partial(quasi_directions, method=method), d) for method, d in METHODS),
]


@pytest.mark.parametrize(("make", "d"), MAKERS)
def test_unit_rows_that_a_seed_repeats(make, d):
    for n in (1, 2, 7, 50):
        directions = make(n, d, 4)
        assert directions.shape == (n, d)
        assert torch.allclose(directions.norm(dim=1), torch.ones(n, dtype=torch.float64))
    assert torch.equal(directions, make(50, d, 4))
    assert d == 1 or not torch.equal(directions, make(50, d, 5))
    assert make(4, d, 4, dtype=torch.float32).dtype == torch.float32


def test_a_coordinate_on_the_sphere_is_uniform():
    directions = random_directions(20_000, 3, 0)
    for coordinate in directions.T:
        assert stats.kstest(coordinate.numpy(), stats.uniform(-1, 2).cdf).pvalue > 0.01


def test_a_squared_coordinate_in_six_dimensions_has_a_beta_law():
    squared = random_directions(20_000, 6, 1)[:, 2].square().numpy()
    assert stats.kstest(squared, stats.beta(0.5, 2.5).cdf).pvalue > 0.01


def second_moment_error(make, n, d, n_seeds=10):
    means = [make(n, d, seed).T @ make(n, d, seed) / n for seed in range(n_seeds)]
    return np.mean([float((mean - EYE[d] / d).norm()) for mean in means])


@pytest.mark.parametrize("d", [2, 3, 5])
def test_blocks_are_frames_and_the_last_one_is_cut(d):
    directions = orthogonal_directions(4 * d - 1, d, 0)
    blocks = torch.cat([directions, torch.zeros(1, d, dtype=torch.float64)]).view(4, d, d)
    for block in blocks[:3]:
        assert torch.allclose(block @ block.T, EYE[d], atol=1e-14)
    assert torch.allclose(blocks[3, : d - 1] @ blocks[3, : d - 1].T, torch.eye(d - 1, dtype=torch.float64), atol=1e-14)
    whole = orthogonal_directions(3 * d, d, 1)
    assert torch.allclose(whole.T @ whole / (3 * d), EYE[d] / d, atol=1e-15)
    assert len(orthogonal_directions(1, d, 0)) == 1


def test_every_row_of_a_block_is_uniform():
    """Without the signs, the last row of NumPy's factor keeps to one side, and so would its mean."""
    blocks = orthogonal_directions(12_000, 3, 0).view(-1, 3, 3)
    for row in range(3):
        for coordinate in range(3):
            assert stats.kstest(blocks[:, row, coordinate].numpy(), stats.uniform(-1, 2).cdf).pvalue > 1e-3
    trace = blocks.diagonal(dim1=1, dim2=2).sum(dim=1).square().mean()  # E tr² = 1 on the orthogonal group
    assert float(trace) == pytest.approx(1, abs=0.05)


@methods
def test_every_construction_integrates_better_than_chance(method, d):
    """E[θ θᵀ] = I/d: the error of the mean over 256 directions."""
    make = functools.partial(quasi_directions, method=method)
    assert second_moment_error(make, 256, d) < 0.6 * second_moment_error(random_directions, 256, d)


@methods
def test_no_construction_prefers_a_direction(method, d):
    """A fourth moment over seeds: E θ₁⁴ = 3/(d (d + 2)), which orthogonality alone does not give."""
    sets = torch.stack([quasi_directions(20, d, seed, method=method) for seed in range(300)])
    means = sets[:, :, 0].pow(4).mean(dim=1).numpy()
    error = np.std(means, ddof=1) / np.sqrt(len(means))
    assert np.mean(means) == pytest.approx(3 / (d * (d + 2)), abs=max(4 * error, 1e-12))
    rows = sets[:, 7]
    assert float((rows.T @ rows / 300 - EYE[d] / d).abs().max()) < 4 * np.sqrt(3 / (d * (d + 2)) / 300)


def test_lattice_heights_have_their_law():
    """On the half sphere of R⁴ the first coordinate t has (t + 1)/2 ~ Beta(3/2, 3/2)."""
    rows = quasi_sets.kronecker_lattice(4000, 4, 0)
    for coordinate in rows.T[:3]:
        assert stats.kstest((coordinate + 1) / 2, stats.beta(1.5, 1.5).cdf).statistic < 0.01
    assert (rows[:, 3] >= 0).all()


def test_lines_repel():
    start = np.random.default_rng(0).standard_normal(27)
    value, slope = (lambda x, i=i: quasi_sets._energy(x, 9, 3)[i] for i in (0, 1))
    assert optimize.check_grad(value, slope, start) < 1e-6
    cosines = np.abs(quasi_sets.repelling_lines(6, 3, 0) @ quasi_sets.repelling_lines(6, 3, 0).T)
    # The six axes of the icosahedron are the best six lines: every two at cos = 1/sqrt 5.
    assert cosines[~np.eye(6, dtype=bool)] == pytest.approx(1 / np.sqrt(5), abs=1e-3)
    quasi_sets.repelling_lines(6, 3, 0)[:] = 0
    assert quasi_sets.repelling_lines(6, 3, 0).any()


def test_bad_requests_are_refused(unchecked):
    refuses("n is 0", random_directions, 0, 3, 0)
    refuses(r"d is 2\.5", quasi_directions, 5, 2.5)
    refuses("n is 0", orthogonal_directions, 0, 3, 0)
    refuses("d is True", orthogonal_directions, 3, True, 0)
    refuses("method is 'halton'; one of 'equal angles'", quasi_directions, 5, 2, method="halton")
    refuses(r"'spiral' is for R\^3 only, and d is 2", quasi_directions, 5, 2, method="spiral")
    points = torch.zeros(4, 3, dtype=torch.float32)
    refuses(r"\(n, 3\) is needed", require_directions, torch.eye(2), points)
    refuses("length 2", require_directions, 2 * torch.eye(3), points)
    refuses("NaN", require_directions, torch.full((1, 3), torch.nan), points)
    assert require_directions(torch.eye(3, dtype=torch.float64), points).dtype == torch.float32
