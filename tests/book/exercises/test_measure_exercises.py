"""The exercises of chapter 10: independent solutions pass, and each usual mistake gets its own hint."""

import numpy as np
import pytest
import torch
from scipy import stats

from meshot import Mesh
from meshot.mesh import sample_points
from meshot_book.exercises import check
from meshot_book.exercises.measure_exercises import _mean, _squares


def heron(v, f):
    """Areas from side lengths alone."""
    a, b, c = ((v[f[:, i]] - v[f[:, j]]).norm(dim=1) for i, j in ((0, 1), (1, 2), (2, 0)))
    s = (a + b + c) / 2
    return (s * (s - a) * (s - b) * (s - c)).clamp(min=0).sqrt()


def scipy_tent(c, x):
    low, middle, high = np.sort(c.numpy())
    return torch.from_numpy(stats.triang.pdf(x.numpy(), (middle - low) / (high - low), low, high - low))


def by_quadrature(v, f, u):
    """The rule of the three mid-edge points, exact for quadratics."""
    corners = v[f] @ u
    middles = (corners + corners.roll(1, dims=1)) / 2
    return float((heron(v, f) * middles.square().mean(dim=1)).sum() / heron(v, f).sum())


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.face_weights, lambda v, f: heron(v, f) / heron(v, f).sum()),
        (check.tent_density, scipy_tent),
        (check.mean_square, by_quadrature),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def sorted_tent(c, x):
    return scipy_tent(c, x)


MISTAKES = {
    "face_weights": {
        "the mass must be proportional to the area": lambda v, f: torch.ones(len(f)).double() / len(f),
        "total mass one": heron,
        "halve": lambda v, f: 2 * heron(v, f),
        "the root is missing": lambda v, f: heron(v, f) ** 2 / (heron(v, f) ** 2).sum(),
        "divided by the largest": lambda v, f: heron(v, f) / heron(v, f).max(),
    },
    "tent_density": {
        "one half": lambda c, x: sorted_tent(c, x) / 2,
        "it must be at the middle corner": lambda c, x: torch.from_numpy(
            stats.triang.pdf(x.numpy(), 0.5, float(c.min()), float(c.max() - c.min()))
        ),
        "density of an edge": lambda c, x: torch.from_numpy(
            stats.uniform.pdf(x.numpy(), float(c.min()), float(c.max() - c.min()))
        ),
    },
    "mean_square": {
        "barycentres only": lambda v, f, u: float(
            (heron(v, f) * (v[f].mean(dim=1) @ u) ** 2).sum() / heron(v, f).sum()
        ),
        "corners only": lambda v, f, u: float(
            (heron(v, f) * (v[f] @ u).square().mean(dim=1)).sum() / heron(v, f).sum()
        ),
        "weight each by its area": lambda v, f, u: float(_squares(v, f, u).mean()),
        "divide by the total area": lambda v, f, u: by_quadrature(v, f, u) * float(heron(v, f).sum()),
        "this is a root": lambda v, f, u: by_quadrature(v, f, u) ** 0.5,
        "this is the variance": lambda v, f, u: by_quadrature(v, f, u) - _mean(v, f, v[f].mean(dim=1) @ u) ** 2,
        "mean over the vertices": lambda v, f, u: float((v @ u).square().mean()),
    },
}


@pytest.mark.parametrize(
    ("name", "words"), [(name, words) for name, mistakes in MISTAKES.items() for words in mistakes]
)
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), MISTAKES[name][words], words)


def test_unsorted_and_uncut_tents_have_their_hints(capsys):
    def tent(c, x, cut):
        low, middle, high = c
        rising = (x - low) / (middle - low) if middle != low else torch.full_like(x, 1e9)
        falling = (high - x) / (high - middle) if high != middle else torch.full_like(x, 1e9)
        height = torch.minimum(rising, falling) * 2 / (high - low)
        return torch.where((x < low) | (x > high), 0.0, height) if cut else height

    check.tent_density(lambda c, x: tent(c, x, True))
    assert "sort them" in capsys.readouterr().out
    check.tent_density(lambda c, x: tent(c.sort().values, x, False))
    assert "outside the triangle" in capsys.readouterr().out


def test_a_tent_that_divides_by_the_width_of_an_upright_side_is_refused(capsys):
    def divides(c, x):
        low, middle, high = c.sort().values
        tent = torch.minimum((x - low) / (middle - low), (high - x) / (high - middle)) * 2 / (high - low)
        return torch.where((x >= low) & (x <= high), tent, 0.0)

    check.tent_density(divides)
    assert "division by zero" in capsys.readouterr().out


def test_a_sample_has_the_mean_square_of_its_mesh():
    vertices = torch.tensor([[0.0, 0, 0], [1, 2, 0], [4, 1, 3]], dtype=torch.float64)
    mesh, oblique = Mesh(vertices, torch.tensor([[0, 1, 2]])), torch.tensor([0.36, 0.48, 0.8], dtype=torch.float64)
    drawn = sample_points(mesh, 100_000, np.random.default_rng(0)) @ oblique
    assert float(drawn.square().mean()) == pytest.approx(by_quadrature(mesh.vertices, mesh.faces, oblique), rel=0.01)
