"""Chamfer by brute force and by a k-d tree, and the Sinkhorn divergence."""

import importlib.util

import geomloss
import numpy as np
import ot
import pytest
import torch

import oracles
import problems
from meshot import DiscreteMeasure, chamfer, sinkhorn_divergence, wasserstein
from meshot.loss.transport import nearest_neighbours
from refusals import refuses


@pytest.mark.parametrize(("n", "m", "d"), [(30, 21, 3), (1, 9, 2), (9, 1, 6), (200, 300, 6)])
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_both_ways_agree_with_the_definition(n, m, d, dtype):
    source, target = problems.cloud(0, n, d, True, dtype), problems.cloud(1, m, d, True, dtype)
    arrays = (source.points.numpy(), target.points.numpy(), source.weights.numpy(), target.weights.numpy())
    gradients = []
    for neighbours in ("tree", "brute"):
        points = source.points.clone().requires_grad_()
        value = chamfer(DiscreteMeasure(points, source.weights), target, neighbours)
        assert value.dtype == dtype
        assert float(value.detach()) == pytest.approx(
            oracles.chamfer(*arrays), rel=1e-12 if dtype == torch.float64 else 1e-5
        )
        gradients += torch.autograd.grad(value, points)
    assert torch.equal(*gradients)


def test_blocks_hold_what_they_are_allowed_and_lose_nothing(monkeypatch):
    seen, whole = [], torch.cdist

    def recorded(points, candidates, **mode):
        seen.append(len(points) * len(candidates))
        return whole(points, candidates, **mode)

    monkeypatch.setattr("meshot.loss.transport._BLOCK", 100)
    monkeypatch.setattr("torch.cdist", recorded)
    points, others = problems.cloud(0, 50, 3).points, problems.cloud(1, 30, 3).points
    assert torch.equal(nearest_neighbours(points, others, "brute"), nearest_neighbours(points, others))
    assert len(seen) == 17
    assert max(seen) <= 100


def test_brute_force_does_not_cancel():
    """Far from the origin |x|² + |y|² − 2⟨x, y⟩ has no digits left for a distance of a hundredth."""
    places = torch.from_numpy(np.random.default_rng(0).random((40, 3)) / 100 + 1e7)
    order = torch.from_numpy(np.random.default_rng(1).permutation(40))
    assert torch.equal(nearest_neighbours(places, places[order], "brute"), order.argsort())


@pytest.mark.parametrize(("p", "tolerance"), [(1, 2e-4), (2, 1e-9)])
def test_two_points_cost_their_distance(p, tolerance):
    """At p = 1 GeomLoss keeps distances from zero by 1e-4, so that they can be differentiated there."""
    problem = problems.two_diracs(3, p)
    found = float(sinkhorn_divergence(problem.source, problem.target, p))
    assert found == pytest.approx(problem.wasserstein, rel=tolerance)


@pytest.mark.parametrize("p", [1, 2])
def test_a_small_blur_comes_near_exact_transport(p):
    source, target = problems.cloud(0, 40, 3, weighted=True), problems.cloud(1, 50, 3, weighted=True)
    exact = float(wasserstein(source, target, p))
    near, far = (float(sinkhorn_divergence(source, target, p, blur=blur, scaling=0.95)) for blur in (0.02, 2.0))
    assert abs(near - exact) < 0.02 * exact
    assert abs(far - exact) > 0.1 * exact


def test_a_large_blur_agrees_with_another_library():
    """GeomLoss regularises half the squared distance by blur², POT the whole: ε = 2 blur²."""
    source, target = problems.cloud(0, 30, 2, weighted=True), problems.cloud(1, 20, 2, weighted=True)
    epsilon = 2 * 0.8**2

    def regularised(a: DiscreteMeasure, b: DiscreteMeasure) -> float:
        cost = ot.dist(a.points.numpy(), b.points.numpy())
        masses = a.weights.numpy(), b.weights.numpy()
        plan = ot.sinkhorn(*masses, cost, reg=epsilon, stopThr=1e-13, numItermax=20_000)
        return float((plan * (cost + epsilon * np.log(plan / np.outer(*masses)))).sum())

    expected = regularised(source, target) - (regularised(source, source) + regularised(target, target)) / 2
    found = float(sinkhorn_divergence(source, target, blur=0.8, scaling=0.99))
    assert found == pytest.approx(expected, rel=1e-3)


def test_the_gradient_of_a_translation_is_twice_the_shift():
    problem = problems.translation(0, 20, 3)
    points = problem.source.points.clone().requires_grad_()
    moved = DiscreteMeasure(points, problem.source.weights)
    sinkhorn_divergence(moved, problem.target, blur=0.01, scaling=0.9).backward()
    shift = (problem.target.points - problem.source.points)[0]
    assert torch.allclose(points.grad.sum(dim=0), -2 * shift, rtol=1e-3)


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("reach", [0.3, 1.0, 5.0])
def test_beyond_its_reach_mass_stays_unmatched(p, reach):
    """Two Diracs of mass one at distance D: the divergence is (ε + 2ρ)(1 − exp(−C/(ε + 2ρ))) with C = D^p/p, ε = blur^p
    and ρ = reach^p: Séjourné et al., 2019, for one pair of points. Ours is p times GeomLoss's."""
    blur, distance = 0.05, 2.0
    source, target = (DiscreteMeasure(torch.tensor([[x, 0.0]], dtype=torch.float64)) for x in (0.0, distance))
    width = blur**p + 2 * reach**p
    expected = p * width * (1 - np.exp(-(distance**p) / p / width))
    # At p = 1 GeomLoss keeps distances from zero by 1e-4.
    assert float(sinkhorn_divergence(source, target, p, blur, reach=reach)) == pytest.approx(expected, rel=1e-3)


def test_arguments_reach_geomloss_as_they_are():
    source, target = problems.cloud(0, 30, 3, weighted=True), problems.cloud(1, 20, 3, weighted=True)
    options = {"p": 2, "blur": 0.1, "scaling": 0.7, "reach": 0.8}
    theirs = geomloss.SamplesLoss("sinkhorn", backend="tensorized", **options)
    expected = 2 * float(theirs(source.weights, source.points, target.weights, target.points))
    assert float(sinkhorn_divergence(source, target, **options)) == expected


@pytest.mark.parametrize("backend", ["online", "multiscale"])
def test_a_backend_on_keops_says_what_is_missing_or_agrees(backend):
    source, target = problems.cloud(0, 30, 3), problems.cloud(1, 20, 3)
    if importlib.util.find_spec("pykeops") is None:
        with pytest.raises(ValueError, match=f"backend '{backend}' needs KeOps.*pip install pykeops"):
            sinkhorn_divergence(source, target, backend=backend)
    else:
        found = float(sinkhorn_divergence(source, target, backend=backend, scaling=0.9))
        # Multiscale truncates what decays below single precision.
        assert found == pytest.approx(float(sinkhorn_divergence(source, target, scaling=0.9)), rel=1e-3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"p": 3}, "p is 3"),
        ({"blur": 0.0}, "blur is 0.0; a finite number > 0 is needed, in units of the points"),
        ({"reach": 0.0}, "reach is 0.0; a finite number > 0 is needed, in units of the points"),
        ({"scaling": 1.0}, "scaling"),
        ({"backend": "auto"}, "backend is 'auto'; one of tensorized, online, multiscale is needed"),
    ],
)
def test_doors(change, message):
    measure = problems.cloud(0, 3, 2)
    refuses(message, sinkhorn_divergence, measure, measure, **change)
    refuses("neighbours is 'ball'", chamfer, measure, measure, "ball")


def test_hasty_annealing_may_go_below_zero_and_patience_mends_it():
    """A circle of 120 points, one of them moved far out: what the docstring warns of."""
    angles = 2 * torch.pi * torch.arange(120).double() / 120
    points = 40 * torch.stack([angles.cos(), angles.sin()], dim=1)
    stray = points.clone()
    stray[0] = torch.tensor([120.0, 0.0])
    pair = DiscreteMeasure(points), DiscreteMeasure(stray)
    hasty, patient = (float(sinkhorn_divergence(*pair, blur=5.0, scaling=s)) for s in (0.5, 0.99))
    assert hasty < 0
    assert patient == pytest.approx(float(wasserstein(*pair)), rel=0.02)
