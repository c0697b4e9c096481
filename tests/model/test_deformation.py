"""The deformation network and its cubes."""

import gc
import weakref

import numpy as np
import pytest
import scipy.ndimage
import torch

from affines import FLIPPED, OBLIQUE
from meshot.flow.crossings import sampled_lipschitz
from meshot.flow.integration import integrate
from meshot.model.deformation import CubeConvolution, DeformationNetwork, VisitedFeatures
from meshot.volume.volume import Volume, voxel_to_mm
from pretended_cuda import pretended_cuda
from refusals import refuses


def volume(seed: int) -> Volume:
    return Volume(np.random.default_rng(seed).random((10, 9, 8)), OBLIQUE)


def points(n_points: int = 50) -> torch.Tensor:
    inside = np.random.default_rng(1).uniform(0, [9, 8, 7], (n_points, 3))
    return voxel_to_mm(volume(0), torch.from_numpy(inside))


@pytest.fixture
def network() -> DeformationNetwork:
    """Small, and no longer at rest."""
    network = DeformationNetwork(width=6, hidden=(10, 7), n_scales=2, size=3, extent=20.0, generator=3)
    random = np.random.default_rng(9)
    with torch.no_grad():
        network.to_velocity.weight.copy_(torch.from_numpy(random.standard_normal((3, 7))))
    return network


def test_a_new_network_moves_every_vertex_alike_by_the_last_bias_only():
    network = DeformationNetwork(width=4, hidden=(5,), n_scales=1, size=3)
    velocity = network.velocity_in(volume(0))(torch.tensor(0.0), points())
    torch.testing.assert_close(velocity, network.to_velocity.bias.detach().expand_as(velocity))


def test_the_unit_of_velocity_multiplies_the_last_layer_but_not_the_first_velocity(network):
    arguments = network.config() | {"velocity_unit": 104.0, "generator": 3}
    scaled, at = DeformationNetwork(**arguments), (torch.tensor(0.0), points())
    torch.testing.assert_close(104 * scaled.to_velocity.bias, network.to_velocity.bias)
    with torch.no_grad():
        scaled.to_velocity.weight.copy_(network.to_velocity.weight / 104)
    one, other = (n.velocity_in(volume(0)) for n in (network, scaled))
    torch.testing.assert_close(other(*at), one(*at))
    torch.testing.assert_close(other.lipschitz_bound(), one.lipschitz_bound())
    slopes = [torch.autograd.grad(f(*at).sum(), f.network.to_velocity.weight)[0] for f in (one, other)]
    torch.testing.assert_close(slopes[1], 104 * slopes[0])


def test_every_path_carries_points_to_the_same_place_with_the_same_gradients(network):
    found = []
    for path in ("cut", "convolved", "visited"):
        start = points().requires_grad_()
        moved = integrate(network.velocity_in(volume(0), path), start, 4)
        found.append([moved.detach(), *torch.autograd.grad(moved.square().sum(), [start, *network.parameters()])])
    for one, other, third in zip(*found, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-8, atol=1e-8)
        torch.testing.assert_close(one, third, rtol=1e-8, atol=1e-8)
    assert float((found[0][0] - points()).norm(dim=1).mean()) > 0.1


@pytest.mark.parametrize("path", ["cut", "convolved"])
def test_on_a_device_points_are_carried_to_the_same_place(network, path):
    with torch.no_grad():
        wanted = integrate(network.velocity_in(volume(0), path), points(), 4)
        with pretended_cuda():
            found = integrate(network.to("cuda").velocity_in(volume(0), path), points().to("cuda"), 4)
            assert found.device.type == "cuda"
            torch.testing.assert_close(found.cpu(), wanted)


def test_a_field_that_cuts_follows_its_network_to_another_dtype(network):
    field, at = network.velocity_in(volume(0), "cut"), (torch.tensor(0.0), points())
    double = field(*at)
    network.float()
    torch.testing.assert_close(field(at[0], at[1].float()).double(), double, rtol=1e-4, atol=1e-4)  # 7 digits, summed
    again = network.double().velocity_in(volume(0))(*at)
    torch.testing.assert_close(field(*at), again)


def test_the_adjoint_gradient_reaches_every_parameter(network):
    with torch.no_grad():  # slowly: the way back is only as exact as the field is smooth
        network.to_velocity.weight.mul_(0.2)
    gradients = {}
    for gradient in ("direct", "adjoint"):
        moved = integrate(network.velocity_in(volume(0)), points(), 40, "rk4", gradient=gradient)
        gradients[gradient] = torch.autograd.grad(moved.square().sum(), list(network.parameters()))
    for one, other in zip(gradients["direct"], gradients["adjoint"], strict=True):
        assert float((one - other).norm()) < 1e-8 * float(one.norm())


def test_two_subjects_share_the_network_and_nothing_else(network):
    fields = [network.velocity_in(volume(seed)) for seed in (0, 1)]
    alone = [network.velocity_in(volume(seed))(torch.tensor(0.0), points()) for seed in (0, 1)]
    prepared = [field.prepared() for field in fields]
    for k in (1, 0, 1):
        torch.testing.assert_close(prepared[k](torch.tensor(0.0), points()), alone[k], rtol=0, atol=0)
    assert float((alone[0] - alone[1]).detach().abs().max()) > 0.01
    assert set(dict(network.named_parameters())) == set(network.state_dict())


def test_the_lipschitz_bound_is_above_what_is_found_at_points(network):
    field = network.velocity_in(volume(0))
    found, bound = sampled_lipschitz(field, points(400), 1), field.lipschitz_bound()
    assert 0 < float(found) <= float(bound) < float("inf")


def test_parameters_are_counted():
    network = DeformationNetwork(width=128, hidden=(512, 256), n_scales=3, size=5)
    position, cubes, image = 4 * 128, 128 * (3 * 125 + 1), 129 * 128
    assert network.n_parameters == position + cubes + image + 257 * 512 + 513 * 256 + 257 * 3


def test_the_same_seed_gives_the_same_network_and_torchs_generator_is_left_alone():
    before = torch.get_rng_state()
    one, other, third = (DeformationNetwork(4, (5,), 1, 3, generator=seed).state_dict() for seed in (2, 2, 3))
    assert torch.equal(before, torch.get_rng_state())
    assert all(torch.equal(one[k], other[k]) for k in one)
    assert not torch.equal(one["of_position.weight"], third["of_position.weight"])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"width": 0}, "width is 0"),
        ({"hidden": (4, -1)}, "hidden is -1"),
        ({"extent": 0.0}, "extent is 0.0"),
        ({"velocity_unit": -1.0}, "velocity_unit is -1.0"),
    ],
)
def test_doors(arguments, words):
    refuses(words, DeformationNetwork, **arguments)


def test_an_unknown_path_is_refused(network, unchecked):
    refuses("path is 'bent'; one of convolved, visited, cut", network.velocity_in, volume(0), "bent")


SHAPE = (9, 7, 8)


def image(affine: np.ndarray, dtype: type = np.float64) -> Volume:
    return Volume(np.random.default_rng(3).random(SHAPE).astype(dtype), affine)


def places(volume: Volume, n_points: int = 200) -> torch.Tensor:
    """Points inside, on the border, and far beyond, in mm."""
    random = np.random.default_rng(4)
    inside_and_beyond = random.uniform(-12, np.array(SHAPE) + 12, (n_points, 3))
    return voxel_to_mm(volume, torch.from_numpy(inside_and_beyond))


def cut(layer: CubeConvolution, images: tuple, points: torch.Tensor) -> torch.Tensor:
    return layer.cut(layer.stacked(images), layer.corner_kernels(), points)


def features_along(path: str, layer: CubeConvolution, images: tuple, points: torch.Tensor) -> torch.Tensor:
    if path == "cut":
        return cut(layer, images, points)
    return layer.at(layer.maps(images), points) if path == "convolved" else VisitedFeatures(layer, images).at(points)


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE, FLIPPED], ids=["identity", "oblique", "flipped"])
@pytest.mark.parametrize("size", [1, 3, 5])
def test_cut_then_convolved_is_convolved_then_interpolated(affine, size):
    layer = CubeConvolution(4, 3, size, generator=1)
    torch.nn.init.constant_(layer.bias, 0.7)
    images = layer.images(image(affine))
    results = []
    for path in ("cut", "convolved", "visited"):
        points = places(images[0]).requires_grad_()
        values = features_along(path, layer, images, points)
        gradients = torch.autograd.grad((values * torch.linspace(-1, 2, values.numel()).view_as(values)).sum(),
                                    [points, layer.weight, layer.bias])  # fmt: skip
        results.append([values.detach(), *gradients])
    for one, other, third in zip(*results, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-10)
        torch.testing.assert_close(one, third, rtol=1e-10, atol=1e-10)
    assert bool((results[0][1].abs().sum(dim=1) > 0).any())


def test_both_paths_agree_in_single_precision():
    layer = CubeConvolution(8, 3, 5, generator=1).float()
    images = layer.images(image(OBLIQUE, np.float32))
    points = places(images[0]).float()
    for path in ("convolved", "visited"):
        found = features_along(path, layer, images, points)
        torch.testing.assert_close(cut(layer, images, points), found, rtol=0, atol=1e-5)


def test_visits_add_up_their_gradients_and_one_backward_does_not_leak_into_the_next():
    layer = CubeConvolution(3, 2, 3, generator=1)
    images = layer.images(image(OBLIQUE))
    visited = VisitedFeatures(layer, images)
    first, second = places(images[0], 40).requires_grad_(), places(images[0], 60).requires_grad_()

    def total(features: VisitedFeatures | None) -> torch.Tensor:
        at = features.at if features else (lambda points: cut(layer, images, points))
        return (at(first) ** 2).sum() + (at(second)[:40] * at(first)).sum()

    for wanted in ([first], [layer.weight], [first, second, layer.weight, layer.bias]):
        found = torch.autograd.grad(total(VisitedFeatures(layer, images)), wanted)
        for one, other in zip(found, torch.autograd.grad(total(None), wanted), strict=True):
            torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-10)
    loss = total(visited)
    torch.autograd.grad(loss, [first], retain_graph=True)  # without the weight: nothing of it may stay behind
    (again,) = torch.autograd.grad(loss, [layer.weight])
    torch.testing.assert_close(again, torch.autograd.grad(total(None), [layer.weight])[0], rtol=1e-10, atol=1e-10)


def test_at_voxels_the_features_are_scipys_correlation():
    layer = CubeConvolution(2, 1, 5, generator=2)
    volume = image(OBLIQUE)
    indices = torch.from_numpy(np.argwhere(np.ones(SHAPE)).astype(float))
    features = layer.at(layer.maps((volume,)), voxel_to_mm(volume, indices)).detach().numpy()
    for k in range(2):
        wanted = scipy.ndimage.correlate(volume.data, layer.weight[k, 0].detach().numpy(), mode="constant")
        np.testing.assert_allclose(features[:, k], wanted.ravel(), rtol=0, atol=1e-10)


def test_gradients_by_finite_differences():
    layer = CubeConvolution(2, 2, 3, generator=2)
    images = layer.images(image(OBLIQUE))
    points = places(images[0], 6).requires_grad_()

    def features(points, weight):
        return torch.func.functional_call(_Maps(layer), {"layer.weight": weight}, (images, points))

    assert torch.autograd.gradcheck(features, (points, layer.weight.detach().clone().requires_grad_()))


class _Maps(torch.nn.Module):
    def __init__(self, layer):
        super().__init__()
        self.layer = layer

    def forward(self, images, points):
        return self.layer.at(self.layer.maps(images), points)


def test_far_from_the_image_only_the_bias_is_left():
    layer = CubeConvolution(3, 2, 5, generator=0)
    torch.nn.init.constant_(layer.bias, 0.25)
    images = layer.images(image(np.eye(4)))
    far = torch.full((1, 3), 1e4, dtype=torch.float64)
    assert layer.at(layer.maps(images), far).tolist() == cut(layer, images, far).tolist() == [[0.25] * 3]


@pytest.mark.parametrize("affine", [np.eye(4), OBLIQUE], ids=["identity", "oblique"])
def test_the_features_change_no_faster_than_the_bound(affine):
    layer = CubeConvolution(4, 1, 3, generator=5)
    volume = image(affine)
    (features,) = layer.maps((volume,))
    points = places(volume, 3000)
    step = 1e-4 * torch.nn.functional.normalize(torch.from_numpy(np.random.default_rng(0).standard_normal((3000, 3))))
    slopes = (features.at(points + step) - features.at(points)).detach().norm(dim=1) / 1e-4
    assert float(slopes.max()) <= float(features.lipschitz_bound()) * (1 + 1e-9)
    assert float(slopes.max()) > 0.2 * float(features.lipschitz_bound())


def test_doors_of_cubes():
    refuses("size is 4; an odd number", CubeConvolution, size=4)
    refuses("n_features is 0", CubeConvolution, n_features=0)
    layer = CubeConvolution(2, 2, 3)
    one = (image(np.eye(4)),)
    for path in (layer.maps, layer.stacked):
        refuses("1 images were given, 2 are needed", path, one)


def test_a_point_that_is_not_a_number_has_no_features_and_the_others_theirs():
    layer = CubeConvolution(3, 2, 3, generator=0)
    images = layer.images(image(OBLIQUE))
    points = places(images[0], 5)
    wanted = cut(layer, images, points).detach()
    points[2, 1], points[3] = float("nan"), float("inf")
    for path in ("visited", "cut"):
        found = features_along(path, layer, images, points)
        assert bool(found[2].isnan().all())
        torch.testing.assert_close(found[[0, 1, 4]].detach(), wanted[[0, 1, 4]])


def test_nothing_of_a_visit_is_kept_once_it_is_over():
    layer = CubeConvolution(3, 2, 3, generator=1)
    images = layer.images(image(OBLIQUE))
    gc.collect()
    gc.disable()
    try:
        visited = VisitedFeatures(layer, images)
        level = weakref.ref(visited.levels[0])
        visited.at(places(images[0])).square().sum().backward()
        del visited
        assert level() is None
    finally:
        gc.enable()
