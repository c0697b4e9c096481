"""The exercises of chapter 04: truths from elsewhere, and a different hint for each usual mistake."""

import numpy as np
import ot
import pytest
import torch

from exercise_answers import merged_pair
from meshot import DiscreteMeasure, sinkhorn_divergence, varifold, wasserstein
from meshot.mesh.mesh import Contour
from meshot.mesh.shapes import circle
from meshot_book.exercises import check
from meshot_book.exercises.zoo_exercises import _entropic

RIGHT = {
    "blur_in_coordinates": lambda blur, half, p: torch.tensor([blur / half, (blur / half) ** p]).double(),
    "smallest_flip": lambda floor, scale: min(1.0, (floor / (2 * scale)) ** 2),
    "debiased": lambda c, x, y, p: p * (c(x, y) - c(x, x) / 2 - c(y, y) / 2),
    "trap": merged_pair,
}


@pytest.mark.parametrize("name", RIGHT)
def test_independent_solutions_pass(capsys, name):
    getattr(check, name)(RIGHT[name])
    assert capsys.readouterr().out.startswith("✓")


def test_a_flip_weighs_what_the_exercise_says():
    """By exact transport between varifolds of a circle, a fifth of its edges turned round."""
    contour = circle(40.0, 60)
    edges = contour.edges.clone()
    edges[:12] = edges[:12].flip(1)
    cost = wasserstein(
        varifold(Contour(contour.vertices, edges), normal_scale=3.0), varifold(contour, normal_scale=3.0)
    )
    assert float(cost) ** 0.5 == pytest.approx((12 / 60 * 4 * 3.0**2) ** 0.5)


@pytest.mark.parametrize("p", [1, 2])
def test_the_entropic_cost_of_the_exercise_is_that_of_other_libraries(p):
    x, y = torch.rand(5, 2, generator=torch.Generator().manual_seed(0)).double(), torch.eye(2).double()
    cost = ot.dist(x.numpy(), y.numpy(), metric="euclidean") ** p / p
    epsilon = 0.5
    masses = [np.full(len(side), 1 / len(side)) for side in (x, y)]
    plan = torch.from_numpy(ot.sinkhorn(*masses, cost, reg=epsilon, stopThr=1e-10, numItermax=10_000))
    relative = plan * (plan * len(x) * len(y)).log()
    assert _entropic(p)(x, y) == pytest.approx(float((plan * torch.from_numpy(cost)).sum() + epsilon * relative.sum()))
    divergence = sinkhorn_divergence(DiscreteMeasure(x), DiscreteMeasure(y), p, blur=epsilon ** (1 / p), scaling=0.95)
    solved = RIGHT["debiased"](_entropic(p), x, y, p)
    assert solved == pytest.approx(float(divergence), rel=0.01)


WRONG = {
    "blur_in_coordinates": {
        "multiplied instead of divided": lambda b, r, p: (b * r, (b * r) ** p),
        "the *half*": lambda b, r, p: (b / r / 2, (b / r / 2) ** p),
        "not in mm": lambda b, r, p: (b / r, b**p),
        "divided p times": lambda b, r, p: (b / r, b**p / r),
        "to the power p": lambda b, r, p: (b / r, b / r),
        "unchanged": lambda b, r, p: (b, b**p),
    },
    "smallest_flip": {
        "cannot exceed 1": lambda f, s: f**2 / (4 * s**2),
        "*squared* distance": lambda f, s: min(1.0, f / s / 2),
        "twice its length": lambda f, s: min(1.0, (f / s) ** 2),
        "square of 2 s": lambda f, s: min(1.0, (f / s) ** 2 / 2),
        "the quotient is inverted": lambda f, s: min(1.0, (2 * s / f) ** 2),
        "has no unit": lambda f, s: f,
    },
    "debiased": {
        "undo the division": lambda c, x, y, p: c(x, y) - c(x, x) / 2 - c(y, y) / 2,
        "subtract the bias": lambda c, x, y, p: p * c(x, y),
        "cost itself": lambda c, x, y, p: c(x, y),
        "*half*": lambda c, x, y, p: p * (c(x, y) - c(x, x) - c(y, y)),
        "the answer changes when x and y are exchanged": lambda c, x, y, p: p * c(x, y) - p * c(x, x),
        "was divided by p": lambda c, x, y, p: (c(x, y) - c(x, x) / 2 - c(y, y) / 2) / p,
        "the factor p belongs to all three terms": lambda c, x, y, p: p * c(x, y) - c(x, x) / 2 - c(y, y) / 2,
    },
    "trap": {
        "these are the target points themselves": lambda y: y.flip(0),
        "a point still moves under Chamfer": lambda y: y + 0.3,
        "as many points as targets": lambda y: y[:2],
        "it returns None": lambda y: None,
    },
}


@pytest.mark.parametrize(("name", "words"), [(name, words) for name in WRONG for words in WRONG[name]])
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), WRONG[name][words], words)
