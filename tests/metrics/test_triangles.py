import math

import numpy as np
import pytest
import torch

from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, icosphere, tetrahedron
from meshot.metrics.evaluation import edge_length_variation, face_area_variation, smallest_angles


def triangle(a, b, c):
    return Mesh(torch.tensor([a, b, c], dtype=torch.float64), torch.tensor([[0, 1, 2]]))


def test_the_tetrahedron_is_perfect():
    assert edge_length_variation(tetrahedron()) == pytest.approx(0, abs=1e-12)
    assert face_area_variation(tetrahedron()) == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(smallest_angles(tetrahedron()), 60)


def test_a_3_4_5_triangle():
    mesh = triangle((0, 0, 0), (4, 0, 0), (0, 3, 0))
    np.testing.assert_allclose(smallest_angles(mesh), math.degrees(math.atan(3 / 4)))
    assert edge_length_variation(mesh) == pytest.approx(math.sqrt(2 / 3) / 4)


def test_a_cube_of_halved_squares():
    # 12 edges of length 1, 6 diagonals of length √2.
    lengths = [1.0] * 12 + [math.sqrt(2)] * 6
    assert edge_length_variation(cube()) == pytest.approx(np.std(lengths) / np.mean(lengths))
    np.testing.assert_allclose(smallest_angles(cube()), 45)


def test_two_areas():
    mesh = Mesh(
        torch.tensor([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 9), (3, 0, 9), (0, 1, 9)], dtype=torch.float64),
        torch.tensor([[0, 1, 2], [3, 4, 5]]),
    )
    assert face_area_variation(mesh) == pytest.approx(0.5)  # areas ½ and 1½


def test_sizes_do_not_matter_and_faces_without_area_are_zero():
    small, large = icosphere(3), icosphere(3, 40.0)
    assert edge_length_variation(small) == pytest.approx(edge_length_variation(large))
    flat = triangle((0, 0, 0), (1, 0, 0), (2, 0, 0))
    assert smallest_angles(flat) == pytest.approx(0)
    assert face_area_variation(flat) == 0
