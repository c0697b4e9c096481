"""The checkers of chapter 31: right answers pass, typical wrong ones get their hint."""

import itertools

import numpy as np
import pytest
import scipy.ndimage
import skimage.measure
import torch

from meshot_book.exercises import check
from meshot_book.exercises.surface_exercises import _euler, _masks


def overlap(a, b):
    total = (a * a + b * b).sum()
    return 2 * (a * b).sum() / total if total > 0 else 1.0


def euler(mask):
    corners, edges, faces, cubes = set(), set(), set(), 0
    for x, y, z in mask.nonzero().tolist():
        cubes += 1
        for i, j, k in np.ndindex(3, 3, 3):
            place, n_middle = (2 * x + i, 2 * y + j, 2 * z + k), (i == 1) + (j == 1) + (k == 1)
            if n_middle < 3:
                (corners, edges, faces)[n_middle].add(place)
    return len(corners) - len(edges) + len(faces) - cubes


def row(fractions, size):
    values = fractions.tolist()
    places = []
    for i, (a, b) in enumerate(itertools.pairwise(values)):
        if (a - 0.5) * (b - 0.5) < 0:
            places.append(i + (a - 0.5) / (a - b))
    found = [size * min(abs(i - p) for p in places) for i in range(len(values))]
    return torch.tensor([-d if v > 0.5 else d for d, v in zip(found, values)])


@pytest.mark.parametrize(
    ("checker", "answer"), [(check.soft_overlap, overlap), (check.mask_euler, euler), (check.row_distance, row)]
)
def test_independent_solutions_pass(capsys, checker, answer):
    checker(answer)
    assert capsys.readouterr().out.startswith("✓")


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        (lambda a, b: 2 * (a * b).sum() / (a.sum() + b.sum()) if (a + b).any() else 1.0, "square below"),
        (lambda a, b: overlap((a > 0.5).double(), (b > 0.5).double()), "the maps are thresholded at ½ first"),
        (lambda a, b: overlap(a, b) / 2, "the 2 is missing"),
        (lambda a, b: 1 - overlap(a, b), "one minus"),
        (lambda a, b: (a * b).sum() / (a * a + b * b - a * b).sum() if (a + b).any() else 1.0, "Jaccard"),
        (lambda a, b: overlap(a, b) if (a + b).any() else 0.0, "two empty maps"),
        (lambda a, b: 2 * (a * b).sum() / (a * a + b * b).sum(), "not a number"),
    ],
)
def test_hints_on_overlap(hinted, wrong, hint):
    hinted(check.soft_overlap, wrong, hint)


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        (lambda m: int(m.sum()), "shared corners must be counted once"),
        (lambda m: euler(m) + int(m.sum()), "cubes are missing"),
        (lambda m: 2 * euler(m), "twice as much"),
        (lambda m: -euler(m), "the sign is wrong"),
        (lambda m: euler(m[:-1, :-1, :-1]), "far border"),
        (lambda m: 1, "wrong on"),
    ],
)
def test_hints_on_euler_numbers(hinted, wrong, hint):
    hinted(check.mask_euler, wrong, hint)


@pytest.mark.parametrize(
    ("wrong", "hint"),
    [
        (lambda f, s: -row(f, s), "negative inside"),
        (lambda f, s: row(f, s).abs(), "must be negative"),
        (lambda f, s: row(f, s) / s, "in mm"),
        (lambda f, s: row((f > 0.5).double(), s), "interpolate linearly"),
        (
            lambda f, s: torch.from_numpy(
                np.where(f > 0.5, -1, 1)
                * s
                * np.where(
                    f > 0.5,
                    scipy.ndimage.distance_transform_edt(f > 0.5),
                    scipy.ndimage.distance_transform_edt(f <= 0.5),
                )
            ),
            "other side",
        ),
    ],
)
def test_hints_on_distances(hinted, wrong, hint):
    hinted(check.row_distance, wrong, hint)


def test_euler_numbers_against_a_second_library():
    for name, mask in _masks():
        assert _euler(mask) == skimage.measure.euler_number(np.pad(mask.numpy(), 1), connectivity=3) == euler(mask), (
            name
        )
