"""The deformation network: identity at the start, one field per image, a Lipschitz constant."""

import numpy as np
import pytest
import torch

from affines import OBLIQUE
from meshot.flow.crossings import sampled_lipschitz
from meshot.flow.integration import integrate
from meshot.model.deformation import DeformationNetwork
from meshot.volume.volume import Volume, voxel_to_mm
from pretended_cuda import pretended_cuda


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
    with pytest.raises(ValueError, match=words):
        DeformationNetwork(**arguments)


def test_an_unknown_path_is_refused(network, unchecked):
    with pytest.raises(ValueError, match="path is 'bent'; one of convolved, visited, cut"):
        network.velocity_in(volume(0), "bent")
