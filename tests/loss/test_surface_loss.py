"""The loss by name is the loss by hand."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot import (
    chamfer,
    empirical,
    sinkhorn_divergence,
    sliced_wasserstein,
    surface,
    varifold,
    windowed_sliced_wasserstein,
)
from meshot.loss.directions import random_directions
from meshot.loss.surface_loss import SurfaceLoss
from meshot.measure.discrete import varifold_sample
from meshot.mesh.shapes.solids import icosphere

SOURCE, TARGET = icosphere(2, 10.0), icosphere(3, 12.0, centre=(1.0, 0.0, 0.0))


def random() -> np.random.Generator:
    return np.random.default_rng(5)


def test_ddot_is_the_sliced_loss_between_varifolds():
    wanted = sliced_wasserstein(
        varifold(SOURCE, normal_scale=3.0), varifold(TARGET, normal_scale=3.0), random_directions(100, 6, random())
    )
    assert float(SurfaceLoss(normal_scale=3.0)(SOURCE, TARGET, random())) == float(wanted)


def test_cortexode_is_chamfer_between_samples_times_a_thousand():
    draw = random()
    wanted = 1000 * chamfer(empirical(SOURCE, 320, draw), empirical(TARGET, 320, draw))
    assert float(SurfaceLoss("chamfer", "samples", factor=1000.0)(SOURCE, TARGET, random())) == float(wanted)


def test_every_other_pair_of_names():
    draw = random()
    drawn = [varifold_sample(mesh, 200, draw, normal_scale=2.0, detach_weights=True) for mesh in (SOURCE, TARGET)]
    loss = SurfaceLoss("chamfer", n_supports=200, normal_scale=2.0, detach_weights=True)
    assert float(loss(SOURCE, TARGET, random())) == float(chamfer(*drawn))
    draw = random()
    pair = [empirical(mesh, 50, draw) for mesh in (SOURCE, TARGET)]
    loss = SurfaceLoss("sinkhorn", "samples", n_supports=50, blur=1.0)
    assert float(loss(SOURCE, TARGET, random())) == pytest.approx(float(sinkhorn_divergence(*pair, 2, 1.0)), rel=1e-9)
    directions = random_directions(20, 3, random())
    wanted = sliced_wasserstein(surface(SOURCE), surface(TARGET), directions, 1)
    assert float(SurfaceLoss(encoding="surface", n_directions=20, p=1)(SOURCE, TARGET, random())) == float(wanted)


def test_in_windows_every_window_has_its_directions_and_lies_on_the_target():
    draw, goal = random(), varifold(TARGET, normal_scale=3.0)
    directions = random_directions(4 * 10, 6, draw).reshape(4, 10, 6)
    centres = goal.points[draw.choice(len(goal.weights), 4, p=goal.weights.numpy()), :3]
    wanted = windowed_sliced_wasserstein(varifold(SOURCE, normal_scale=3.0), goal, centres, 5.0, directions, 1)
    loss = SurfaceLoss(normal_scale=3.0, window=5.0, n_windows=4, n_directions=10, p=1)
    assert float(loss(SOURCE, TARGET, random())) == float(wanted)
    assert float(dataclasses.replace(loss, window=None)(SOURCE, TARGET, random())) != pytest.approx(float(wanted))


@pytest.mark.parametrize("encoding", ["varifold", "samples", "surface"])
def test_the_gradient_reaches_the_vertices_in_their_own_precision(encoding):
    vertices = SOURCE.vertices.float().requires_grad_()
    loss = SurfaceLoss(encoding=encoding)(SOURCE.with_vertices(vertices), TARGET.to(torch.float32), random())
    (pull,) = torch.autograd.grad(loss, vertices)
    assert pull.dtype == torch.float32
    assert float(pull.norm()) > 0


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"loss": "hausdorff"}, "loss is 'hausdorff'; one of sliced, chamfer, sinkhorn"),
        ({"encoding": "mesh"}, "encoding is 'mesh'"),
        ({"p": 3}, "p is 3; one of 1, 2"),
        ({"loss": "chamfer", "encoding": "surface"}, "only the sliced loss"),
        ({"encoding": "surface", "n_supports": 10}, "without n_supports"),
        ({"loss": "chamfer", "p": 1}, "Chamfer squares"),
        ({"n_directions": 0}, "n_directions is 0"),
        ({"n_supports": 0}, "n_supports is 0"),
        ({"factor": 0.0}, "factor is 0.0"),
        ({"blur": float("inf")}, "blur is inf"),
        ({"normal_scale": -1.0}, "normal_scale is -1.0"),
        ({"window": 0.0}, "window is 0.0; a finite number > 0"),
        ({"window": 5.0, "n_windows": 0}, "n_windows is 0"),
        ({"window": 5.0, "loss": "chamfer"}, "only the sliced loss of the varifold or of samples is taken in windows"),
        ({"window": 5.0, "encoding": "surface"}, "window is 5.0"),
    ],
)
def test_doors(arguments, words):
    with pytest.raises(ValueError, match=words):
        SurfaceLoss(**arguments)
