"""Edges cut in two: the surface, its topology and its orientation stay; sides are cut, and no others."""

import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.editing import with_edges_split
from meshot.mesh.geometry import edge_lengths, face_areas, face_normals, mesh_edges, signed_volume
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, icosphere, split_in_four

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


def test_long_edges_are_gone_after_some_rounds():
    box = cube(1.0)
    for _ in range(6):
        long = mesh_edges(box)[edge_lengths(box) > 0.3]
        if not len(long):
            break
        box = with_edges_split(box, long)
    assert float(edge_lengths(box).max()) <= 0.3
    assert topology(box) == SPHERE
    assert float(face_areas(box).sum()) == pytest.approx(6.0)


@pytest.mark.parametrize(
    ("edges", "words"),
    [
        ([[0, 1], [1, 0]], "twice"),
        ([[0, 1], [1, 1]], r"\[1, 1\], which no face has"),
        ([[0, 9]], "edges"),
        ([], "edges"),
    ],
)
def test_doors(edges, words):
    with pytest.raises(ValueError, match=words):
        with_edges_split(TRIANGLE, torch.tensor(edges, dtype=torch.int64).reshape(-1, 2))


def test_pairs_are_needed(unchecked):
    with pytest.raises(ValueError, match="edges"):
        with_edges_split(TRIANGLE, torch.tensor([[0, 1, 2]]))
