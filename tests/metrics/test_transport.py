import math

import numpy as np
import ot
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from meshot.metrics.distances import earth_movers_distance, half_sphere, sinkhorn_distance, sliced_distance


def cloud(seed, n=200):
    return np.random.default_rng(seed).standard_normal((n, 3))


def test_translation():
    points, shift = cloud(0), np.array([3.0, -4.0, 12.0])
    assert earth_movers_distance(points, points + shift) == pytest.approx(13)
    assert sliced_distance(points, points + shift) == pytest.approx(13 / math.sqrt(3), rel=5e-3)


def test_emd_against_the_assignment_solver():
    cost = cdist(cloud(1), cloud(2), "sqeuclidean")
    rows, columns = linear_sum_assignment(cost)
    assert earth_movers_distance(cloud(1), cloud(2)) == pytest.approx(math.sqrt(cost[rows, columns].mean()))


def test_blurred_transport():
    points, shift = cloud(0), np.array([3.0, -4.0, 12.0])
    assert sinkhorn_distance(points, points + shift, 0.1) == pytest.approx(13, rel=1e-3)
    assert sinkhorn_distance(points, points, 1.0) == pytest.approx(0, abs=1e-6)
    # A blur beyond the size of everything leaves the distance between the means.
    means = np.linalg.norm(cloud(1).mean(axis=0) - cloud(2).mean(axis=0))
    assert sinkhorn_distance(cloud(1), cloud(2), 1e3) == pytest.approx(means, rel=1e-3)
    with pytest.raises(ValueError, match="blur is 0"):
        sinkhorn_distance(points, points, 0.0)


def test_swd_against_transport_on_lines():
    costs = [ot.emd2_1d(cloud(1) @ u, cloud(2) @ u, metric="sqeuclidean") for u in half_sphere(7)]
    assert sliced_distance(cloud(1), cloud(2), 7) == pytest.approx(math.sqrt(np.mean(costs)))


def test_swd_against_pot_in_space():
    ours = sliced_distance(cloud(1), cloud(2), 50)
    theirs = ot.sliced_wasserstein_distance(cloud(1), cloud(2), projections=half_sphere(50).T)
    assert ours == pytest.approx(theirs)


def test_emd_of_shifted_planes_and_of_grown_spheres():
    """The gradient of a convex function moves optimally: both pairings are known."""
    sheet = np.random.default_rng(3).uniform(size=(150, 3)) * [10, 10, 0]
    assert earth_movers_distance(sheet, sheet + np.array([0, 0, 0.7])) == pytest.approx(0.7)
    sphere = half_sphere(300) * np.where(np.arange(300) % 2, 1, -1)[:, None]
    assert earth_movers_distance(38 * sphere, 40 * sphere) == pytest.approx(2)


def test_concentric_spheres():
    # A uniform sphere projects to a uniform interval: SW₂² = (r − s)²/3.
    sphere = half_sphere(20_000) * np.where(np.arange(20_000) % 2, 1, -1)[:, None]
    assert sliced_distance(38 * sphere, 40 * sphere) == pytest.approx(2 / math.sqrt(3), rel=1e-3)


def test_sliced_is_at_most_exact():
    assert sliced_distance(cloud(3), cloud(4)) <= earth_movers_distance(cloud(3), cloud(4)) / math.sqrt(3)


def test_half_sphere_is_isotropic():
    directions = half_sphere(200)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1)
    assert directions[:, 2].min() > 0
    np.testing.assert_allclose(directions.T @ directions / 200, np.eye(3) / 3, atol=2e-3)


@pytest.mark.parametrize("scale", 10.0 ** np.arange(-12, 13, 3))
def test_the_scale_and_the_place_do_not_matter(scale):
    """The tolerance of POT's solver is absolute; |x|² + |y|² − 2⟨x, y⟩ would cancel far from the origin."""
    squared = np.square(cloud(1)[:, None] - cloud(2)).sum(axis=2)
    expected = np.sqrt(squared[linear_sum_assignment(squared)].mean())
    assert earth_movers_distance(scale * cloud(1), scale * cloud(2)) == pytest.approx(scale * expected, rel=1e-9)
    # At 1e6 a coordinate keeps ten digits.
    moved = [cloud(seed) + 1e6 for seed in (1, 2)]
    assert earth_movers_distance(*moved) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("distance", [earth_movers_distance, sliced_distance])
def test_doors(unchecked, distance):
    with pytest.raises(ValueError, match="200 and 199 points"):
        distance(cloud(0), cloud(0)[1:])
    with pytest.raises(ValueError, match="0 and 0 points"):
        distance(cloud(0)[:0], cloud(0)[:0])


def test_no_directions():
    with pytest.raises(ValueError, match="n_directions is 0"):
        sliced_distance(cloud(0), cloud(0), 0)


def test_unfinished_transport(monkeypatch):
    def warns(*arguments, **options):
        import warnings

        warnings.warn("numItermax reached before optimality", stacklevel=2)
        return 1.0

    monkeypatch.setattr(ot, "emd2", warns)
    with pytest.raises(ValueError, match="did not finish"):
        earth_movers_distance(cloud(0), cloud(1))
