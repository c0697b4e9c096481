"""The exercises of chapter 01: truths from elsewhere, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch

from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.transport import chamfer
from meshot.measure.discrete import DiscreteMeasure
from meshot_book.exercises import check
from meshot_book.flows import forces


def nearest(x, y):
    return y[torch.cdist(x, y).argmin(dim=1)]


def loss_line_arrows(x, y, u):
    """By the loss itself: the gradient along one direction, halved and turned round."""
    return forces(lambda z: sliced_wasserstein(DiscreteMeasure(z), DiscreteMeasure(y), u[None]), x)


def simulated_rate(n_selections, momentum):
    """Bisection on a heavy ball that is let go: no formula."""
    low, high = 0.0, 8.0
    for _ in range(60):
        rate = (low + high) / 2
        matrix = np.array([[1 + momentum - rate * 2 * (1 + n_selections), -momentum], [1, 0]])
        stable = np.abs(np.linalg.eigvals(matrix)).max() <= 1 + 1e-9
        low, high = (rate, high) if stable else (low, rate)
    return low


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.nearest_arrows, lambda x, y: nearest(x, y) - x),
        (check.line_arrows, loss_line_arrows),
        (check.largest_rate, simulated_rate),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def test_the_first_arrow_is_that_of_chamfer():
    generator = np.random.default_rng(5)
    x, y = (torch.from_numpy(generator.normal(size=(1, 2)) + shift) for shift in (0, 3))
    both = forces(lambda z: chamfer(DiscreteMeasure(z), DiscreteMeasure(y)), x)
    torch.testing.assert_close(both, 2 * (nearest(x, y) - x))


NEAREST = {
    "away from the target": lambda x, y: x - nearest(x, y),
    "nearest target points themselves": lambda x, y: nearest(x, y),
    "axis of the minimum": lambda x, y: y[torch.cdist(x, y).argmin(dim=0)] - x,
    "twice too long": lambda x, y: 2 * (nearest(x, y) - x),
    "division by the norm": lambda x, y: torch.nn.functional.normalize(nearest(x, y) - x),
    "every arrow ends at the mean of the target": lambda x, y: y.mean(dim=0) - x,
}
LINE = {
    "away from the target": lambda x, y, u: -loss_line_arrows(x, y, u),
    "undo the sorting": lambda x, y, u: torch.outer((y @ u).sort()[0] - (x @ u).sort()[0], u),
    "points are paired in their original order": lambda x, y, u: torch.outer(y @ u - x @ u, u),
    "targets are not sorted": lambda x, y, u: torch.outer((y @ u)[(x @ u).argsort().argsort()] - x @ u, u),
    "or assign through the order": lambda x, y, u: torch.outer((y @ u).sort()[0][(x @ u).argsort()] - x @ u, u),
    "project the arrow": lambda x, y, u: y[(y @ u).argsort()][(x @ u).argsort().argsort()] - x,
}
RATE = {
    "without momentum": lambda k, b: 1 / (1 + k),
    "number of selections": lambda k, b: 2 * (1 + b),
    "one more square": lambda k, b: (1 + b) / k if k else 2 * (1 + b),
    "is 2, not 1": lambda k, b: 2 * (1 + b) / (1 + k),
    "sign of the momentum": lambda k, b: (1 - b) / (1 + k),
}


@pytest.mark.parametrize(
    ("checker", "words", "function"),
    [
        (getattr(check, name), words, function)
        for name, mistakes in (("nearest_arrows", NEAREST), ("line_arrows", LINE), ("largest_rate", RATE))
        for words, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, words, function):
    hinted(checker, function, words)
