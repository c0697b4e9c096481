"""The network as a field: its bound holds, its flow has gradients, its randomness is seeded."""

import numpy as np
import pytest
import torch

from meshot.flow.crossings import sampled_lipschitz
from meshot.flow.integration import integrate
from meshot_book.flows import NetworkVelocity

POINTS = torch.from_numpy(np.random.default_rng(0).normal(size=(300, 2)))


def by_hand(field, time, points):
    values = points.numpy() / field.extent
    if field.with_time:
        values = np.concatenate([values, np.full((len(values), 1), time)], axis=1)
    layers = [(w.detach().numpy(), b.detach().numpy()) for w, b in zip(field.weights, field.biases, strict=True)]
    for weight, bias in layers[:-1]:
        values = np.tanh(values @ weight.T + bias)
    return values @ layers[-1][0].T + layers[-1][1]


@pytest.mark.parametrize("with_time", [True, False])
def test_is_the_formula(with_time):
    field = NetworkVelocity(2, 16, 2, generator=3, extent=2.0, last_scale=1.0, with_time=with_time)
    found = field(torch.tensor(0.3, dtype=torch.float64), POINTS).detach()
    np.testing.assert_allclose(found, by_hand(field, 0.3, POINTS), rtol=1e-12, atol=1e-14)
    later = field(torch.tensor(0.9, dtype=torch.float64), POINTS).detach()
    assert torch.equal(found, later) is not with_time


def test_starts_at_rest():
    assert torch.equal(integrate(NetworkVelocity(2), POINTS).detach(), POINTS)


@pytest.mark.parametrize("n_layers", [1, 2, 3])
def test_bound_holds_and_the_estimate_is_below_it(n_layers):
    field = NetworkVelocity(2, 16, n_layers, generator=1, extent=0.5, last_scale=1.0)
    bound, seen = float(field.lipschitz_bound()), float(sampled_lipschitz(field, POINTS))
    assert 0 < seen <= bound
    values = field(torch.tensor(0.2).double(), POINTS).detach()
    slopes = torch.pdist(values) / torch.pdist(POINTS)
    assert float(slopes.max()) <= bound
    assert field.is_lipschitz


def test_bound_of_a_single_unit_is_its_slope():
    field = NetworkVelocity(1, 1, 1, extent=2.0, last_scale=1.0)
    with torch.no_grad():
        field.weights[0].copy_(torch.tensor([[3.0, 100.0]]))  # the time may vary as it likes
        field.weights[1].copy_(torch.tensor([[-4.0]]))
        field.biases[0].zero_()
    assert float(field.lipschitz_bound()) == pytest.approx(3 * 4 / 2)


@pytest.mark.parametrize("gradient", ["direct", "adjoint"])
def test_parameters_have_gradients(gradient):
    field = NetworkVelocity(2, 8, 1, last_scale=1.0)
    integrate(field, POINTS, 4, gradient=gradient).square().sum().backward()
    assert all(p.grad is not None and bool(p.grad.any()) for p in field.parameters())


def test_seeds():
    weights = [NetworkVelocity(2, generator=seed).weights[0].detach() for seed in (0, 0, 1)]
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])


@pytest.mark.parametrize("arguments", [{"width": 0}, {"n_layers": 0}, {"n_dimensions": 0}, {"extent": 0.0}])
def test_doors(arguments):
    with pytest.raises(ValueError, match=f"{next(iter(arguments))} is 0"):
        NetworkVelocity(**({"n_dimensions": 2} | arguments))
