"""Rates of W, SW and Chamfer: the pairs are what they say, their known distances hold, committed numbers repeat."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "transport_rates"


def pair_of(shape, d, relation):
    return {"shape": shape, "d": d, "relation": relation}


def test_points_lie_on_their_shapes_and_fill_them_evenly(part, config):
    draw, generator = part("pairs").draw, np.random.default_rng(0)
    ellipsoid = draw("ellipsoid", 6, 4000, config, generator)
    radii = part("pairs").ELLIPSOID
    assert np.allclose(np.sum((ellipsoid[:, :3] / radii) ** 2, axis=1), 1)
    assert np.allclose(np.linalg.norm(ellipsoid[:, 3:], axis=1), config["normal_scale"])
    # By area (divergence theorem): the mean of x times the normal's x is volume / area, the same along each axis.
    flux = (ellipsoid[:, :3] * ellipsoid[:, 3:]).mean(axis=0)
    assert flux == pytest.approx(np.full(3, flux.mean()), rel=0.1)
    faces = draw("cube_surface", 6, 6000, config, generator)
    sides, counts = np.unique(faces[:, 3:], axis=0, return_counts=True)
    assert len(sides) == 6
    assert counts == pytest.approx(np.full(6, 1000), rel=0.1)
    assert np.allclose(np.abs(faces[:, :3]).max(axis=1), 0.5)
    tilted = part("pairs").draw_pair(pair_of("sphere", 3, "other_density"), 5000, config, generator)
    # Density ∝ 1 + 0.9 z on the sphere has the mean height 0.3.
    assert [side[:, 2].mean() for side in tilted] == pytest.approx([0.3, -0.3], abs=0.03)


def test_exact_transport_is_that_of_the_assignment(part):
    generator = np.random.default_rng(1)
    points, others = generator.random((40, 3)), generator.random((40, 3)) + 0.3
    for p, metric in ((1, "euclidean"), (2, "sqeuclidean")):
        cost = cdist(points, others, metric)
        slow = cost[linear_sum_assignment(cost)].mean()
        assert part("run").optimal_cost(points, others, p) == pytest.approx(slow, rel=1e-12)


@pytest.mark.parametrize(
    ("d", "relation"), [(3, "translated"), (6, "translated"), (3, "concentric"), (6, "concentric")]
)
@pytest.mark.parametrize("p", [1, 2])
def test_known_distances_are_those_of_coupled_points(part, config, d, relation, p):
    """Points that are moved as the closed form says are that far apart, and no assignment does better."""
    pairs = part("pairs")
    pair = pair_of("sphere", d, relation)
    points = pairs.draw("sphere", d, 60, config, np.random.default_rng(2))
    moved = points.copy()
    if relation == "translated":
        moved += pairs.translation(pair, config)
    else:
        moved[:, :3] *= config["inner_radius"]
    known = pairs.known_distance(pair, config)
    assert part("run").optimal_cost(points, moved, p) ** (1 / p) == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("d", [3, 6])
def test_known_slices_are_those_of_large_samples(part, config, d):
    pairs = part("pairs")
    directions = np.random.default_rng(3).standard_normal((4, d))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for relation in ("translated", "concentric"):
        pair = pair_of("sphere", d, relation)
        sides = pairs.draw_pair(pair, 200_000, config, np.random.default_rng(4))
        quantiles = [np.sort(side @ directions.T, axis=0) for side in sides]
        for p in (1, 2):
            found = (np.abs(quantiles[0] - quantiles[1]) ** p).mean(axis=0)
            assert found == pytest.approx(pairs.known_slices(pair, config, directions, p), rel=0.03, abs=4e-3)


def test_chamfer_limits(part, config):
    limits = part("run")
    concentric = limits.chamfer_limit(pair_of("sphere", 3, "concentric"), config)["limit"]
    assert concentric == pytest.approx(2 * 0.3**2)
    # One way by quadrature, on a pair where every distance is known: parallel sides of two cubes in one place.
    cube = part("meshot.mesh.shapes").cube
    assert limits.one_way(cube(), cube(2.0), 2) == pytest.approx(0.25, rel=1e-12)
    shifted = part("pairs").draw_pair(pair_of("cube", 3, "translated"), 200_000, config, np.random.default_rng(5))
    beyond = np.maximum(part("pairs").translation(pair_of("cube", 3, "translated"), config) - shifted[0], 0)
    found = 2 * np.sum(beyond**2, axis=1).mean()
    assert found == pytest.approx(limits.shifted_cubes(pair_of("cube", 3, "translated"), config), rel=0.02)


@pytest.mark.parametrize("estimate", ["transport", "sliced", "chamfer"])
def test_a_small_part_repeats_the_committed_numbers(part, record, config, estimate):
    results = record["results"]
    row = results[estimate][0]
    task = {"estimate": estimate, **pair_of(row["shape"], row["d"], row["relation"])}
    task |= {"n_points": row["sizes"][0], "n_repetitions": row["n_repetitions"][0]}
    found = part("run").errors(task, results["limits"], config)[str(row["p"])]
    assert np.abs(found).mean() == pytest.approx(row["error"][0], rel=1e-5)


def test_expected_slopes(part):
    expected = part("run").expected_slope
    assert expected("transport", pair_of("cube", 6, "equal"), 2) == pytest.approx(-1 / 6, abs=1e-4)
    assert expected("transport", pair_of("cube", 6, "translated"), 2) == pytest.approx(-1 / 3, abs=1e-4)
    assert expected("transport", pair_of("ellipsoid", 6, "equal"), 1) == -0.5
    assert expected("transport", pair_of("two_cubes", 3, "equal"), 2) == -0.25
    assert expected("transport", pair_of("cube", 3, "translated"), 1) is None
    assert expected("chamfer", pair_of("cube", 6, "equal"), 2) == pytest.approx(-1 / 3, abs=1e-4)
    assert expected("chamfer", pair_of("sphere", 3, "concentric"), 2) == -1
    assert expected("sliced", pair_of("cube", 6, "equal"), 2) == -0.5
