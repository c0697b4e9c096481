"""Features at vertices, and networks on graphs."""

import numpy as np
import pytest
import torch

from meshot.mesh.geometry import mesh_edges
from meshot.mesh.shapes import icosphere, tetrahedron
from meshot.model.features import FeatureNetwork, GraphConvolution, ResidualGraphBlock, sample_features
from meshot.volume.volume import Volume
from refusals import refuses

IMAGE = Volume(np.zeros((8, 16, 8)), np.array([[-2.0, 0, 0, 7], [0, 1.5, 0, -3], [0, 0, 1, 4], [0, 0, 0, 1]]))


@pytest.mark.parametrize(("residual", "decoder"), [(False, True), (True, True), (True, False)])
def test_maps_come_from_fine_to_coarse_and_back(residual, decoder):
    network = FeatureNetwork(3, 2, 2, 1, residual, decoder, generator=1)
    maps = network(torch.rand(1, 1, 8, 16, 8), torch.rand(1, 1, 4, 8, 4))
    shapes = [(1, 3, 4, 8, 4), (1, 6, 2, 4, 2), (1, 3, 4, 8, 4)][: 3 if decoder else 2]
    assert [tuple(each.shape) for each in maps] == shapes
    assert network.widths == tuple(shape[1] for shape in shapes)
    assert network.multiple == 4


def test_the_residual_is_added():
    network = FeatureNetwork(2, 1, 1, residual=True)
    image = torch.rand(1, 1, 4, 4, 4)
    with torch.no_grad():
        network.down[0].norms[1].weight.zero_()
    expected = torch.nn.functional.leaky_relu(network.down[0].beside(image), 0.2)
    torch.testing.assert_close(network(image)[0], expected)


def test_a_linear_image_is_sampled_exactly_at_every_resolution():
    """Means over blocks of a linear function are its values at the centres of the blocks."""
    x, y, z = np.meshgrid(*(np.arange(n) for n in IMAGE.data.shape), indexing="ij")
    voxels = torch.from_numpy(np.stack([x, y, z, np.ones_like(x)], axis=-1).astype(np.float64))
    values = (voxels @ torch.from_numpy(IMAGE.affine).T)[..., :3].permute(3, 0, 1, 2)[None]
    maps = [values, torch.nn.functional.avg_pool3d(values, 2)]
    centre = torch.tensor([[0.0, 8.25, 7.5]], dtype=torch.float64)
    points = centre + torch.tensor([[0.0, 0, 0], [3, -4, 1], [-4.5, 7.0, -2]], dtype=torch.float64)
    found = sample_features(maps, IMAGE, points)
    torch.testing.assert_close(found, torch.cat([points, points], dim=1))


def test_beyond_the_image_its_border_counts():
    maps = [torch.rand(1, 2, 4, 8, 4, dtype=torch.float64)]
    far = torch.tensor([[1000.0, -1000.0, 1000.0]], dtype=torch.float64)
    torch.testing.assert_close(sample_features(maps, IMAGE, far)[0], maps[0][0, :, 0, 0, -1])


def test_gradients_in_maps_and_points():
    maps = torch.rand(1, 2, 4, 8, 4, dtype=torch.float64, requires_grad=True)
    points = torch.tensor([[0.3, 8.1, 7.7], [2.2, 4.4, 6.1]], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda m, p: sample_features([m], IMAGE, p), (maps, points))
    network = FeatureNetwork(1, 2, 2, residual=True).double()
    image = torch.rand(1, 1, 8, 8, 8, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: network(x)[-1].square().sum(), (image,), eps=1e-7, atol=1e-4)


def test_grids_that_do_not_divide_are_refused():
    with pytest.raises(ValueError, match=r"image has \(8, 6, 8\) voxels; each axis must be a multiple of 4"):
        FeatureNetwork(2, 2, 2)(torch.rand(1, 1, 8, 6, 8))
    refuses("the width of the last level is 1024", FeatureNetwork, 512, 2)


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
