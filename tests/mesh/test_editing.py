"""Smoothing, fewer faces, and edges cut in two: what they change, and what they leave."""

import itertools

import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.editing import (
    decimated,
    laplacian_smoothing,
    neighbour_means,
    simplified,
    taubin_smoothing,
    with_edges_split,
)
from meshot.mesh.geometry import face_areas, face_normals, mesh_edges, signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere, split_in_four
from meshot.metrics.distances import vertex_distances
from refusals import refuses


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


def test_steps_and_amounts_are_checked(rough, unchecked):
    for bad, smoothing in itertools.product((-1, 1.5, True), (laplacian_smoothing, taubin_smoothing)):
        refuses("n_steps", smoothing, rough, bad)
    refuses("amount", laplacian_smoothing, rough, 1, amount=1.5)
    refuses("amount", taubin_smoothing, rough, 1, amount=0.0)
    refuses("pass_band", taubin_smoothing, rough, 1, pass_band=2.5)


@pytest.mark.parametrize("fewer", [decimated, simplified])
def test_a_sphere_stays_a_sphere(fewer):
    sphere = icosphere(4, 10.0)
    found = fewer(sphere, 640)
    assert len(found.faces) == 640
    assert topology(found) == SPHERE
    assert float((found.vertices.norm(dim=1) - 10).abs().max()) < 0.3
    assert fewer(sphere, 10_000) is sphere
    assert fewer(sphere.to(torch.float32), 640).vertices.dtype == torch.float32
    refuses("n_faces is 0", fewer, sphere, 0)


def test_quadric_errors_stay_near_a_curved_surface():
    # An ellipsoid: flat in the middle, sharp at its rim, where short edges alone would round it off.
    fine = icosphere(5, 1.0)
    fine = fine.with_vertices(fine.vertices * torch.tensor([20.0, 20.0, 5.0], dtype=torch.float64))
    gaps = [float(vertex_distances(fine, fewer(fine, 640)).mean()) for fewer in (simplified, decimated)]
    assert gaps[0] < 0.5 * gaps[1]
    assert gaps[0] < 0.1


TRIANGLE = Mesh(torch.tensor([[0.0, 0, 0], [4, 0, 0], [0, 4, 0]]), torch.tensor([[0, 1, 2]]))


@pytest.mark.parametrize("n_sides", [1, 2, 3])
def test_one_triangle_by_any_sides(n_sides):
    sides = [[0, 1], [1, 2], [2, 0]]
    for first in range(3):
        wanted = torch.tensor([sides[(first + k) % 3] for k in range(n_sides)])
        cut = with_edges_split(TRIANGLE, wanted)
        assert len(cut.faces) == 1 + n_sides
        assert torch.equal(cut.vertices[3:], TRIANGLE.vertices[wanted].mean(dim=1))
        assert float(face_areas(cut).sum()) == 8
        # All parts look the way the whole did, and none is empty.
        assert torch.equal(face_normals(cut), torch.tensor([[0.0, 0, 1]]).expand(1 + n_sides, 3))
        assert float(face_areas(cut).min()) >= 2


def test_all_edges_cut_everything_in_four():
    sphere = icosphere(1)
    cut = with_edges_split(sphere, mesh_edges(sphere))
    points, faces = split_in_four(sphere.vertices, sphere.faces)

    def triangles(mesh):
        places = [tuple(sorted(map(tuple, face.tolist()))) for face in mesh.vertices[mesh.faces].round(decimals=9)]
        return sorted(places)

    assert triangles(cut) == triangles(Mesh(points, faces))


def test_any_edges_leave_the_surface_as_it_is():
    sphere, generator = icosphere(3, 10.0), np.random.default_rng(0)
    edges = mesh_edges(sphere)
    some = edges[torch.from_numpy(generator.permutation(len(edges))[:400])].flip(1)
    cut = with_edges_split(sphere, some)
    assert topology(cut) == SPHERE
    assert torch.equal(cut.vertices[: len(sphere.vertices)], sphere.vertices)
    torch.testing.assert_close(cut.vertices[len(sphere.vertices) :], sphere.vertices[some].mean(dim=1))
    assert len(cut.faces) == len(sphere.faces) + 2 * 400  # each edge lies between two faces, and cuts both
    torch.testing.assert_close(signed_volume(cut), signed_volume(sphere))
    torch.testing.assert_close(face_areas(cut).sum(), face_areas(sphere).sum())


@pytest.mark.parametrize(
    ("edges", "words"),
    [
        ([[0, 1], [1, 0]], "twice"),
        ([[0, 1], [1, 1]], r"\[1, 1\], which no face has"),
        ([[0, 9]], "edges"),
        (torch.empty(0, 2), "edges"),
        ([[0, 1, 2]], "edges"),
    ],
)
def test_doors(unchecked, edges, words):
    refuses(words, with_edges_split, TRIANGLE, torch.as_tensor(edges, dtype=torch.int64))
