"""The exercises of chapter 14: independent solutions pass, and each usual mistake gets its own hint."""

import pytest
import torch
from scipy import optimize

from meshot.mesh.connectivity import euler_number, self_intersecting_faces
from meshot.mesh.geometry import signed_volume
from meshot_book.exercises import check
from meshot_book.exercises.normal_exercises import _notched_block


def by_brent(loss, share):
    exponent = optimize.brentq(lambda e: 1 - loss(0) / loss(10**e) - share, -6, 6, xtol=1e-13)
    return 10**exponent


def by_determinants(v, f):
    return bool(torch.det(v[f]).sum() < 0)


def by_autograd(a, b, c):
    corner = a.clone().requires_grad_()
    area = torch.linalg.cross(b - corner, c - corner).norm() / 2
    return torch.autograd.grad(area, corner)[0]


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.scale_for_share, by_brent),
        (check.area_gradient, by_autograd),
        (check.is_inside_out, by_determinants),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def outward(v, f, centre):
    normals = torch.linalg.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    return ((v[f].mean(dim=1) - centre) * normals / normals.norm(dim=1, keepdim=True)).sum(dim=1)


MISTAKES = {
    "scale_for_share": {
        "share is of the whole": lambda loss, share: by_brent(loss, share / (1 + share)),
        "not the normals": lambda loss, share: by_brent(loss, 1 - share),
        "the square": lambda loss, share: by_brent(loss, share) ** 2,
        "this search ends at 100": lambda loss, share: min(by_brent(loss, share), 100.0),
        "this assumes that normals add a multiple of s²": lambda loss, share: (
            (loss(0) * share / (1 - share) / (loss(1) - loss(0))) ** 0.5
        ),
    },
    "is_inside_out": {
        "the answer is negated": lambda v, f: not by_determinants(v, f),
        "faces have equal weights here": lambda v, f: bool(outward(v, f, v.mean(dim=0)).mean() < 0),
        "this uses one face only": lambda v, f: bool(outward(v, f, v.mean(dim=0))[0] < 0),
        "some outward normals point towards the origin": lambda v, f: bool(outward(v, f, 0).min() < 0),
    },
    "area_gradient": {
        "the sign": lambda a, b, c: -by_autograd(a, b, c),
        "factor of two": lambda a, b, c: 2 * by_autograd(a, b, c),
        "the length must be": lambda a, b, c: by_autograd(a, b, c) / by_autograd(a, b, c).norm(),
        "away from the middle": lambda a, b, c: (
            (c - b).norm() / 2 * torch.nn.functional.normalize(a - (b + c) / 2, dim=0)
        ),
        "gradient in b": lambda a, b, c: by_autograd(b, c, a),
        "gradient in c": lambda a, b, c: by_autograd(c, a, b),
        "area vector": lambda a, b, c: torch.linalg.cross(b - a, c - a) / 2,
    },
}


@pytest.mark.parametrize(
    ("name", "words"), [(name, words) for name, mistakes in MISTAKES.items() for words in mistakes]
)
def test_each_mistake_has_its_hint(hinted, name, words):
    hinted(getattr(check, name), MISTAKES[name][words], words)


@pytest.mark.parametrize("walls_first", [True, False])
def test_the_block_with_a_funnel_is_a_closed_surface(walls_first):
    block = _notched_block(walls_first)
    assert euler_number(block) == 2
    assert len(self_intersecting_faces(block)) == 0
    assert float(signed_volume(block)) == pytest.approx(8 - 4 * 1.9 / 3)
