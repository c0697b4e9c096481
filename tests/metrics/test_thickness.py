"""Thickness and volume between two surfaces against closed forms and slow, obvious twins."""

import numpy as np
import pytest
import torch

from meshot.mesh.geometry import signed_volume
from meshot.mesh.shapes import ellipsoid, folded_sphere, icosphere
from meshot.metrics.distances import Surface, SurfaceSample
from meshot.metrics.thickness import cortical_thickness, cortical_volumes
from refusals import refuses


def test_between_spheres_it_is_the_difference_of_radii():
    inner, outer = icosphere(5, radius=30.0), icosphere(5, radius=32.5)
    np.testing.assert_allclose(cortical_thickness(inner, outer), 2.5, atol=0.01)


def test_it_is_the_mean_of_both_nearest_distances():
    """A surface and the same one moved sideways: neither nearest point is the corresponding vertex."""
    white = folded_sphere(3)
    shift = torch.tensor([0.5, 0.0, 0.0], dtype=white.vertices.dtype) * white.vertices.norm(dim=1).mean()
    pial = white.with_vertices(1.1 * white.vertices + shift)

    def nearest(points, mesh):
        fine = Surface(mesh)
        return fine.offsets(SurfaceSample(points.numpy(), np.zeros((len(points), 3)))).distances

    found = cortical_thickness(white, pial, largest=1e9)
    slow = (nearest(white.vertices.double(), pial) + nearest(pial.vertices.double(), white)) / 2
    np.testing.assert_allclose(found, slow)
    pairs = (white.vertices - pial.vertices).norm(dim=1).numpy()
    assert (found <= pairs + 1e-9).all()
    assert found.mean() < 0.9 * pairs.mean()


def test_large_distances_are_cut():
    inner, outer = icosphere(3, radius=10.0), icosphere(3, radius=19.0)
    assert set(cortical_thickness(inner, outer)) == {5.0}
    assert cortical_thickness(inner, outer, largest=20.0).min() > 8.5


@pytest.mark.parametrize("outer", [icosphere(3, radius=12.0), ellipsoid(3, (12.0, 14.0, 17.0))], ids=["sphere", "egg"])
def test_volumes_add_up_to_what_lies_between(outer):
    inner = icosphere(3, radius=10.0)
    assert torch.equal(inner.faces, outer.faces)
    found = cortical_volumes(inner, outer)
    assert found.sum() == pytest.approx(float(signed_volume(outer) - signed_volume(inner)), rel=1e-9)
    assert (found > 0).all()
    assert cortical_volumes(outer, inner).sum() == pytest.approx(-found.sum(), rel=1e-9)


def test_a_volume_is_that_of_the_prisms_around_a_vertex():
    """Over a flat sheet, every vertex has a third of the area of its faces times the height."""
    sheet = icosphere(2)
    flat = sheet.with_vertices(torch.tensor([[x, y, 0.0] for x, y, _ in sheet.vertices.tolist()]).double())
    up = flat.with_vertices(flat.vertices + torch.tensor([0.0, 0.0, 2.0]).double())
    corners = flat.vertices[flat.faces]
    areas = torch.linalg.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] / 2
    expected = (
        torch.zeros(len(flat.vertices))
        .double()
        .index_add(0, flat.faces.flatten(), (2.0 * areas / 3).repeat_interleave(3))
    )
    np.testing.assert_allclose(cortical_volumes(flat, up), expected.numpy(), atol=1e-12)


def test_doors():
    inner = icosphere(2)
    refuses(
        "the white surface has 162 vertices and 320 faces, the pial one 642", cortical_thickness, inner, icosphere(3)
    )
    turned = type(inner)(inner.vertices, inner.faces.roll(1, dims=1))
    refuses("or other faces; the same faces are needed", cortical_volumes, inner, turned)
    refuses("largest", cortical_thickness, inner, inner, largest=0.0)
    broken = inner.with_vertices(inner.vertices * float("nan"))
    refuses("vertices", cortical_thickness, inner, broken)
