"""The continuous encoding: corners and masses by hand, features, gradients, doors."""

import pytest
import torch

from meshot import Mesh, SurfaceMeasure, surface
from meshot.mesh.mesh import closed_contour
from refusals import refuses


def two_triangles() -> Mesh:
    """Areas 2 and 6 that share an edge; normals along z and x."""
    vertices = [[0.0, 0, 0], [0, 2, 0], [-2, 0, 0], [0, 0, 6]]
    return Mesh(torch.tensor(vertices, dtype=torch.float64), torch.tensor([[0, 1, 2], [0, 1, 3]]))


def test_positions_share_their_corners():
    mesh = two_triangles()
    measure = surface(mesh)
    assert torch.equal(measure.vertices, mesh.vertices)
    assert torch.equal(measure.cells, mesh.faces)
    assert torch.allclose(measure.weights, torch.tensor([0.25, 0.75], dtype=torch.float64))
    assert repr(measure) == "SurfaceMeasure(2 triangles on 4 vertices in R^3, torch.float64)"


def test_a_contour_is_made_of_segments():
    square = closed_contour(torch.tensor([[0.0, 0], [3, 0], [3, 1], [0, 1]], dtype=torch.float64))
    measure = surface(square, normal_scale=2.0)
    assert torch.allclose(measure.weights, torch.tensor([3.0, 1, 3, 1], dtype=torch.float64) / 8)
    corners = measure.vertices[measure.cells]
    assert torch.equal(corners[0], torch.tensor([[0.0, 0, 0, -2], [3, 0, 0, -2]], dtype=torch.float64))
    assert repr(measure) == "SurfaceMeasure(4 segments on 8 vertices in R^4, torch.float64)"


def test_coordinates_are_position_normal_features_of_vertices_then_of_faces():
    mesh = two_triangles()
    linear = torch.tensor([[1.0], [2], [3], [4]], dtype=torch.float64)
    constant = torch.tensor([[10.0, 11], [20, 21]], dtype=torch.float64)
    measure = surface(mesh, normal_scale=5.0, features=linear, face_features=constant)
    corners = measure.vertices[measure.cells]
    assert corners.shape == (2, 3, 9)
    assert torch.equal(corners[..., :3], mesh.vertices[mesh.faces])
    normals = torch.tensor([[0.0, 0, 5], [5, 0, 0]], dtype=torch.float64)
    assert torch.allclose(corners[..., 3:6], normals[:, None].expand(2, 3, 3))
    assert torch.equal(corners[..., 6], linear[mesh.faces][..., 0])
    assert torch.equal(corners[..., 7:], constant[:, None].expand(2, 3, 2))


def test_features_of_vertices_keep_shared_corners():
    mesh = two_triangles()
    measure = surface(mesh, features=torch.ones(4, 2, dtype=torch.float64))
    assert measure.vertices.shape == (4, 5)
    assert torch.equal(measure.cells, mesh.faces)
    assert surface(mesh, face_features=torch.ones(2, 2, dtype=torch.float64)).vertices.shape == (6, 5)


def test_gradients_reach_vertices_and_features():
    mesh, features = two_triangles(), torch.ones(4, 1, dtype=torch.float64)

    def encoded(v, f):
        measure = surface(mesh.with_vertices(v), normal_scale=0.7, features=f)
        return measure.vertices, measure.weights

    leaves = [mesh.vertices.clone().requires_grad_(), features.requires_grad_()]
    assert torch.autograd.gradcheck(encoded, leaves)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"vertices": torch.ones(3)}, r"vertices has shape \(3,\)"),
        ({"cells": torch.tensor([[0, 1, 4]])}, "cells holds indices from 0 to 4, but there are 4"),
        ({"cells": torch.tensor([[0, 1, 2, 3]])}, "triangles or"),
        ({"cells": torch.tensor([[0, 1, 2], [0, 3, 0]])}, "1 rows that name a vertex twice, the first is row 1"),
        ({"cells": torch.tensor([0, 1, 2])}, r"cells has shape \(3,\)"),
        ({"weights": torch.tensor([0.5, 0.5])}, r"weights has shape \(2,\); \(1,\) is needed"),
        ({"weights": torch.tensor([0.5])}, "weights sum to 0.5"),
    ],
)
def test_doors_of_the_measure(unchecked, changed, message):
    good = {"vertices": torch.eye(4), "cells": torch.tensor([[0, 1, 2]]), "weights": torch.ones(1)}
    SurfaceMeasure(**good)
    refuses(message, SurfaceMeasure, **good | changed)
