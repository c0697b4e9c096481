"""The kernels of the windowed loss against the definition, window by window, with its gradients."""

import numpy as np
import pytest
import torch

import oracles
from meshot.loss.directions import random_directions
from meshot.loss.windowed import windowed_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure

CASES = ("generic", "zero weights", "ties", "one point", "a window of one side only", "a window for all")


def case(name, d=6, n_windows=4):
    """Points and weights of both sides, centres, the radius, and directions."""
    random = np.random.default_rng(0)
    n, m = (1, 30) if name == "one point" else (70, 50)
    x, y = random.normal(size=(n, d)), random.normal(size=(m, d)) + 0.1
    a, b = random.random(n) + 0.05, random.random(m) + 0.05
    if name == "zero weights":
        a[: n // 2], b[m // 2 :] = 0, 0
    if name == "ties":
        x, y = np.round(x), np.round(y)
    centres = random.normal(size=(n_windows, 3)) * 0.5
    if name == "one point":
        centres[:] = x[0, :3] + 0.1
    if name == "a window of one side only":
        x[0], centres[1] = 40.0, 40.0
    radius = 1e3 if name == "a window for all" else 0.7
    lines = torch.stack([random_directions(5, d, k) for k in range(n_windows)])
    return (x, a / a.sum(), y, b / b.sum()), torch.from_numpy(centres), radius, lines


def with_gradients(loss, arrays, *settings):
    x, a, y, b = (torch.from_numpy(array).requires_grad_() for array in arrays)
    one, other = (DiscreteMeasure(points, weights / weights.sum()) for points, weights in ((x, a), (y, b)))
    value = loss(one, other, *settings)
    return value, *torch.autograd.grad(value, (x, a, y, b))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("p", [1, 1.5, 2])
def test_kernels_agree_with_the_definition(name, p):
    arrays, *settings = case(name)
    found = with_gradients(windowed_sliced_wasserstein, arrays, *settings, p)
    expected = with_gradients(oracles.windowed_sliced_wasserstein, arrays, *settings, p)
    assert float(expected[0].detach()) > 1e-3
    torch.testing.assert_close(found[0], expected[0], rtol=1e-10, atol=0)
    if name == "ties":  # points in one place are interchangeable: only their sum is determined
        found, expected = ([each[1].sum(dim=0), each[3].sum(dim=0)] for each in (found, expected))
        found, expected = ([], []) if p == 1 else (found, expected)  # where points coincide, |x − y| has a kink
    if name == "zero weights":  # without mass, a point has one-sided derivatives in its weight only
        held = [torch.from_numpy(arrays[k]) > 0 for k in (1, 3)]
        found, expected = ([e[1], e[2][held[0]], e[3], e[4][held[1]]] for e in (found, expected))
    for one, other in zip(found, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-8, atol=1e-11)


@pytest.mark.parametrize("p", [1.5, 2])
def test_gradcheck(p):
    """In the coordinates that the windows do not use, and in the weights; in all of them where the window is level."""
    (x, a, y, b), centres, radius, lines = case("generic", n_windows=2)
    for width, free in ((radius, 3), (1e7, 0)):
        rest = [torch.from_numpy(values[:9, :free]) for values in (x, y)]
        moving = [torch.from_numpy(values[:9, free:].copy()).requires_grad_() for values in (x, y)]
        masses = [torch.from_numpy(values[:9].copy()).requires_grad_() for values in (a, b)]

        def loss(u, v, s, t, rest=rest, width=width):
            one, other = (torch.cat(parts, dim=1) for parts in zip(rest, (u, v)))
            pair = DiscreteMeasure(one, s / s.sum()), DiscreteMeasure(other, t / t.sum())
            return windowed_sliced_wasserstein(*pair, centres, width, lines, p)

        assert torch.autograd.gradcheck(loss, (*moving, *masses))


def test_only_the_gradients_that_are_wanted():
    arrays, *settings = case("generic")
    all_four = with_gradients(windowed_sliced_wasserstein, arrays, *settings)[1:]
    for k in range(4):
        tensors = [torch.from_numpy(array).requires_grad_(i == k) for i, array in enumerate(arrays)]
        pair = DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:])
        windowed_sliced_wasserstein(*pair, *settings).backward()
        found = tensors[k].grad - (0 if k % 2 == 0 else tensors[k] @ tensors[k].grad)
        torch.testing.assert_close(found, all_four[k], rtol=1e-9, atol=1e-13)
    with torch.no_grad():
        pair = [DiscreteMeasure(*map(torch.from_numpy, arrays[k : k + 2])) for k in (0, 2)]
        assert windowed_sliced_wasserstein(*pair, *settings).grad_fn is None


def test_the_plain_path_agrees(monkeypatch):
    arrays, centres, radius, lines = case("a window of one side only")
    expected = with_gradients(windowed_sliced_wasserstein, arrays, centres, radius, lines)
    monkeypatch.setattr("meshot.loss.windowed.fused_windows", None)
    free = lines.clone().requires_grad_()
    found = with_gradients(windowed_sliced_wasserstein, arrays, centres, radius, free)
    for one, other in zip(found, expected, strict=True):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-12)


def test_a_gradient_in_the_directions():
    arrays, centres, radius, lines = case("generic")
    pair = [DiscreteMeasure(*map(torch.from_numpy, arrays[k : k + 2])) for k in (0, 2)]
    free = lines.clone().requires_grad_()
    value = windowed_sliced_wasserstein(*pair, centres, radius, free)
    value.backward()
    assert float(free.grad.abs().max()) > 0
    expected = windowed_sliced_wasserstein(*pair, centres, radius, lines)
    assert float(value.detach()) == pytest.approx(float(expected), rel=1e-12)
