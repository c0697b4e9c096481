"""Smoothing: what it does to a sphere, to noise, and to volume."""

import numpy as np
import pytest
import torch

from meshot.mesh.editing import laplacian_smoothing, neighbour_means, taubin_smoothing
from meshot.mesh.geometry import signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere


@pytest.fixture
def rough() -> Mesh:
    sphere = icosphere(3)
    noise = np.random.default_rng(0).normal(scale=0.02, size=(len(sphere.vertices), 1))
    return sphere.with_vertices(sphere.vertices * torch.from_numpy(1 + noise))


def roughness(mesh: Mesh) -> float:
    return float(mesh.vertices.norm(dim=1).std())


def test_neighbour_means_by_hand():
    mesh = Mesh(
        torch.tensor([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 4], [9, 9, 9]]), torch.tensor([[0, 1, 2], [1, 3, 2]])
    )
    means = neighbour_means(mesh)
    assert means[0].tolist() == [1, 1, 0]
    # Vertex 1 shares two faces with 2, one with 0 and one with 3.
    assert means[1].tolist() == [0.5, 1.5, 1]
    assert means[4].tolist() == [9, 9, 9]


def test_smoothing_takes_noise_away(rough):
    assert roughness(laplacian_smoothing(rough, 3)) < 0.4 * roughness(rough)
    assert roughness(taubin_smoothing(rough, 10)) < 0.5 * roughness(rough)


def test_laplacian_shrinks_and_taubin_hardly(rough):
    volume = float(signed_volume(rough))
    assert float(signed_volume(laplacian_smoothing(rough, 20))) < 0.93 * volume
    assert float(signed_volume(taubin_smoothing(rough, 20))) == pytest.approx(volume, rel=0.03)


def test_no_steps_change_nothing(rough):
    assert torch.equal(laplacian_smoothing(rough, 0).vertices, rough.vertices)
    assert torch.equal(taubin_smoothing(rough, 0).vertices, rough.vertices)


@pytest.mark.parametrize("bad", [-1, 1.5, True])
def test_steps_are_checked(rough, unchecked, bad):
    for smoothing in (laplacian_smoothing, taubin_smoothing):
        with pytest.raises(ValueError, match="n_steps"):
            smoothing(rough, bad)


def test_amounts_are_checked(rough):
    with pytest.raises(ValueError, match="amount"):
        laplacian_smoothing(rough, 1, amount=1.5)
    with pytest.raises(ValueError, match="amount"):
        taubin_smoothing(rough, 1, amount=0.0)
    with pytest.raises(ValueError, match="pass_band"):
        taubin_smoothing(rough, 1, pass_band=2.5)
