"""One line on what a reader's function does: right, or wrong with a hint that fits the mistake.

A checker tries the function on cases with known answers. Where it fails, its answers are compared with those of the
usual mistakes: the one that agrees on every case gives the hint. A checker never raises, never draws from global
randomness, hides what the function prints, and says the same thing every time.
"""

import contextlib
import copy
import dataclasses
import io
import warnings
from collections.abc import Callable, Sequence

import numpy as np
import torch

from meshot.types import Tensor

TOLERANCE = 1e-6
UNWRITTEN = "nothing is written yet; replace `raise NotImplementedError`"


@dataclasses.dataclass(frozen=True, eq=False)
class Case:
    """Arguments to try, and in words what is special about them.

    Parameters
    ----------
    name : str
        Ends the sentence "wrong on …".
    arguments : tuple
        Handed over as copies.
    """

    name: str
    arguments: tuple


@dataclasses.dataclass(frozen=True, eq=False)
class Mistake:
    """A function that many write first, and what to tell them.

    Parameters
    ----------
    function : callable
        Takes the arguments of a case.
    hint : str
        A sentence that leads on without giving the answer away.
    """

    function: Callable
    hint: str


def check_answer(
    function: object, truth: Callable, cases: Sequence[Case], mistakes: Sequence[Mistake], name: str
) -> None:
    """Print one line that begins with ✓ or ✗."""
    complaint = _complaint(function, truth, cases, mistakes)
    print(f"✓ {name}: right on all {len(cases)} cases" if complaint is None else f"✗ {name}: {complaint}")


def _complaint(function: object, truth: Callable, cases: Sequence[Case], mistakes: Sequence[Mistake]) -> str | None:
    if not callable(function):
        return f"a function is needed, but a {type(function).__name__} came; hand over the function without calling it"
    answers, trouble = [], None
    for case in cases:
        answer, trouble = _try(function, case)
        if trouble is None:
            trouble = _wrong_form(answer, truth(*case.arguments))
        if trouble is not None:
            trouble = trouble if trouble == UNWRITTEN else f"{trouble} (on {case.name})"
            break
        answers.append(_as_tensor(answer))
    tried = list(zip(cases, answers))
    wrong = [case for case, answer in tried if not _close(answer, truth, case)]
    if not wrong:
        return trouble
    for mistake in mistakes:
        if all(_close(answer, mistake.function, case) for case, answer in tried):
            return mistake.hint
    return (
        trouble
        or f"wrong on {len(wrong)} of {len(cases)} cases, the first is {wrong[0].name}; compute that case by hand"
    )


def _try(function: Callable, case: Case) -> tuple[object, str | None]:
    """The answer, or why there is none."""
    given = copy.deepcopy(case.arguments)
    silent = io.StringIO()
    try:
        with warnings.catch_warnings(), contextlib.redirect_stdout(silent), contextlib.redirect_stderr(silent):
            warnings.simplefilter("ignore")
            answer = function(*given)
    except NotImplementedError:
        return None, UNWRITTEN
    except (Exception, SystemExit) as error:
        said = str(error).strip().splitlines()
        return None, f"it raised {type(error).__name__}{': ' + said[0][:100] if said else ''}"
    if any(not _same(before, after) for before, after in zip(case.arguments, given)):
        return None, "it changes its arguments; work on copies (no item assignment, no functions that end in _)"
    return answer, None


def _same(before: object, after: object) -> bool:
    """Whether a copy is still what was handed over; +0 and −0 differ, and NaN equals itself."""
    if type(before) is not type(after):
        return False
    if isinstance(before, np.ndarray):
        return before.dtype == after.dtype and _same(torch.from_numpy(before), torch.from_numpy(after))
    if isinstance(before, torch.Tensor):
        if before.shape != after.shape or before.dtype != after.dtype:
            return False
        signs = torch.equal(before.signbit(), after.signbit())
        return signs and torch.allclose(before.double(), after.double(), rtol=0, atol=0, equal_nan=True)
    if isinstance(before, list | tuple):
        return len(before) == len(after) and all(map(_same, before, after))
    if isinstance(before, dict):
        return before.keys() == after.keys() and all(_same(before[key], after[key]) for key in before)
    return before == after


def _wrong_form(answer: object, right: object) -> str | None:
    if answer is None:
        return "it returns None; end it with a return statement"
    try:
        if torch.as_tensor(answer).is_complex():
            return "it returns complex numbers, but real ones are needed; look for the root of a negative number"
        tensor = _as_tensor(answer)
    except (TypeError, ValueError, RuntimeError, OverflowError):
        return f"it returns a {type(answer).__name__}, which cannot be read as numbers"
    wanted = _as_tensor(right)
    if tensor.shape != wanted.shape:
        return f"it returns shape {tuple(tensor.shape)}, but {tuple(wanted.shape)} is needed"
    if not bool(torch.isfinite(tensor).all()):
        return "it returns numbers that are infinite or not a number; look for a division by zero"
    return None


def as_points(values: object) -> Tensor:
    """Coordinates that a reader returned, as float64."""
    points = torch.as_tensor(values).detach()
    if points.is_complex():
        raise ValueError("complex numbers came, real coordinates are needed; look for the root of a negative number")
    if not bool(torch.isfinite(points).all()):
        raise ValueError("coordinates came that are infinite or not a number; look for a division by zero")
    return points.double()


def _as_tensor(values: object) -> Tensor:
    return torch.as_tensor(values).detach().double()


def _close(answer: Tensor, function: Callable, case: Case) -> bool:
    """Whether the answer is that of a function of ours, which may not be able to take the case at all."""
    try:
        wanted = _as_tensor(function(*case.arguments))
    except (RuntimeError, IndexError, ZeroDivisionError):
        return False
    if wanted.shape != answer.shape:
        return False
    return bool(torch.allclose(answer, wanted, rtol=TOLERANCE, atol=TOLERANCE))
