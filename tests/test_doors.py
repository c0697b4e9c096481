"""Every check at the door, seen to fire with a message that names the value."""

import re

import numpy as np
import pytest
import torch

from meshot import (
    Contour,
    DiscreteMeasure,
    Mesh,
    empirical,
    errors,
    integrate,
    orthogonal_directions,
    quasi_directions,
    random_directions,
    sliced_wasserstein_estimate,
    varifold,
)
from meshot.flow import FitSettings, fit_flow, grid_around, sliced_loss
from meshot.loss import SlicedLoss, SurfaceLoss, VarifoldEncoding
from meshot.mesh import shapes
from meshot.mesh.mesh import closed_contour
from meshot.rng import numpy_generator

TRIANGLE = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((0, 3)), [[0, 1, 2]], "empty"),
        ([[0.0, 0], [1, 0], [0, 1]], [[0, 1, 2]], r"\(n, 3\) is needed"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "floating point is needed"),
        ([[0.0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], r"NaN or infinite, the first at index \(0, 2\)"),
        ("mesh", [[0, 1, 2]], "cannot be made a tensor"),
        (TRIANGLE, "faces", "cannot be made a tensor"),
        (TRIANGLE, [[0, 1, 3]], "from 0 to 3, but there are 3"),
        (TRIANGLE, [[-1, 1, 2]], "from -1 to 2"),
        (TRIANGLE, [[0.0, 1, 2]], "integers are needed"),
        (TRIANGLE, [[0, 1]], r"faces has shape \(1, 2\)"),
        (TRIANGLE, np.zeros((0, 3), dtype=int), "empty"),
        (TRIANGLE, [[0, 1, 1]], "names? a vertex twice"),
        (TRIANGLE, [[1, 0, 1]], "names? a vertex twice"),
    ],
)
def test_mesh_refuses(unchecked, vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        Mesh(vertices, faces)


def test_mesh_takes_arrays_and_keeps_dtype(unchecked):
    mesh = Mesh(np.array(TRIANGLE, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.int32))
    assert mesh.vertices.dtype == torch.float32
    assert mesh.faces.dtype == torch.int64
    assert mesh.to(torch.float64).vertices.dtype == torch.float64
    assert "3 vertices, 1 faces" in repr(mesh)


def test_with_vertices_keeps_faces_and_checks_shape():
    mesh = Mesh(torch.tensor(TRIANGLE), torch.tensor([[0, 1, 2]]))
    moved = mesh.with_vertices(mesh.vertices + 1)
    assert moved.faces is mesh.faces
    assert torch.equal(moved.vertices, mesh.vertices + 1)
    with pytest.raises(ValueError, match=r"\(2, 3\); \(3, 3\) is needed"):
        mesh.with_vertices(mesh.vertices[:2])


def test_contour_refuses(unchecked):
    with pytest.raises(ValueError, match=r"\(n, 2\) is needed"):
        Contour(TRIANGLE, [[0, 1]])
    with pytest.raises(ValueError, match="at least three"):
        closed_contour(torch.zeros(2, 2))


@pytest.mark.parametrize(
    ("points", "weights", "message"),
    [
        (np.zeros((0, 2)), None, "empty"),
        (np.zeros(3), None, r"\(n, d\) is needed"),
        (np.zeros((2, 2)), [0.5, 0.6], "sum to 1.1"),
        (np.zeros((2, 2)), [-0.5, 1.5], "negative"),
        (np.zeros((2, 2)), [1.0], r"\(2,\) is needed"),
        (np.zeros((2, 2)), [0.5, np.nan], "NaN"),
        (np.zeros((2, 2)), [0.5, 0.5 + 2e-5], "sum to 1.00002"),
        (np.array([[np.inf, 0]]), None, "infinite"),
    ],
)
def test_measure_refuses(unchecked, points, weights, message):
    weights = (
        None
        if weights is None
        else torch.as_tensor(weights, dtype=None if hasattr(weights, "dtype") else torch.float64)
    )
    with pytest.raises(ValueError, match=message):
        DiscreteMeasure(points, weights)


def test_other_spaces_are_refused():
    with pytest.raises(ValueError, match=r"R\^2 and target in R\^3"):
        errors.require_same_space(torch.zeros(1, 2), torch.zeros(1, 3))
    with pytest.raises(ValueError, match="both must agree"):
        errors.require_same_space(torch.zeros(1, 2), torch.zeros(1, 2, dtype=torch.float64))


@pytest.mark.parametrize("value", [0, -1, 1.0, True, "3", None])
def test_counts_must_be_positive_integers(value):
    with pytest.raises(ValueError, match="integer >= 1"):
        errors.require_positive_integer(value, "n_points")


@pytest.mark.parametrize("value", [0, 0.0, -1.0, float("inf"), float("nan"), "3", None, [1.0]])
def test_lengths_must_be_finite_and_positive(value):
    errors.require_positive(np.float32(1e-30), "width")
    with pytest.raises(ValueError, match=r"width is .*; a finite number > 0 is needed, in mm$"):
        errors.require_positive(value, "width", "mm")
    with pytest.raises(ValueError, match=r"; a finite number > 0 is needed$"):
        errors.require_positive(value, "width")


@pytest.mark.parametrize("known", [("tree", "brute"), {"tree": 1, "brute": 2}])
def test_a_choice_is_one_of_the_names(known):
    errors.require_choice("tree", "method", known)
    for value in ("bush", "", None, ["tree"]):
        with pytest.raises(ValueError, match=rf"method is {re.escape(repr(value))}; one of tree, brute is needed"):
            errors.require_choice(value, "method", known)


@pytest.mark.parametrize("kind", [int, np.int64, np.int32, np.uint8])
def test_a_count_may_be_an_integer_of_numpy(unchecked, tmp_path, kind):
    cube = shapes.cube()
    errors.require_positive_integer(kind(3), "n_points")
    for directions in (random_directions, orthogonal_directions):
        assert directions(kind(5), kind(3), 0).shape == (5, 3)
    assert quasi_directions(kind(5), kind(3)).shape == (5, 3)
    assert len(empirical(cube, kind(7), 0).points) == len(empirical(cube, 7, kind(0)).points) == 7
    assert sliced_wasserstein_estimate(cube, cube, kind(6), 0).n_directions == 6
    assert integrate(lambda time, x: x, cube.vertices, kind(4)).shape == (8, 3)
    assert SurfaceLoss(VarifoldEncoding(kind(9)), SlicedLoss(kind(4)))(cube, cube, np.random.default_rng(0)) >= 0
    settings = FitSettings(n_iterations=kind(2), n_steps=kind(2), n_directions=(kind(2), kind(4)), check_every=kind(1))
    field = grid_around(cube.vertices, spacings=(1.0,), margin=1.0)
    loss = sliced_loss(cube, varifold)
    path = tmp_path / "fit.safetensors"
    assert fit_flow(field, cube, loss, settings, checkpoint=path).best_iteration >= 1
    assert fit_flow(field, cube, loss, settings, checkpoint=path).best_iteration >= 1


@pytest.mark.parametrize("value", [None, -1, 0.5, True, "seed"])
def test_randomness_needs_a_seed(unchecked, value):
    with pytest.raises(ValueError, match="a seed"):
        numpy_generator(value)


def test_generators_are_repeatable_and_go_on():
    held = np.random.default_rng(3)
    assert numpy_generator(held) is held
    first, second = (numpy_generator(torch.Generator().manual_seed(5)).random() for _ in range(2))
    assert first == second
    ongoing = torch.Generator().manual_seed(5)
    assert numpy_generator(ongoing).random() != numpy_generator(ongoing).random()
    assert numpy_generator(7).random() == np.random.default_rng(7).random()
