"""DeepCSR: true distances, features of the place, gradients, and surfaces from distances."""

import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.shapes import icosphere
from meshot.systems import Example, ExampleSets, Scan, get_system, read_settings
from meshot.systems.deepcsr import (
    DistanceNetwork,
    DistanceSettings,
    SurfaceSettings,
    closed_surface,
    distance_grids,
    distance_pool,
)
from meshot.systems.learning import scaled_image
from meshot.volume.volume import Volume, voxel_to_mm
from phantoms import AFFINE, SHAPE, phantom_subjects

KEY = ("left", "white")


def ball_distance(radius: float, centre: tuple[float, float, float]) -> Volume:
    grid = Volume(np.zeros(SHAPE), AFFINE)
    points = voxel_to_mm(grid, torch.from_numpy(np.indices(SHAPE).reshape(3, -1).T.astype(float)))
    return grid.with_data(((points - torch.tensor(centre)).norm(dim=1) - radius).reshape(SHAPE).numpy())


def test_the_distances_of_the_pool_are_those_of_a_sphere():
    image = phantom_subjects(1, ())[0].scan.image
    ball = icosphere(5, 9.0, (-3.0, 1.0, 0.0))
    settings = DistanceSettings(n_pool=2000, largest=6.0)
    pool = distance_pool(Example("ball", Scan(image), {KEY: ball}), [KEY], settings, np.random.default_rng(0))
    truth = (pool.points.double() - torch.tensor([-3.0, 1.0, 0.0])).norm(dim=1) - 9.0
    assert pool.points.shape == (2000, 3)
    wrong = (pool.distances[:, 0].double() - truth.clamp(-6, 6)).abs()
    assert float(wrong.mean()) < 0.05  # the sign is that of the interpolated voxels
    assert float((pool.distances.abs() < 4).float().mean()) > 0.8
    assert float(pool.distances.max()) == 6.0


def test_distances_depend_on_the_place_and_have_gradients():
    image = Volume(np.random.default_rng(0).random((8, 8, 8)), np.diag([2.0, 2, 2, 1]))
    network = DistanceNetwork(2, 2, 2, 1, 4, 1).double()
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.3 * torch.randn(parameter.shape, generator=torch.Generator().manual_seed(1)))
    maps, whole = network.encode(scaled_image(image).double())
    points = torch.tensor([[3.3, 4.1, 6.2], [8.9, 5.2, 7.7]], dtype=torch.float64, requires_grad=True)
    assert network(maps, whole, image, points).shape == (2, 2)
    assert torch.autograd.gradcheck(lambda p: network([m.detach() for m in maps], whole.detach(), image, p), (points,))
    shifted = Volume(image.data, image.affine + np.array([[0.0, 0, 0, 5]] * 3 + [[0] * 4]))
    torch.testing.assert_close(network(maps, whole, shifted, points + 5), network(maps, whole, image, points))


@pytest.mark.parametrize("splits", [1, 2])
def test_a_grid_holds_the_distances_of_its_points(splits):
    image = phantom_subjects(1, ())[0].scan.image
    network = DistanceNetwork(2, 2, 2, 2, 4, 1)
    grids = distance_grids(network, image, splits)
    assert grids[0].data.shape == tuple(splits * n for n in SHAPE)
    place = torch.tensor([[5.0, 6, 7]])
    maps, whole = network.encode(scaled_image(image))
    expected = network(maps, whole, image, voxel_to_mm(grids[1], place))[0, 1]
    assert float(grids[1].data[5, 6, 7]) == pytest.approx(float(expected.detach()), abs=1e-5)
    outer = [voxel_to_mm(each, torch.full((1, 3), -0.5)) for each in (image, grids[0])]
    torch.testing.assert_close(*outer)


def test_what_is_far_from_a_surface_is_interpolated_and_the_rest_is_not():
    """Against the evaluation in every voxel."""
    sets = ExampleSets(phantom_subjects(2, ()), phantom_subjects(1, (), 50))
    kind = get_system("deepcsr")
    network = kind.train(sets, read_settings(kind, "tiny")).parts["distances"].network
    image, asked = sets.validation[0].scan.image, []
    network.register_forward_hook(lambda _, given, __: asked.append(len(given[3])))
    dense, sparse = (distance_grids(network, image, every=every) for every in (1, 2))
    assert asked[0] == image.data.size > sum(asked[1:]) + 0.2 * image.data.size
    for one, other in zip(dense, sparse, strict=True):
        near = np.abs(one.data) < 1.0
        np.testing.assert_allclose(other.data[near], one.data[near], rtol=0, atol=1e-4)
        assert (np.sign(one.data) == np.sign(other.data)).all()
        assert not np.array_equal(one.data, other.data)


def test_a_handle_and_a_crumb_are_removed():
    distance = ball_distance(8.0, (-9.0, 0.0, 0.0))
    crumb = np.minimum(distance.data, ball_distance(2.5, (12.0, 0.0, 0.0)).data)
    drilled = distance.with_data(np.maximum(crumb, 2.0 - tube_distance()))
    mesh = closed_surface(drilled, "left white", SurfaceSettings(blur=0.0))
    assert topology(mesh) == SPHERE
    assert float(mesh.vertices[:, 0].max()) < 0
    with pytest.raises(ValueError, match="the network finds no inside of the surface left white: is it trained"):
        closed_surface(distance.with_data(np.ones(SHAPE)), "left white", SurfaceSettings())


def tube_distance() -> np.ndarray:
    """The distance from a line along the last axis through the ball."""
    grid = Volume(np.zeros(SHAPE), AFFINE)
    points = voxel_to_mm(grid, torch.from_numpy(np.indices(SHAPE).reshape(3, -1).T.astype(float))).numpy()
    return np.hypot(points[:, 0] + 9.0, points[:, 1]).reshape(SHAPE)
