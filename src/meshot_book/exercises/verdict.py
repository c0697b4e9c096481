"""One line on what a reader's function does: right, or wrong with a hint that fits the mistake.

A checker tries the function on cases with known answers. Where it fails, its answers are compared with those of the
usual mistakes: the one that agrees on every case gives the hint. A checker never raises, never draws from global
randomness, hides what the function prints, and says the same thing every time. It returns a :class:`Record`.
"""

import contextlib
import copy
import dataclasses
import io
import itertools
import warnings
from collections.abc import Callable, Iterable, Iterator

import numpy as np
import torch

from meshot.types import Tensor

TOLERANCE = 1e-6
UNWRITTEN = "nothing is written yet; replace `raise NotImplementedError`"


#: The last record of each exercise in this process, by name.
RECORDS: dict[str, "Record"] = {}


@dataclasses.dataclass(frozen=True)
class Record:
    """What a checker found. It is right, and has all points, or it is not: a constant passes some cases of many.

    Parameters
    ----------
    exercise : str
    cases, passed : int
        How many cases the exercise has, and on how many of them the answer is right.
    points, of : int
        What the answer is worth, and what a right one is: a point for each star of the exercise.
    hint : str
        What to tell the author; empty if the answer is right.
    """

    exercise: str
    cases: int
    passed: int
    points: int
    of: int
    hint: str

    def _ipython_display_(self) -> None:
        """Nothing: the checker has printed its line."""


@dataclasses.dataclass(frozen=True, eq=False)
class AnswerKey:
    """The answers that are right, and those of the usual mistakes, without the functions that give them.

    Parameters
    ----------
    cases : dict of tuples
        As in :class:`Exercise`.
    right : list of tensors
        What is compared, a case.
    wrong : iterable of pairs
        A hint -> the answers of one function that deserves it, up to the first case that it cannot take.
    properties, way : callable, optional
        As in :class:`Exercise`.
    """

    cases: dict[str, tuple]
    right: list[Tensor]
    wrong: Iterable[tuple[str, Iterable[Tensor]]]
    properties: Callable | None = None
    way: Callable | None = None

    def judged(self, function: object) -> tuple[int, str | None]:
        """On how many cases a function is right, and what to tell its author; None if nothing is wrong."""
        if not callable(function):
            came = type(function).__name__
            return 0, f"a function is needed, but a {came} came; hand over the function without calling it"
        n_right, tried, trouble, astray = 0, [], None, None
        for (name, arguments), right in zip(self.cases.items(), self.right):
            given = copy.deepcopy(arguments)
            answer, own = _try(_compared(function, self.properties), arguments, given)
            strayed = self.way(*given) if self.way else None
            own = own or _wrong_form(answer, right)
            n_right += own is None and strayed is None and _close(_as_tensor(answer), right)
            astray = strayed or astray
            if own is not None and trouble is None:
                trouble = own if own == UNWRITTEN else f"{own} (on {name})"
            if trouble is None:
                tried.append((_as_tensor(answer), right, name))
        wrong = [each for each in tried if not _close(*each[:2])]
        if not wrong:
            return n_right, trouble or astray
        for hint, answers in self.wrong:
            # Fewer answers than cases: the mistake could not take one of them.
            if all(
                _close(mine, its) for (mine, *_), its in zip(tried, itertools.chain(answers, itertools.repeat(None)))
            ):
                return n_right, hint
        if trouble:
            return n_right, trouble
        said = f"wrong on {len(wrong)} of {len(self.cases)} cases"
        if self.properties is not None:
            return n_right, f"{said}, the first is {wrong[0][2]}; compute that case by hand"
        # The smallest answer that is wrong is the one that is checked by hand.
        answer, right, name = min(wrong, key=lambda each: each[1].numel())
        place = int((answer - right).abs().flatten().argmax())
        which = f" at number {place + 1}" if right.numel() > 1 else ""
        came, needed = (f"{float(values.flatten()[place]):.6g}" for values in (answer, right))
        return n_right, f"{said}. On {name}{which} it gives {came}, and {needed} is right; compute that case by hand"


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

    def key(self) -> AnswerKey:
        """The answers. Those of the mistakes are computed when they are asked for."""
        right = [_as_tensor(_compared(self.truth, self.properties)(*copy.deepcopy(a))) for a in self.cases.values()]
        wrong = (
            (hint, self._answers(mistake))
            for hint, functions in self.mistakes.items()
            for mistake in (functions if isinstance(functions, tuple) else (functions,))
        )
        return AnswerKey(self.cases, right, wrong, self.properties, self.way)

    def _answers(self, mistake: Callable) -> Iterator[Tensor]:
        for arguments in self.cases.values():
            try:
                yield _as_tensor(_compared(mistake, self.properties)(*copy.deepcopy(arguments)))
            except (RuntimeError, IndexError, ZeroDivisionError):
                return  # it may not be able to take a case at all

    def complaint(self, function: object) -> str | None:
        """What to tell the author of a function; None if it is right."""
        return self.key().judged(function)[1]


def exercise(stars: int) -> Callable[[Callable[[], Exercise]], Callable[[object], Record]]:
    """Turn what builds an exercise of so many stars into its checker, a function with the same name."""

    def decorate(build: Callable[[], Exercise]) -> Callable[[object], Record]:
        check = checker(build.__name__, build.__doc__, stars, lambda: build().key())
        check.__module__, check.exercise = build.__module__, build
        return check

    return decorate


def checker(name: str, words: str | None, stars: int, key: Callable[[], AnswerKey]) -> Callable[[object], Record]:
    """Make what prints one line on a function, ✓ or ✗, and returns a record."""

    def check(function: object) -> Record:
        answers = key()
        n_cases, (n_right, hint) = len(answers.cases), answers.judged(function)
        print(f"✓ {name}: right on all {n_cases} cases" if hint is None else f"✗ {name}: {hint}")
        RECORDS[name] = Record(name, n_cases, n_right, 0 if hint else stars, stars, hint or "")
        return RECORDS[name]

    check.__name__ = check.__qualname__ = name
    check.__doc__, check.stars = words, stars
    return check


def _compared(function: Callable, properties: Callable | None) -> Callable:
    if properties is None:
        return function

    def compared(*arguments: object) -> object:
        answer = function(*arguments)
        return None if answer is None else properties(answer, *arguments)

    return compared


def _try(function: Callable, arguments: tuple, given: tuple) -> tuple[object, str | None]:
    """The answer on a copy of the arguments, or why there is none."""
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


def _close(answer: Tensor, wanted: Tensor | None) -> bool:
    return (
        wanted is not None
        and wanted.shape == answer.shape
        and torch.allclose(answer, wanted, rtol=TOLERANCE, atol=TOLERANCE)
    )
