"""Mending: crossings go, everything else stays, and what cannot be mended is said to be so."""

import numpy as np
import pytest
import torch

from meshot.anatomy.templates import HEMISPHERES, fsaverage5_surface
from meshot.mesh.connectivity import crossing_pairs, self_intersecting_faces
from meshot.mesh.editing import ring_around, smooth_crossings
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import folded_sphere, icosphere, tetrahedron
from refusals import refuses


@pytest.fixture
def spiked() -> Mesh:
    """A folded surface of 81 920 faces with a few vertices thrown far away."""
    mesh = folded_sphere(6)
    generator = np.random.default_rng(0)
    thrown = torch.from_numpy(generator.choice(len(mesh.vertices), 40, replace=False))
    vertices = mesh.vertices.clone()
    vertices[thrown] += torch.from_numpy(generator.normal(scale=6.0, size=(40, 3)))
    return mesh.with_vertices(vertices)


def test_a_mesh_without_crossings_is_returned_as_it_is():
    mesh = icosphere(2)
    assert smooth_crossings(mesh) is mesh


@pytest.mark.parametrize("hemisphere", HEMISPHERES)
def test_real_surfaces_change_at_a_handful_of_vertices(hemisphere):
    white = fsaverage5_surface("white", hemisphere)
    assert len(self_intersecting_faces(white)) == {"left": 0, "right": 4}[hemisphere]
    clean = smooth_crossings(white)
    assert len(self_intersecting_faces(clean)) == 0
    assert clean.faces is white.faces
    moved = (clean.vertices - white.vertices).norm(dim=1)
    assert int((moved > 0).sum()) == {"left": 0, "right": 6}[hemisphere]
    assert float(moved.max()) < 2.0


def test_spikes_in_a_large_mesh(spiked):
    before = self_intersecting_faces(spiked)
    assert len(before) > 20
    clean = smooth_crossings(spiked)
    assert len(self_intersecting_faces(clean)) == 0
    moved = (clean.vertices != spiked.vertices).any(dim=1)
    # Only corners of faces that crossed at some time, or their neighbours: a spike is short-ranged.
    assert 0 < int(moved.sum()) < 10 * len(before)
    assert not bool(moved[~ring_around(spiked, before, 6)].any())


@pytest.mark.parametrize("scale", [1.0, pytest.param(1e-3, marks=pytest.mark.thorough)])
def test_pairs_are_the_same_if_only_faces_near_moved_vertices_are_tested(spiked, scale):
    generator, mesh = np.random.default_rng(1), spiked.with_vertices(scale * spiked.vertices)
    pairs, seen = crossing_pairs(mesh), set()
    for share in (0.0, 1e-3, 0.02, 0.3, 1.0):
        moved = torch.from_numpy(generator.random(len(mesh.vertices)) < share)
        step = torch.from_numpy(generator.normal(scale=scale, size=mesh.vertices.shape))
        step[:5] *= 40  # some faces become as long as the mesh
        mesh = mesh.with_vertices(mesh.vertices + moved[:, None] * step)
        pairs, whole = crossing_pairs(mesh, pairs, moved), crossing_pairs(mesh)
        as_sets = [set(map(tuple, np.sort(each, axis=1).tolist())) for each in (pairs, whole)]
        assert as_sets[0] == as_sets[1]
        assert len(pairs) == len(as_sets[0])
        seen.add(len(as_sets[0]))
    assert len(seen) >= 4


def test_the_dtype_stays_and_the_input_is_left_alone():
    white = fsaverage5_surface("white", "right").to(torch.float32)
    kept = white.vertices.clone()
    clean = smooth_crossings(white)
    assert clean.vertices.dtype == torch.float32
    assert torch.equal(white.vertices, kept)
    assert len(self_intersecting_faces(clean)) == 0


def test_rings_are_edges_away():
    sphere = icosphere(2)
    one = torch.tensor([0])
    corners = torch.unique(sphere.faces[0])
    assert torch.equal(ring_around(sphere, one, 0).nonzero().flatten(), corners)
    edges = torch.cat([sphere.faces[:, [0, 1]], sphere.faces[:, [1, 2]], sphere.faces[:, [2, 0]]])
    adjacency = torch.eye(len(sphere.vertices))
    adjacency[edges[:, 0], edges[:, 1]] = adjacency[edges[:, 1], edges[:, 0]] = 1
    for n_rings in (1, 2):
        near = torch.linalg.matrix_power(adjacency, n_rings)[corners].sum(dim=0) > 0
        assert torch.equal(ring_around(sphere, one, n_rings), near)


def test_two_pieces_that_pierce_each_other_cannot_be_mended():
    first = tetrahedron()
    # Both shrink towards their common centre and stay as crossed as they were.
    both = Mesh(torch.cat([first.vertices, -first.vertices]), torch.cat([first.faces, first.faces.flip(1) + 4]))
    refuses("8 faces still cross after 3 rounds", smooth_crossings, both, max_rounds=3)


@pytest.mark.parametrize("max_rounds", [0, -1, 2.5])
def test_rounds_must_be_a_positive_integer(max_rounds, unchecked):
    refuses("max_rounds", smooth_crossings, icosphere(1), max_rounds)
