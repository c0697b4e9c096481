"""The projected law: closed forms by hand, the slow twin, samples, atoms, doors."""

import math

import numpy as np
import pytest
import torch
from scipy import stats

import oracles_exact
from meshot import DiscreteMeasure, Mesh, empirical, random_directions, surface, triangulate, varifold
from meshot.loss.exact import projected_law
from meshot.mesh.mesh import Contour
from meshot.mesh.shapes import cube, folded_sphere, icosphere, letter_e, tetrahedron

X, Y = (torch.eye(3, dtype=torch.float64)[k] for k in (0, 1))


def triangle(*corners: tuple[float, float, float]) -> Mesh:
    return Mesh(torch.tensor(corners, dtype=torch.float64), torch.tensor([[0, 1, 2]]))


def test_a_triangle_is_a_tent():
    """Corners at 0, 1 and 4: the peak 2/(4 − 0) at the middle one."""
    law = projected_law(surface(triangle((1, 5, 0), (4, 0, 1), (0, 0, 0))), X)
    x = np.array([-1.0, 0, 0.5, 1, 2.5, 4, 5])
    assert np.allclose(law.density(x), [0, 0, 0.25, 0.5, 0.25, 0, 0])
    assert np.allclose(law.distribution(x), [0, 0, 1 / 16, 0.25, 1 - 0.25 * 1.5 / 2, 1, 1])
    assert len(law.atoms[0]) == 0


def test_two_corners_at_one_end_make_a_slope():
    law = projected_law(surface(triangle((0, 0, 0), (0, 3, 0), (2, 1, 0))), X)
    assert np.allclose(law.density(np.array([1e-9, 1.0, 2.0])), [1, 0.5, 0], atol=1e-8)


def test_a_cube_along_its_axis_is_two_atoms_and_a_box():
    law = projected_law(surface(cube(2.0)), X)
    places, masses = law.atoms
    assert np.allclose(places, [-1, 1])
    assert np.allclose(masses, [1 / 6, 1 / 6])
    assert np.allclose(law.density(np.array([-0.99, 0.1, 0.99])), 1 / 3)
    assert np.allclose(law.distribution(np.array([-1.1, -1, 0, 0.999999999999, 1])), [0, 1 / 6, 0.5, 5 / 6, 1])


def test_a_face_seen_edge_on_is_an_atom():
    law = projected_law(surface(triangle((1, 0, 0), (1, 1, 0), (1, 0, 3))), X)
    assert law.atoms[0].tolist() == [1.0]
    assert law.atoms[1].tolist() == [1.0]
    assert law.distribution(np.array([0.9, 1.0])).tolist() == [0.0, 1.0]
    assert law.density(np.array([1.0])).tolist() == [0.0]


def test_a_sphere_is_nearly_uniform():
    """Archimedes: the area between parallel planes depends on their distance alone."""
    law = projected_law(surface(icosphere(4)), random_directions(1, 3, 0)[0])
    x = np.linspace(-1, 1, 41)
    assert np.abs(law.distribution(x) - (x + 1) / 2).max() < 2e-3


def test_an_edge_is_a_box():
    law = projected_law(surface(Contour(torch.tensor([[0.0, 0], [3, 4]]).double(), torch.tensor([[0, 1]]))), X[:2])
    assert np.allclose(law.density(np.array([-0.1, 0.1, 2.9, 3.1])), [0, 1 / 3, 1 / 3, 0])


@pytest.mark.parametrize(
    "measure",
    [
        surface(tetrahedron()),
        surface(folded_sphere(2, 1.0, 0.3)),
        surface(letter_e()),
        surface(icosphere(1), normal_scale=0.7),
    ],
    ids=repr,
)
def test_the_slow_twin_agrees(measure):
    d = measure.vertices.shape[1]
    for theta in [*random_directions(3, d, 0), torch.eye(d, dtype=torch.float64)[0]]:
        law = projected_law(measure, theta)
        places = (measure.vertices @ theta).numpy()
        x = np.linspace(places.min() - 0.1, places.max() + 0.1, 301)
        expected = oracles_exact.share_below(places, measure.cells.numpy(), measure.weights.numpy(), x)
        assert np.allclose(law.distribution(x), expected, rtol=0, atol=1e-13)
        assert law.masses.sum() == pytest.approx(1, abs=1e-14)


@pytest.mark.parametrize("shape", [tetrahedron(), folded_sphere(3, 1.0, 0.3), letter_e()], ids=repr)
def test_a_million_points_follow_the_law(shape):
    """Kolmogorov and Smirnov: the largest gap of 10⁶ honest points exceeds 1.95/√n once in a thousand samples."""
    d = shape.vertices.shape[1]
    theta = random_directions(1, d, 3)[0]
    points = (empirical(shape, 1_000_000, 5).points @ theta).numpy()
    law = projected_law(surface(shape), theta)
    assert stats.kstest(points, law.distribution).statistic < 1.95 / math.sqrt(len(points))


def test_points_are_atoms():
    points = torch.tensor([[0.0], [2.0], [2.0], [5.0]], dtype=torch.float64)
    weights = torch.tensor([0.1, 0.2, 0.3, 0.4], dtype=torch.float64)
    law = projected_law(DiscreteMeasure(points, weights), torch.ones(1, dtype=torch.float64))
    assert np.allclose(law.atoms, [[0, 2, 5], [0.1, 0.5, 0.4]])
    assert np.allclose(law.distribution(np.array([-1.0, 0, 1, 2, 4.9, 5])), [0, 0.1, 0.1, 0.6, 0.6, 1])
    assert not law.density(np.array([0.0, 1, 2])).any()


def test_faces_with_more_corners_have_the_law_of_their_triangles():
    """A convex and a notched pentagon, against the area of the part below x by clipping."""
    outline = torch.tensor([[0.0, 0, 0], [4, 0, 0], [4, 3, 0], [2, 1, 0], [0, 3, 0]]).double()
    law = projected_law(surface(triangulate(outline, [[0, 1, 2, 3, 4]])), X)
    x = np.array([1.0, 2, 3])
    # Left half: heights fall from 3 to 1 on [0, 2], then rise again; total area 8.
    assert np.allclose(law.distribution(x), [2.5 / 8, 0.5, 5.5 / 8])


def test_doors(unchecked):
    with pytest.raises(ValueError, match="unit rows"):
        projected_law(surface(cube()), 2 * X)
    with pytest.raises(ValueError, match="3"):
        projected_law(varifold(cube(), normal_scale=1.0), X)
