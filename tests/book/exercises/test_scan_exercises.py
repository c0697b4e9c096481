"""The exercises of chapter 36: truths from elsewhere, and a different hint for each usual mistake."""

import numpy as np
import pytest
import skimage.measure
import torch

from meshot.mesh.connectivity import euler_number
from meshot.mesh.mesh import Mesh
from meshot.volume.volume import Volume, centre_ras
from meshot_book.exercises import check
from meshot_book.exercises.scan_exercises import _ring, _two_holes


def by_our_topology(faces):
    generator = np.random.default_rng(0)
    vertices = torch.from_numpy(generator.normal(size=(int(faces.max()) + 1, 3)))
    return (2 - euler_number(Mesh(vertices, faces))) // 2


def by_our_centre(points, affine, shape):
    return points - points.new_tensor(centre_ras(Volume(np.zeros(shape, dtype=bool), affine.numpy())))


def by_euler_numbers(mask):
    """Whether neither the Euler number nor the number of parts of object or background changes."""
    before, after = np.pad(mask.numpy(), 2), np.pad(mask.numpy(), 2)
    before[3, 3], after[3, 3] = False, True
    counts = [
        (
            skimage.measure.euler_number(m, connectivity=2),
            skimage.measure.label(m, connectivity=2).max(),
            skimage.measure.label(~m, connectivity=1).max(),
        )
        for m in (before, after)
    ]
    return counts[0] == counts[1]


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.handles, by_our_topology),
        (check.surface_ras, by_our_centre),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def test_a_crossing_number_passes_as_simple(capsys):
    """Yokoi's connectivity number of an 8-connected object, a formula of its own."""

    def yokoi(mask):
        x = [bool(mask[p]) for p in ((1, 2), (0, 2), (0, 1), (0, 0), (1, 0), (2, 0), (2, 1), (2, 2))]
        free = [not v for v in x]
        return sum(free[k] - free[k] * free[k + 1] * free[(k + 2) % 8] for k in (0, 2, 4, 6)) == 1

    check.is_simple(yokoi)
    assert capsys.readouterr().out.startswith("✓ is_simple: right on all 256 cases")


def test_simple_pixels_change_no_count():
    from meshot_book.exercises.scan_exercises import _is_simple

    for code in range(512):
        mask = torch.tensor([bool(code >> i & 1) for i in range(9)]).reshape(3, 3)
        mask[1, 1] = False
        if _is_simple(mask):
            assert by_euler_numbers(mask)


def test_the_genus_of_the_cases():
    assert [by_our_topology(f) for f in (_ring(5, 4), _two_holes())] == [1, 2]


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.handles, lambda f: 2 - 2 * by_our_topology(f), "χ itself"),
        (check.handles, lambda f: 2 * by_our_topology(f), "accounts for two"),
        (check.handles, lambda f: -by_our_topology(f), "the sign is wrong"),
        (check.handles, lambda f: 1 + (2 * len(f) - len(f.unique())) // 2, "each of its two faces"),
        (check.surface_ras, lambda p, a, s: 2 * p - by_our_centre(p, a, s), "added"),
        (check.surface_ras, lambda p, a, s: p, "unchanged"),
        (check.surface_ras, lambda p, a, s: by_our_centre(p, a, tuple(n - 1 for n in s)), "half the"),
        (check.is_simple, lambda m: bool(m.any()), "wrong on"),
        (check.is_simple, lambda m: 0 < int(m.sum()) < 8, "close a ring"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)
