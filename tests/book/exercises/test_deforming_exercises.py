"""The exercises of chapter 21: truths from elsewhere, and a different hint for each usual mistake."""

import math

import numpy as np
import pytest
import torch

from meshot.flow.crossings import steps_below
from meshot.mesh.mesh import Mesh
from meshot.metrics.evaluation import edge_length_variation
from meshot_book.exercises import check

CHECKERS = (check.edge_variation, check.safe_steps, check.equal_time)


def by_sets(vertices, faces):
    """With Python's sets, one edge after another."""
    edges = {frozenset(pair) for a, b, c in faces.tolist() for pair in ((a, b), (b, c), (c, a))}
    lengths = [math.dist(*(vertices[i].tolist() for i in edge)) for edge in edges]
    return np.std(lengths) / np.mean(lengths)


def by_counting(norms):
    n = 1
    while float(norms.max()) / n >= 1:
        n += 1
    return n


def by_numpy(times, values, other_times, other_values):
    moment = min(float(times[-1]), float(other_times[-1]))
    return [np.interp(moment, times, values), np.interp(moment, other_times, other_values)]


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.edge_variation, by_sets),
        (check.edge_variation, lambda v, f: edge_length_variation(Mesh(v, f))),
        (check.safe_steps, by_counting),
        (check.safe_steps, lambda norms: steps_below(float(norms.max()))),
        (check.equal_time, by_numpy),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def side_lengths(v, f):
    return (v[f] - v[f.roll(1, 1)]).norm(dim=2).flatten()


def edge_lengths(v, f):
    edges = {tuple(sorted(pair)) for a, b, c in f.tolist() for pair in ((a, b), (b, c), (c, a))}
    return torch.stack([(v[a] - v[b]).norm() for a, b in sorted(edges)])


EDGES = {
    "edges between two faces are counted twice": lambda v, f: (
        side_lengths(v, f).std(unbiased=False) / side_lengths(v, f).mean()
    ),
    "divide by the number of edges n": lambda v, f: edge_lengths(v, f).std() / edge_lengths(v, f).mean(),
    "divide by the mean": lambda v, f: edge_lengths(v, f).std(unbiased=False),
    "root of the variance": lambda v, f: edge_lengths(v, f).var(unbiased=False) / edge_lengths(v, f).mean() ** 2,
    "these are the squared lengths": lambda v, f: by_squares(edge_lengths(v, f)),
}


def by_squares(lengths):
    return (lengths**2).std(unbiased=False) / (lengths**2).mean()


STEPS = {
    "this uses the average of the constants": lambda norms: int(norms.mean()) + 1,
    "this uses the first time only": lambda norms: int(norms[0].max()) + 1,
    "strict": lambda norms: max(1, math.ceil(float(norms.max()))),
    "one too few": lambda norms: int(norms.max()),
    "whole": lambda norms: float(norms.max()) + 1,
    "per unit of time already": lambda norms: int(norms.max() * norms.shape[0]) + 1,
    "this divides by the number of measured steps": lambda norms: int(norms.max() / norms.shape[0]) + 1,
}


def at(moment, t, x, s, y):
    return [np.interp(float(moment), t, x), np.interp(float(moment), s, y)]


TIME = {
    "equal steps": lambda t, x, s, y: [x[-1], y[-1]],
    "this compares at equal numbers of checks": lambda t, x, s, y: [
        x[min(len(x), len(y)) - 1],
        y[min(len(x), len(y)) - 1],
    ],
    "interpolate linearly": lambda t, x, s, y: [
        x[t <= min(t[-1], s[-1])][-1],
        y[s <= min(t[-1], s[-1])][-1],
    ],
    "compare at the time at which the shorter run ends": lambda t, x, s, y: at((t[-1] + s[-1]) / 2, t, x, s, y),
    "the two values are exchanged": lambda t, x, s, y: by_numpy(t, x, s, y)[::-1],
    "least value": lambda t, x, s, y: [x.min(), y.min()],
}


@pytest.mark.parametrize(
    ("checker", "words", "function"),
    [
        (checker, words, function)
        for checker, mistakes in zip(CHECKERS, (EDGES, STEPS, TIME), strict=True)
        for words, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, words, function):
    hinted(checker, function, words)
