"""Plain torch in chunks of directions, as on other devices than processors: the same loss in bounded memory."""

import pytest
import torch

import problems
from meshot import DiscreteMeasure, quasi_directions, slice_costs, sliced_wasserstein
from meshot.loss import sliced as chunked
from meshot.loss.sliced import plain_costs, plain_sliced_wasserstein
from meshot_book.examples.memory import peak_saved_bytes

LINES = quasi_directions(64, 3)


@pytest.fixture
def elsewhere(monkeypatch):
    """Take the path of other devices on the processor."""
    monkeypatch.setattr("meshot.loss.sliced.takes_kernel", lambda points: False)


def leaves(weighted, n, m):
    measures = problems.cloud(0, n, 3, weighted), problems.cloud(1, m, 3, weighted)
    return [t.clone().requires_grad_() for measure in measures for t in (measure.points, measure.weights)]


@pytest.mark.parametrize("p", [1, 2, 3])
@pytest.mark.parametrize(("weighted", "n", "m"), [(True, 40, 30), (False, 40, 40), (False, 40, 30)])
@pytest.mark.parametrize("chunk", [1, 500, 1 << 22])
def test_value_and_gradients_are_those_of_all_directions_at_once(elsewhere, monkeypatch, p, weighted, n, m, chunk):
    monkeypatch.setattr(chunked, "_CHUNK", chunk)
    tensors = leaves(weighted, n, m)
    source, target = DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:])
    # The sum over directions is added up in another order: some units of rounding.
    found, expected = (f(source, target, LINES, p) for f in (sliced_wasserstein, plain_sliced_wasserstein))
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=0)
    for one, other in zip(*(torch.autograd.grad(value, tensors) for value in (found, expected))):
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-13)


def test_equal_masses_without_gradient_are_paired(elsewhere):
    points, _, others, _ = leaves(False, 40, 40)
    found, expected = (f(points, others, LINES) for f in (sliced_wasserstein, plain_sliced_wasserstein))
    torch.testing.assert_close(found, expected, rtol=1e-12, atol=0)
    for one, other in zip(*(torch.autograd.grad(value, (points, others)) for value in (found, expected))):
        torch.testing.assert_close(one, other, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("weighted", [True, False])
def test_memory_is_that_of_a_chunk(elsewhere, monkeypatch, weighted):
    n, m, lines = 600, 500, 8
    monkeypatch.setattr(chunked, "_CHUNK", lines * (n + m))
    tensors = leaves(weighted, n, m)
    source, target = DiscreteMeasure(*tensors[:2]), DiscreteMeasure(*tensors[2:])
    held = peak_saved_bytes(lambda: sliced_wasserstein(source, target, LINES).backward())
    of_all, of_one = (
        peak_saved_bytes(lambda k=k: plain_sliced_wasserstein(source, target, LINES[:k]).backward())
        for k in (64, lines)
    )
    assert of_all > 7 * of_one
    assert held <= 2 * of_one


def test_no_tensor_is_larger_than_a_chunk(elsewhere, monkeypatch):
    """What a step holds for a moment is not in the account of autograd: every projection made is looked at instead."""
    monkeypatch.setattr(chunked, "_CHUNK", 8 * 70)
    seen = []
    own = chunked.quantile_cost
    monkeypatch.setattr(chunked, "quantile_cost", lambda x, *rest: (seen.append(x.shape), own(x, *rest))[1])
    sliced_wasserstein(*(problems.cloud(k, 35, 3, True) for k in (0, 1)), LINES)
    assert seen == [(8, 35)] * 8


def test_costs_without_gradient_come_in_chunks(elsewhere, monkeypatch):
    monkeypatch.setattr(chunked, "_CHUNK", 500)
    source, target = problems.cloud(0, 40, 3, True), problems.cloud(1, 30, 3, True)
    torch.testing.assert_close(slice_costs(source, target, LINES), plain_costs(source, target, LINES, 2))


def test_directions_with_a_gradient_take_all_at_once():
    lines = LINES.clone().requires_grad_()
    source, target = problems.cloud(0, 9, 3), problems.cloud(1, 9, 3)
    (slope,) = torch.autograd.grad(sliced_wasserstein(source, target, lines), lines)
    assert float(slope.norm()) > 0
