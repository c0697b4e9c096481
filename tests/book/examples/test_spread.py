"""Coverage, evenness and distances against closed forms and slow twins."""

import numpy as np
import pytest
import torch
from scipy.optimize import linear_sum_assignment

from meshot.mesh.geometry import even_points, sample_points
from meshot.mesh.mesh import Contour
from meshot.mesh.shapes import circle, letter_e, regular_polygon, star
from meshot_book.examples.spread import (
    contour_gaps,
    coverage,
    distance_to_contour,
    evenness,
    exact_distance,
    nearest_on_contour,
)

SHAPES = [regular_polygon(4), star(5, 1.5, 0.35), letter_e()]


@pytest.mark.parametrize("shape", SHAPES)
def test_even_points_are_perfect(shape):
    points = even_points(shape, 300, offset=0.3)
    assert coverage(points, shape) == pytest.approx(1)
    assert evenness(points, shape) == pytest.approx(1)
    assert distance_to_contour(points, shape) == pytest.approx(0, abs=1e-12)


def test_random_points_are_at_the_floor():
    shape, n, seeds = regular_polygon(4), 400, 60
    samples = [sample_points(shape, n, seed) for seed in range(seeds)]
    reciprocals = [1 / evenness(points, shape) for points in samples]
    covered = [coverage(points, shape) for points in samples]
    for values, wanted in ((reciprocals, 2 * n / (n + 1)), (covered, 1 - np.exp(-2))):
        assert abs(np.mean(values) - wanted) < 4 * np.std(values, ddof=1) / np.sqrt(seeds)


def test_all_points_in_one_place():
    shape, n = regular_polygon(4), 50
    points = shape.vertices[:1].expand(n, 2) * 1.001
    assert evenness(points, shape) == pytest.approx(1 / n)
    assert contour_gaps(points, shape).sum() == pytest.approx(4 * np.sqrt(2))
    # A disc around a corner of a square cuts one radius from each side.
    assert coverage(shape.vertices[:1], shape, radius=0.5) == pytest.approx(1 / (4 * np.sqrt(2)))


def test_a_point_beside_an_edge_covers_a_chord():
    square = Contour(
        torch.tensor([[0.0, 0], [10, 0], [10, 10], [0, 10]]).double(), torch.tensor([[0, 1], [1, 2], [2, 3], [3, 0]])
    )
    beside = torch.tensor([[5.0, 0.6]], dtype=torch.float64)
    assert coverage(beside, square, radius=1.0) == pytest.approx(2 * 0.8 / 40)
    assert coverage(beside + torch.tensor([0.0, 0.5]), square, radius=1.0) == 0
    two = torch.tensor([[5.0, 0.0], [6.0, 0.0]], dtype=torch.float64)
    assert coverage(two, square, radius=1.0) == pytest.approx(3 / 40)
    edges, along, distance = nearest_on_contour(beside, square)
    assert (edges[0], along[0], distance[0]) == (0, 5, pytest.approx(0.6))


@pytest.mark.parametrize("shape", SHAPES)
def test_coverage_agrees_with_a_fine_ruler(shape):
    points = sample_points(shape, 30, 0) + 0.05 * torch.from_numpy(np.random.default_rng(1).normal(size=(30, 2)))
    ruler = even_points(shape, 100_000)
    near = (torch.cdist(ruler, points).min(dim=1).values < 0.1).double().mean()
    assert coverage(points, shape, radius=0.1) == pytest.approx(float(near), abs=2e-4)


def test_evenness_is_invariant():
    shape = star(5, 1.5, 0.35)
    points = sample_points(shape, 200, 3)
    turn = torch.tensor([[0.6, -0.8], [0.8, 0.6]], dtype=torch.float64)
    moved = shape.with_vertices(3 * shape.vertices @ turn + 1)
    assert evenness(3 * points @ turn + 1, moved) == pytest.approx(evenness(points, shape))
    assert coverage(3 * points @ turn + 1, moved) == pytest.approx(coverage(points, shape))
    assert evenness(points.flip(0), shape) == pytest.approx(evenness(points, shape))


def test_distance_to_a_circle():
    points = 1.5 * even_points(circle(), 40)
    assert distance_to_contour(points, circle()) == pytest.approx(0.5, abs=1e-4)


def test_exact_distance():
    generator = np.random.default_rng(0)
    points, others = (torch.from_numpy(generator.normal(size=(25, 3))) for _ in range(2))
    squared = torch.cdist(points, others).square().numpy()
    pairs = linear_sum_assignment(squared)
    assert exact_distance(points, others) == pytest.approx(np.sqrt(squared[pairs].mean()))
    for scale in (1e-12, 1e-8, 1e12):
        assert exact_distance(scale * points, scale * others) == pytest.approx(scale * np.sqrt(squared[pairs].mean()))
    shift = torch.tensor([3.0, 4, 0])
    assert exact_distance(points, points + shift) == pytest.approx(5)
    assert exact_distance(points[:1], points[:1].expand(4, 3)) == 0


def test_doors(unchecked):
    square = regular_polygon(4)
    point = square.vertices[:1]
    with pytest.raises(ValueError, match="radius"):
        coverage(point, square, radius=0.0)
    with pytest.raises(ValueError, match="non-empty"):
        coverage(point[:0], square)
    with pytest.raises(ValueError, match="finite"):
        evenness(point * torch.nan, square)
    with pytest.raises(ValueError, match="once around"):
        evenness(point, Contour(square.vertices, square.edges[[0, 2, 1, 3]]))
    with pytest.raises(ValueError, match="without length"):
        evenness(point, square.with_vertices(square.vertices[[0, 0, 2, 3]]))
    with pytest.raises(ValueError, match="both must agree"):
        exact_distance(point, torch.ones(3, 3, dtype=torch.float64))
