"""The exercises of chapter 10: independent solutions pass, and each usual mistake gets its own hint."""

import numpy as np
import pytest
import torch
from scipy import optimize, stats

from meshot.mesh.geometry.areas import signed_volume
from meshot.mesh.topology.counts import euler_number
from meshot.mesh.topology.intersection import self_intersecting_faces
from meshot_book.exercises import check
from meshot_book.exercises.measure_exercises import _notched_block


def heron(v, f):
    """Areas from side lengths alone."""
    a, b, c = ((v[f[:, i]] - v[f[:, j]]).norm(dim=1) for i, j in ((0, 1), (1, 2), (2, 0)))
    s = (a + b + c) / 2
    return (s * (s - a) * (s - b) * (s - c)).clamp(min=0).sqrt()


def scipy_tent(c, x):
    low, middle, high = np.sort(c.numpy())
    return torch.from_numpy(stats.triang.pdf(x.numpy(), (middle - low) / (high - low), low, high - low))


def by_brent(loss, share):
    exponent = optimize.brentq(lambda e: 1 - loss(0) / loss(10**e) - share, -6, 6, xtol=1e-13)
    return 10**exponent


def by_determinants(v, f):
    return bool(torch.det(v[f]).sum() < 0)


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.face_weights, lambda v, f: heron(v, f) / heron(v, f).sum()),
        (check.tent_density, scipy_tent),
        (check.scale_for_share, by_brent),
        (check.is_inside_out, by_determinants),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def outward(v, f, centre):
    normals = torch.linalg.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    return ((v[f].mean(dim=1) - centre) * normals / normals.norm(dim=1, keepdim=True)).sum(dim=1)


def sorted_tent(c, x):
    return scipy_tent(c, x)


MISTAKES = {
    "face_weights": {
        "hit more often": lambda v, f: torch.ones(len(f)).double() / len(f),
        "total mass one": heron,
        "halve": lambda v, f: 2 * heron(v, f),
        "the root is missing": lambda v, f: heron(v, f) ** 2 / (heron(v, f) ** 2).sum(),
        "divided by the largest": lambda v, f: heron(v, f) / heron(v, f).max(),
    },
    "tent_density": {
        "one half": lambda c, x: sorted_tent(c, x) / 2,
        "over the middle corner": lambda c, x: torch.from_numpy(
            stats.triang.pdf(x.numpy(), 0.5, float(c.min()), float(c.max() - c.min()))
        ),
        "a box": lambda c, x: torch.from_numpy(stats.uniform.pdf(x.numpy(), float(c.min()), float(c.max() - c.min()))),
    },
    "scale_for_share": {
        "share is of the whole": lambda loss, share: by_brent(loss, share / (1 + share)),
        "turn it round": lambda loss, share: by_brent(loss, 1 - share),
        "the square": lambda loss, share: by_brent(loss, share) ** 2,
        "search": lambda loss, share: (loss(0) * share / (1 - share) / (loss(1) - loss(0))) ** 0.5,
    },
    "is_inside_out": {
        "other way round": lambda v, f: not by_determinants(v, f),
        "faces count alike": lambda v, f: bool(outward(v, f, v.mean(dim=0)).mean() < 0),
        "one face decides": lambda v, f: bool(outward(v, f, v.mean(dim=0))[0] < 0),
        "look back at the origin": lambda v, f: bool(outward(v, f, 0).min() < 0),
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


@pytest.mark.parametrize("walls_first", [True, False])
def test_the_block_with_a_funnel_is_a_closed_surface(walls_first):
    block = _notched_block(walls_first)
    assert euler_number(block) == 2
    assert len(self_intersecting_faces(block)) == 0
    assert float(signed_volume(block)) == pytest.approx(8 - 4 * 1.9 / 3)
