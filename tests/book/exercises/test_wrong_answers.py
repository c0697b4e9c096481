"""Wrong answers of every kind for every checker: none is accepted, and each ends in one line that begins with ✗."""

import copy
import sys

import numpy as np
import pytest
import torch

from exercise_answers import merged_pair
from meshot_book.exercises import check


class Unreadable(Exception):
    """An exception without words."""


def raise_error(*_):
    raise Unreadable


def interrupt(*_):
    sys.exit()


#: Answers that are right nowhere, whatever is asked.
NEVER_RIGHT = {
    "None": lambda *_: None,
    "an exception": raise_error,
    "an exit": interrupt,
    "a division by zero": lambda *_: 1 / 0,
    "text": lambda *_: "0.5",
    "a dictionary": lambda *_: {"answer": 1.0},
    "a generator": lambda *_: (x for x in (1.0, 2.0)),
    "an object": lambda *_: object(),
    "a function": lambda *_: len,
    "a ragged list": lambda *_: [[1.0], [2.0, 3.0]],
    "an integer beyond all sizes": lambda *_: 10**400,
    "an array of objects": lambda *_: np.array([None, 1.0], dtype=object),
    "not a number": lambda *_: float("nan"),
    "infinity": lambda *_: float("inf"),
    "a complex number": lambda *_: 1j,
    "a constant": lambda *_: 0.123456,
    "zero": lambda *_: 0.0,
    "minus zero": lambda *_: -0.0,
    "True": lambda *_: True,
    "an empty tensor": lambda *_: torch.zeros(0),
    "the first argument": lambda *given: given[0],
    "no arguments taken": lambda: 1.0,
}


def right_ghost_pair(directions):
    """Each direction doubles the points: both sets are shifted across it, and the copies swapped."""
    first, second = torch.zeros(1, 2).double(), torch.zeros(0, 2).double()
    for x, y in directions.tolist():
        across = torch.tensor([-y, x]).double()
        first, second = torch.cat([first, second + across]), torch.cat([second, first + across])
    return first, second


#: Exercises with many right answers: their checkers compare properties and not values.
BY_PROPERTY = {"trap": merged_pair, "ghost_pair": right_ghost_pair}


def spoil(change):
    """The right answer, with every tensor in it changed."""

    def spoiled(right):
        def function(*given):
            answer = right(*given)
            pair = isinstance(answer, tuple) and any(isinstance(part, torch.Tensor) and part.ndim for part in answer)
            return tuple(change(as_tensor(x)) for x in answer) if pair else change(as_tensor(answer))

        return function

    return spoiled


def as_tensor(values):
    return torch.as_tensor(values).double()


def last_not_a_number(values):
    values = values.clone()
    values.view(-1)[-1:] = torch.nan
    return values


#: From the right function to a wrong one.
SPOILED = {
    "the right numbers as complex numbers": spoil(lambda values: values + 0j),
    "a small imaginary part": spoil(lambda values: values + 1e-9j),
    "one number that is none": spoil(last_not_a_number),
    "one axis too many": spoil(lambda values: values[None, ..., None]),
    "twice the right answer, end to end": spoil(lambda values: torch.cat([values.reshape(-1)] * 2)),
    "the right numbers as text": spoil(lambda values: str(values.tolist())),
}


def caught(monkeypatch, name):
    """The right function of a checker and its cases, taken from its own call."""
    module, found = sys.modules[getattr(check, name).__module__], {}

    def keep(function, truth, cases, mistakes, title):
        found.update(right=truth, cases=cases)

    with monkeypatch.context() as patch:
        patch.setattr(module, "check_answer", keep)
        getattr(check, name)(raise_error)
    return BY_PROPERTY.get(name, found["right"]), found["cases"]


def said(capsys, name, function):
    getattr(check, name)(function)
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == 1
    return out


checkers = pytest.mark.parametrize("name", check.__all__)


@checkers
def test_the_right_function_is_accepted(capsys, monkeypatch, name):
    right, _ = caught(monkeypatch, name)
    assert said(capsys, name, right).startswith("✓")


@checkers
@pytest.mark.parametrize("wrong", NEVER_RIGHT)
def test_what_is_right_nowhere_is_refused(capsys, name, wrong):
    assert said(capsys, name, NEVER_RIGHT[wrong]).startswith(f"✗ {name}: ")


@checkers
@pytest.mark.parametrize("kind", SPOILED)
def test_a_spoiled_right_answer_is_refused(capsys, monkeypatch, name, kind):
    right, _ = caught(monkeypatch, name)
    assert said(capsys, name, SPOILED[kind](right)).startswith(f"✗ {name}: ")


@checkers
def test_the_right_answer_cut_to_whole_numbers_is_refused(capsys, monkeypatch, name):
    right, cases = caught(monkeypatch, name)
    cut = spoil(lambda values: values.long())(right)
    fractions = [as_tensor(right(*case.arguments)) for case in cases] if name not in BY_PROPERTY else [as_tensor(0.5)]
    if any(bool((values != values.trunc()).any()) for values in fractions):
        assert said(capsys, name, cut).startswith(f"✗ {name}: ")


def spoil_argument(value):
    """Change a value in place; whether it could be changed."""
    if isinstance(value, torch.Tensor) and value.numel():
        value.view(-1)[0] = value.view(-1)[0].logical_not() if value.dtype == torch.bool else value.view(-1)[0] + 1
    elif isinstance(value, np.ndarray) and value.size:
        value.reshape(-1)[0] += 1
    elif isinstance(value, list):
        value.append(value[0] if value else 0.0)
    elif isinstance(value, dict):
        value["more"] = 1.0
    else:
        return False
    return True


@checkers
def test_the_right_answer_with_changed_arguments_is_refused(capsys, monkeypatch, name):
    right, cases = caught(monkeypatch, name)
    positions = [k for k, value in enumerate(cases[0].arguments) if spoil_argument(copy.deepcopy(value))]
    for position in positions:

        def meddling(*given, position=position):
            answer = copy.deepcopy(right(*given))
            spoil_argument(given[position])
            return answer

        line = said(capsys, name, meddling)
        assert line.startswith(f"✗ {name}: ")
        assert "changes its arguments" in line


def test_a_zero_whose_sign_is_turned_counts_as_changed(capsys, monkeypatch):
    right, _ = caught(monkeypatch, "line_arrows")

    def meddling(points, target, direction):
        answer = right(points, target, direction)
        direction[direction == 0] = -0.0
        return answer

    assert "changes its arguments" in said(capsys, "line_arrows", meddling)


@pytest.mark.parametrize(
    ("name", "wrong", "hint"),
    [
        ("without_floor", lambda value, floor: (value**2 - floor**2) ** 0.5, "complex numbers"),
        ("tent_density", lambda corners, x: tent_with_division(corners, x), "division by zero"),
        ("scale_for_share", lambda loss, share: halved(loss, share, 0.0, 100.0), "scales may have any size"),
    ],
)
def test_three_near_misses_are_refused_with_their_reason(capsys, name, wrong, hint):
    line = said(capsys, name, wrong)
    assert line.startswith("✗")
    assert hint in line


def tent_with_division(corners, x):
    """The tent without a thought for a side that is upright."""
    low, middle, high = corners.sort().values
    heights = torch.minimum((x - low) / (middle - low), (high - x) / (high - middle)) * 2 / (high - low)
    return torch.where((x >= low) & (x <= high), heights, torch.zeros_like(heights))


def halved(loss, share, low, high):
    """Halve a fixed interval."""
    for _ in range(100):
        middle = (low + high) / 2
        low, high = (middle, high) if 1 - loss(0) / loss(middle) < share else (low, middle)
    return high
