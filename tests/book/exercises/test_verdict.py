"""The checker framework: right answers pass, every kind of wrong one gets its own words, nothing escapes."""

import sys
import warnings

import pytest
import torch

from meshot_book.exercises.verdict import Exercise, exercise

CASES = {"two": (torch.tensor([1.0, 2.0]),), "three": (torch.tensor([3.0, -1.0, 0.5]),)}
MISTAKES = {"mind the sign": lambda x: -2 * x, "too short a look": (lambda x: x[:1], lambda x: x[:2])}


@exercise(stars=2)
def double():
    """Twice a vector."""
    return Exercise(lambda x: 2 * x, CASES, MISTAKES)


def said(capsys, function):
    double(function)
    out, err = capsys.readouterr()
    assert err == ""
    assert out.count("\n") == 1
    return out.strip()


def chatty(x):
    print("thinking")
    warnings.warn("hm", stacklevel=1)
    print("oh", file=sys.stderr)
    return 2 * x


def stub(x):
    raise NotImplementedError


def deep(x):
    return deep(x)


@pytest.mark.parametrize("function", [lambda x: 2 * x, lambda x: (2 * x).numpy(), lambda x: (2 * x).tolist(), chatty])
def test_right(capsys, function):
    assert said(capsys, function) == "✓ double: right on all 2 cases"


@pytest.mark.parametrize(
    ("function", "words"),
    [
        (stub, "nothing is written yet"),
        (lambda x: None, "returns None"),
        (lambda x: "two", "cannot be read as numbers"),
        (lambda x: {"a": 1}, "cannot be read as numbers"),
        (lambda x: x.sum(), "returns shape (), but (2,) is needed (on two)"),
        (lambda x: x / 0, "division by zero"),
        (lambda x: 2 * x + 0j, "returns complex numbers"),
        (lambda x: [complex(2 * each) for each in x], "returns complex numbers"),
        (lambda x: 1 / 0, "raised ZeroDivisionError: division by zero"),
        (lambda: 1, "raised TypeError"),
        (lambda x: sys.exit(3), "raised SystemExit: 3"),
        (deep, "raised RecursionError"),
        (lambda x: x.mul_(2), "changes its arguments"),
        (lambda x: -2 * x, "mind the sign"),
        (lambda x: x[:2], "too short a look"),
        (lambda x: 2 * x if len(x) == 2 else 3 * x, "wrong on 1 of 2 cases. On three at number 1 it gives 9"),
        (lambda x: x * 0, "wrong on 2 of 2 cases. On two at number "),
        (3, "a function is needed, but a int came"),
    ],
)
def test_wrong(capsys, function, words):
    line = said(capsys, function)
    assert line.startswith("✗ double: ")
    assert words in line


def test_a_mistake_is_named_although_a_later_case_breaks(capsys):
    assert "mind the sign" in said(capsys, lambda x: -2 * x if len(x) == 2 else None)


def test_the_right_answer_on_some_cases_is_no_mistake(capsys):
    assert "returns None" in said(capsys, lambda x: 2 * x if len(x) == 2 else None)


def test_arguments_survive(capsys):
    before = [given[0].clone() for given in CASES.values()]
    said(capsys, lambda x: x.zero_())
    assert all(torch.equal(given[0], kept) for given, kept in zip(CASES.values(), before))


def test_a_checker_has_the_name_and_the_words_of_its_exercise():
    assert (double.__name__, double.__doc__) == ("double", "Twice a vector.")


def test_of_many_right_answers_properties_are_compared(capsys):
    found = Exercise(
        lambda n: [1, n - 1], {"seven": (7,)}, {"a third": lambda n: [1, 1, 5]}, lambda x, n: [sum(x), len(x)]
    )
    assert found.complaint(lambda n: [3, 4]) is None
    assert found.complaint(lambda n: [2, 2, 3]) == "a third"
    assert "returns None" in found.complaint(lambda n: None)
