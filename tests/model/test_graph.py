"""Graph convolutions: a mean over neighbours by hand, symmetry, gradients."""

import torch

from meshot.mesh.geometry import mesh_edges
from meshot.mesh.shapes import icosphere, tetrahedron
from meshot.model.features import GraphConvolution, ResidualGraphBlock


def test_a_vertex_hears_the_mean_of_its_neighbours():
    layer = GraphConvolution(3, 2).double()
    mesh = icosphere(1)
    found = layer(mesh.vertices, mesh_edges(mesh))
    pairs = mesh_edges(mesh)
    for vertex in (0, 20):
        beside = pairs[(pairs == vertex).any(dim=1)]
        others = beside[beside != vertex]
        mean = mesh.vertices[others].mean(dim=0)
        expected = layer.own(mesh.vertices[vertex]) + layer.others(mean)
        torch.testing.assert_close(found[vertex], expected)


def test_the_order_of_vertices_does_not_matter():
    block, mesh = ResidualGraphBlock(3, 4, 2).double(), icosphere(1)
    order = torch.randperm(len(mesh.vertices), generator=torch.Generator().manual_seed(0))
    place = order.argsort()
    found = block(mesh.vertices, mesh_edges(mesh))
    torch.testing.assert_close(block(mesh.vertices[order], place[mesh_edges(mesh)]), found[order])


def test_gradients():
    mesh = tetrahedron()
    edges = mesh_edges(mesh)
    features = torch.rand(4, 2, dtype=torch.float64, requires_grad=True)
    layer, block = GraphConvolution(2, 3).double(), ResidualGraphBlock(2, 3, 2).double()
    assert torch.autograd.gradcheck(lambda x: layer(x, edges), (features,))
    assert torch.autograd.gradcheck(lambda x: block(x, edges), (features,))
