"""The exercises of chapter 30: truths from elsewhere, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch

from meshot.volume.registration import EXTENT_MM, SHAPE, place_on_grid
from meshot.volume.volume import Volume
from meshot_book.exercises import check
from meshot_book.exercises.imaging_exercises import _share


def by_counting(normal, offset, n=2000):
    ticks = (np.arange(n) + 0.5) / n - 0.5
    x, y = np.meshgrid(ticks, ticks)
    return float((float(normal[0]) * x + float(normal[1]) * y <= offset).mean())


def by_clipping(normal, offset):
    """The area of the square cut by the line (Sutherland and Hodgman, then the shoelace formula)."""
    square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
    a, b = float(normal[0]), float(normal[1])
    kept = []
    for (x, y), (u, v) in zip(square, square[1:] + square[:1]):
        here, there = a * x + b * y - offset, a * u + b * v - offset
        if here <= 0:
            kept.append((x, y))
        if here * there < 0:
            t = here / (here - there)
            kept.append((x + t * (u - x), y + t * (v - y)))
    area = sum(x * v - u * y for (x, y), (u, v) in zip(kept, kept[1:] + kept[:1]))
    return abs(area) / 2


def sigma(values):
    return float(np.sqrt(np.mean(values.numpy() ** 2) / 2))


def affine(extent, shape, centre):
    sizes = extent / shape
    low = centre - extent / 2
    result = torch.diag(torch.cat([sizes, torch.ones(1, dtype=torch.float64)]))
    result[:3, 3] = low + sizes / 2
    return result


def test_the_shares_agree_with_counting():
    rng = np.random.default_rng(0)
    for _ in range(20):
        angle, offset = rng.uniform(0, 2 * np.pi), rng.uniform(-0.8, 0.8)
        normal = torch.tensor([np.cos(angle), np.sin(angle)])
        assert _share(normal, offset) == pytest.approx(by_counting(normal, offset), abs=2e-3)


def test_the_grid_is_the_standard_one():
    scan = Volume(np.random.default_rng(0).random((4, 4, 4)), np.diag([50.0, 50.0, 50.0, 1.0]))
    centre = np.array([80.0, 70.0, 60.0])
    placed = place_on_grid(scan, np.eye(4), centre).volume.affine
    arguments = (torch.tensor(x, dtype=torch.float64) for x in (EXTENT_MM, SHAPE, centre))
    np.testing.assert_allclose(affine(*arguments), placed)


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.noise_from_air, sigma), (check.grid_affine, affine), (check.pixel_share, by_clipping)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.noise_from_air, lambda v: v.std(), "deviation of a magnitude"),
        (check.noise_from_air, lambda v: v.std(correction=0), "deviation of a magnitude"),
        (check.noise_from_air, lambda v: 2**0.5 * sigma(v), "two channels"),
        (check.noise_from_air, lambda v: sigma(v) ** 2, "this is σ²"),
        (check.noise_from_air, lambda v: v.mean(), "is not σ"),
        (check.noise_from_air, lambda v: v.mean() * (2 / np.pi) ** 0.5, "first moment"),
        (check.grid_affine, lambda e, s, c: moved(affine(e, s, c), -e / s / 2), "middle"),
        (check.grid_affine, lambda e, s, c: moved(affine(e, s, c), e / s * (s - 1)), "subtract"),
        (check.grid_affine, lambda e, s, c: moved(affine(e, s, c), e / s * (s - 1) / 2), "first voxel at the centre"),
        (check.pixel_share, lambda n, d: float(d >= 0), "this tests the centre only"),
        (
            check.pixel_share,
            lambda n, d: float(np.clip(0.5 + d, 0, 1)),
            "right only for a line parallel to a side of the pixel",
        ),
        (check.pixel_share, lambda n, d: float(np.clip(0.5 + d / n.abs().sum(), 0, 1)), "like a square"),
        (check.pixel_share, lambda n, d: 1 - by_clipping(n, d), "other side"),
        (check.pixel_share, lambda n, d: 0.25, "wrong on"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)


def moved(matrix, by):
    matrix = matrix.clone()
    matrix[:3, 3] += by
    return matrix
