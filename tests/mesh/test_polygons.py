"""Polygons cut into triangles: area, orientation and measure stay; what bounds no surface is refused."""

import math

import numpy as np
import pytest
import torch

from meshot import random_directions, sliced_wasserstein, surface, triangulate
from meshot.mesh.geometry import face_area_vectors, signed_volume
from meshot.mesh.shapes import cube

STAR = [(math.cos(a) * r, math.sin(a) * r) for a, r in zip(np.arange(10) * math.pi / 5, [3, 1] * 5, strict=True)]
COMB = [(0, 0), (6, 0), (6, 3), (5, 3), (5, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]
SPIRAL = [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)]


def lifted(polygon) -> torch.Tensor:
    """Points of the plane on a tilted one in space."""
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    return torch.from_numpy(np.array(polygon, dtype=float) @ frame[:2])


@pytest.mark.parametrize("shift", range(10))
@pytest.mark.parametrize("polygon", [STAR, COMB, SPIRAL], ids=["star", "comb", "spiral"])
def test_areas_add_up_with_one_orientation(polygon, shift):
    """The shoelace formula; every triangle turns as the polygon does, so that none is covered twice."""
    order = [(i + shift) % len(polygon) for i in range(len(polygon))]
    x, y = np.array(polygon, dtype=float).T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    vectors = face_area_vectors(triangulate(lifted(polygon), [order]))
    assert len(vectors) == len(polygon) - 2
    assert float(vectors.sum(dim=0).norm()) == pytest.approx(area, rel=1e-12)
    assert float(vectors.norm(dim=1).sum()) == pytest.approx(area, rel=1e-12)


def test_squares_of_a_cube_make_the_measure_of_its_triangles():
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    turned = [square[k % 4 :] + square[: k % 4] for k, square in enumerate(squares)]
    mesh = triangulate(cube().vertices, turned)
    assert float(signed_volume(mesh)) == pytest.approx(1)
    directions = random_directions(6, 3, 0)
    assert float(sliced_wasserstein(surface(mesh), surface(cube()), directions)) < 1e-28


def test_faces_of_several_sizes_in_their_order():
    vertices = lifted([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (1, 2)]).requires_grad_()
    mesh = triangulate(vertices, [[0, 1, 4, 5], [5, 4, 6], torch.tensor([1, 2, 3, 4])])
    assert mesh.faces.tolist() == [[0, 1, 4], [0, 4, 5], [5, 4, 6], [1, 2, 3], [1, 3, 4]]
    assert mesh.vertices.requires_grad


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        ([[0, 1]], r"polygon 0 is \[0, 1\]; at least three"),
        ([[0, 1, 2], [0, 1, 2, 1]], "polygon 1 is .* each a vertex of its own"),
        ([[0, 1, 4, 2]], "there are 4 vertices"),
        ([], "faces is empty"),
    ],
)
def test_doors(unchecked, polygons, message):
    with pytest.raises(ValueError, match=message):
        triangulate(lifted([(0, 0), (1, 0), (1, 1), (0, 1)]), polygons)


@pytest.mark.parametrize("polygon", [[(0, 0), (3, 2), (3, 0), (0, 1)], [(0, 0), (4, 0), (1, 3), (2, -1), (3, 3)]])
def test_a_polygon_that_crosses_itself_is_refused(polygon):
    with pytest.raises(ValueError, match="crosses itself"):
        triangulate(lifted(polygon), [list(range(len(polygon)))])
