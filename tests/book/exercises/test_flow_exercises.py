"""The exercises of chapter 20: truths from elsewhere, and a different hint for each usual mistake."""

import math

import pytest
import torch
from scipy.optimize import fsolve

from meshot.flow.integration import integrate
from meshot_book.exercises import check


def library_flow(velocity, points, n_steps):
    return integrate(lambda t, x: velocity(float(t), x), points, n_steps)


def solved_step(velocity, images, step):
    """By another library's root finder."""

    def residual(flat):
        x = torch.from_numpy(flat.reshape(images.shape))
        return (x + step * velocity(x) - images).numpy().ravel()

    return torch.from_numpy(fsolve(residual, images.numpy().ravel(), xtol=1e-13).reshape(images.shape))


def counted_pieces(length, bend, gap):
    """By trying: the chord of an arc y = bend x² / 2 of each length."""
    n = 1
    while bend / 2 * (length / n / 2) ** 2 > gap:
        n += 1
    return n


def forward(v, x, n, shift=0.0, length=None, sign=1, taken=None):
    for k in range(n if taken is None else taken):
        x = x + sign * (length or 1 / n) * v(k / n + shift, x)
    return x


def iterated(v, y, h, n, sign=-1):
    x = y
    for _ in range(n):
        x = y + sign * h * v(x)
    return x


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.euler_flow, library_flow),
        (check.undo_step, solved_step),
        (check.pieces_needed, counted_pieces),
        (check.pieces_needed, lambda s, c, g: max(1, math.ceil(s * math.sqrt(c / (8 * g))))),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


FLOW = {
    "the time does not advance": lambda v, x, n: forward(lambda t, y: v(0, y), x, n),
    "at its end": lambda v, x, n: forward(v, x, n, shift=1 / n),
    "use the current positions": lambda v, x, n: x + sum(v(k / n, x) / n for k in range(n)),
    "they are 1 / n long": lambda v, x, n: forward(v, x, n, length=1.0),
    "one step is missing": lambda v, x, n: forward(v, x, n, taken=n - 1),
    "one step too many": lambda v, x, n: forward(v, x, n, taken=n + 1),
    "whatever n_steps says": lambda v, x, n: x + v(0, x),
    "against the velocity": lambda v, x, n: forward(v, x, n, sign=-1),
}
UNDO = {
    "at the image": lambda v, y, h: y - h * v(y),
    "the iteration is right": lambda v, y, h: iterated(v, y, h, 2),
    "one more step forward": lambda v, y, h: y + h * v(y),
    "the sign": lambda v, y, h: iterated(v, y, h, 900, 1),
    "images themselves": lambda v, y, h: y,
}
PIECES = {
    "a chord is farthest from its arc in the middle of the arc": lambda s, c, g: math.ceil(s * math.sqrt(c / (2 * g))),
    "factor 1/8": lambda s, c, g: math.ceil(s * math.sqrt(c / g)),
    "square of the number": lambda s, c, g: math.ceil(s**2 * c / (8 * g)),
    "rounded down": lambda s, c, g: int(s * math.sqrt(c / (8 * g))),
    "round it up": lambda s, c, g: s * math.sqrt(c / (8 * g)),
    "length and curvature are exchanged": lambda s, c, g: math.ceil(c * math.sqrt(s / (8 * g))),
}


@pytest.mark.parametrize(
    ("checker", "words", "function"),
    [
        (getattr(check, name), words, function)
        for name, mistakes in (("euler_flow", FLOW), ("undo_step", UNDO), ("pieces_needed", PIECES))
        for words, function in mistakes.items()
    ],
)
def test_each_mistake_has_its_hint(hinted, checker, words, function):
    hinted(checker, function, words)
