"""Several surfaces counted together, and smoothed until none cross."""

import pytest
import torch

import meshot.synth.subject
from meshot.mesh.geometry import signed_volume
from meshot.mesh.shapes import icosphere
from meshot.synth.subject import crossing_faces, kept_apart, on_lattice, united


def test_two_balls_that_overlap_are_smoothed_apart():
    inner, outer = icosphere(3, radius=10.0), icosphere(3, radius=10.5)
    dented = outer.vertices.clone()
    dented[0] *= 0.9  # one vertex of the outer ball lies within the inner one
    meshes = [inner, outer.with_vertices(dented)]
    assert len(crossing_faces(meshes))
    apart = kept_apart(meshes)
    assert not len(crossing_faces(apart))
    moved = (apart[1].vertices - meshes[1].vertices).norm(dim=1)
    assert int((moved > 1e-3).sum()) < 60
    assert float(signed_volume(apart[1])) > float(signed_volume(apart[0]))


def test_what_cannot_be_kept_apart_is_said(unchecked, monkeypatch):
    monkeypatch.setattr(meshot.synth.subject, "_SMOOTHINGS", 2)
    ball = icosphere(3, radius=10.0)
    shifted = ball.with_vertices(ball.vertices + torch.tensor([10.0, 0, 0], dtype=torch.float64))
    assert kept_apart([ball, shifted]) is None
    monkeypatch.setattr(meshot.synth.subject, "_ROUNDS", 0)
    assert kept_apart([ball]) is None
    with pytest.raises(ValueError, match="meshes is empty"):
        kept_apart([])


def test_meshes_are_united_in_order():
    meshes = [icosphere(0), icosphere(1), icosphere(0)]
    both = united(meshes)
    assert len(both.vertices) == 12 + 42 + 12
    assert torch.equal(both.faces[-20:], meshes[2].faces + 54)
    points = torch.tensor([[0.1, -70.123456789, 1e-5]], dtype=torch.float64)
    assert float((on_lattice(points) - points).abs().max()) <= 2.0**-14
    assert float(signed_volume(both)) == pytest.approx(sum(float(signed_volume(m)) for m in meshes))
