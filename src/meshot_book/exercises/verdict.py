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
from collections.abc import Callable

import numpy as np
import torch

from meshot.types import Tensor

TOLERANCE = 1e-6
UNWRITTEN = "nothing is written yet; replace `raise NotImplementedError`"


@dataclasses.dataclass(frozen=True, eq=False)
class Exercise:
    """What is right, where an answer is tried, and what many write first.

    Parameters
    ----------
    truth : callable
        The solution.
    cases : dict of tuples
        In words what is special about a case (it ends the sentence "wrong on …") -> arguments, handed over as copies.
    mistakes : dict of callables, or of tuples of them
        A hint that leads on without giving the answer away -> the function that gets it, or several ways to write it.
    properties : callable, optional
        ``properties(answer, *arguments)``: what is compared, where many answers are right.
    way : callable, optional
        ``way(*arguments)``, asked after each case: what is wrong with how a right answer was found, or None.
    """

    truth: Callable
    cases: dict[str, tuple]
    mistakes: dict[str, Callable | tuple[Callable, ...]]
    properties: Callable | None = None
    way: Callable | None = None

    def complaint(self, function: object) -> str | None:
        """What to tell the author of a function; None if it is right."""
        if not callable(function):
            came = type(function).__name__
            return f"a function is needed, but a {came} came; hand over the function without calling it"
        tried, trouble, astray = [], None, None
        for name, arguments in self.cases.items():
            answer, trouble = _try(self._compared(function), arguments)
            astray = self.way(*arguments) or astray if self.way else None
            right = _as_tensor(self._compared(self.truth)(*arguments))
            trouble = trouble or _wrong_form(answer, right)
            if trouble is not None:
                trouble = trouble if trouble == UNWRITTEN else f"{trouble} (on {name})"
                break
            tried.append((arguments, _as_tensor(answer), name, right))
        wrong = [name for _, answer, name, right in tried if not _close(answer, right)]
        if not wrong:
            return trouble or astray
        for hint, functions in self.mistakes.items():
            for mistake in functions if isinstance(functions, tuple) else (functions,):
                if self._agrees(mistake, tried):
                    return hint
        if trouble:
            return trouble
        # The smallest answer that is wrong is the one that is checked by hand.
        _, answer, name, right = min(
            (each for each in tried if not _close(each[1], each[3])), key=lambda each: each[3].numel()
        )
        said = f"wrong on {len(wrong)} of {len(self.cases)} cases"
        if self.properties is not None:
            return f"{said}, the first is {wrong[0]}; compute that case by hand"
        place = int((answer - right).abs().flatten().argmax())
        which = f" at number {place + 1}" if right.numel() > 1 else ""
        came, needed = (f"{float(values.flatten()[place]):.6g}" for values in (answer, right))
        return f"{said}. On {name}{which} it gives {came}, and {needed} is right; compute that case by hand"

    def _compared(self, function: Callable) -> Callable:
        if self.properties is None:
            return function

        def compared(*arguments: object) -> object:
            answer = function(*arguments)
            return None if answer is None else self.properties(answer, *arguments)

        return compared

    def _agrees(self, mistake: Callable, tried: list[tuple]) -> bool:
        """Whether a mistake gives all these answers; it may not be able to take a case at all."""
        try:
            return all(_close(answer, _as_tensor(self._compared(mistake)(*given))) for given, answer, *_ in tried)
        except (RuntimeError, IndexError, ZeroDivisionError):
            return False


def exercise(build: Callable[[], Exercise]) -> Callable[[object], None]:
    """Turn what builds an exercise into its checker: a function with the same name that prints one line, ✓ or ✗."""

    def check(function: object) -> None:
        found = build()
        complaint = found.complaint(function)
        print(f"✓ {name}: right on all {len(found.cases)} cases" if complaint is None else f"✗ {name}: {complaint}")

    name = check.__name__ = check.__qualname__ = build.__name__
    check.__doc__, check.__module__, check.exercise = build.__doc__, build.__module__, build
    return check


def _try(function: Callable, arguments: tuple) -> tuple[object, str | None]:
    """The answer, or why there is none."""
    given = copy.deepcopy(arguments)
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
    if any(not _same(before, after) for before, after in zip(arguments, given)):
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


def _wrong_form(answer: object, right: Tensor) -> str | None:
    if answer is None:
        return "it returns None; end it with a return statement"
    try:
        if torch.as_tensor(answer).is_complex():
            return "it returns complex numbers, but real ones are needed; look for the root of a negative number"
        tensor = _as_tensor(answer)
    except (TypeError, ValueError, RuntimeError, OverflowError):
        return f"it returns a {type(answer).__name__}, which cannot be read as numbers"
    if tensor.shape != right.shape:
        return f"it returns shape {tuple(tensor.shape)}, but {tuple(right.shape)} is needed"
    if not bool(torch.isfinite(tensor).all()):
        return "it returns numbers that are infinite or not a number; look for a division by zero"
    return None


def _as_tensor(values: object) -> Tensor:
    return torch.as_tensor(values).detach().double()


def _close(answer: Tensor, wanted: Tensor) -> bool:
    return wanted.shape == answer.shape and torch.allclose(answer, wanted, rtol=TOLERANCE, atol=TOLERANCE)
