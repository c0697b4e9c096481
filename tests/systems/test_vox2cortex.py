"""Vox2Cortex: its losses by hand, four stages from coarse to fine, both sides at once."""

import dataclasses

import numpy as np
import pytest
import torch

from meshot.loss.penalties import laplacian_length, normal_inconsistency, squared_edge_length
from meshot.loss.transport import chamfer
from meshot.mesh.geometry import sample_points
from meshot.mesh.shapes import icosphere
from meshot.systems.learning import scaled_image
from meshot.systems.vox2cortex import N_STAGES, MeshNetwork, MeshWeights, chamfer_and_normals, curved_target
from phantoms import phantom_subjects

BOXES = {"left": torch.tensor([[-18.0, -8, -8], [-2, 8, 8]]), "right": torch.tensor([[2.0, -8, -8], [18, 8, 8]])}


def test_on_a_sphere_the_weight_is_one_plus_the_curvature():
    found, target = (icosphere(3, radius, dtype=torch.float32) for radius in (2.2, 2.0))
    first, second = (np.random.default_rng(3) for _ in range(2))
    weighted, normals = chamfer_and_normals(found, curved_target(target), 400, 5.0, first)
    points = [sample_points(mesh, 400, second) for mesh in (found, target)]
    assert float(weighted) == pytest.approx(1.5 * float(chamfer(*points)), rel=0.02)
    assert 0 <= float(normals) < 0.1
    capped, _ = chamfer_and_normals(found, curved_target(target), 400, 1.0, np.random.default_rng(3))
    assert float(capped) == pytest.approx(float(chamfer(*points)), rel=1e-4)


def test_the_loss_is_the_sum_of_its_terms_in_units_of_the_extent():
    found, target = icosphere(2, 2.2, dtype=torch.float32), curved_target(icosphere(2, 2.0))
    weights = MeshWeights(extent=10.0)
    total = weights.mesh_loss(found, target, 300, np.random.default_rng(0))
    pairs, normals = chamfer_and_normals(found, target, 300, 5.0, np.random.default_rng(0))
    expected = (pairs + 5 * squared_edge_length(found)) / 100 + 0.1 * laplacian_length(found) / 10
    expected = expected + 0.01 * normals + 0.001 * normal_inconsistency(found)
    torch.testing.assert_close(total, expected)


def test_gradients_of_the_weighted_chamfer():
    target = dataclasses.replace(curved_target(icosphere(1, 2.0)), mesh=icosphere(1, 2.0))
    target = dataclasses.replace(target, curvatures=target.curvatures.double())
    mesh = icosphere(1, 2.3)
    vertices = mesh.vertices.clone().requires_grad_()

    def loss(x):
        # Fixed locations: the draw of faces follows their areas, which the differences would change.
        return sum(chamfer_and_normals(mesh.with_vertices(x), target, 30, 5.0, np.random.default_rng(1)))

    loss(vertices).backward()
    direction = torch.randn(vertices.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    with torch.no_grad():
        difference = (loss(vertices + 1e-6 * direction) - loss(vertices - 1e-6 * direction)) / 2e-6
    assert float((vertices.grad * direction).sum()) == pytest.approx(float(difference), rel=1e-3)


def test_stages_read_coarse_levels_before_fine_ones():
    network = MeshNetwork(2, 4, 2, 4, 1, {"shape": "sphere"})
    assert [network.levels(k) for k in range(N_STAGES)] == [(2, 3, 4), (1, 2, 4, 5), (1, 2, 4, 5), (0, 1, 5, 6)]


def test_before_training_nothing_moves_and_all_stages_are_learned():
    scan = phantom_subjects(1, ())[0].scan
    network = MeshNetwork(2, 2, 2, 4, 1, {"shape": "sphere"}, BOXES)
    maps = network.unet(scaled_image(scan.image))
    template = network.templates["right"].mesh()
    found = network.move(maps, scan.image, template, "right")
    assert len(found) == N_STAGES
    torch.testing.assert_close(found[-1].vertices, template.vertices)
    assert network.segmentation(maps).shape == (1, 3, *scan.image.data.shape)
    sum(mesh.vertices.square().sum() for mesh in found).backward()
    assert all(float(stage.move.own.weight.grad.abs().sum()) > 0 for stage in network.stages)
