"""Every exercise: the solution passes, each usual mistake gets its own hint, and nothing wrong is accepted."""

import copy
import math
import re
import sys

import numpy as np
import pytest
import torch

from meshot_book.exercises.check import EXERCISES
from meshot_book.statistics import people_needed


class Unreadable(Exception):
    """An exception without words."""


def raise_error(*_):
    raise Unreadable


def interrupt(*_):
    sys.exit()


def stub(*_):
    raise NotImplementedError


#: Answers that are right nowhere, whatever is asked.
NEVER_RIGHT = {
    "a stub": stub,
    "no function": 3,
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


@pytest.fixture
def said(capsys):
    """What a checker says."""

    def ask(name, function):
        EXERCISES[name](function)
        out, err = capsys.readouterr()
        assert err == ""
        return out

    return ask


exercises = pytest.mark.parametrize("name", EXERCISES)


def test_the_chapters_ask_all_exercises_and_no_others(root):
    sources = "".join(path.read_text(encoding="utf-8") for path in (root / "notebooks").glob("[0-9]*.md"))
    assert set(re.findall(r"^check\.(\w+)\(", sources, re.M)) == set(EXERCISES)


def test_an_exercise_has_the_stars_of_its_heading(root):
    text = "".join(path.read_text(encoding="utf-8") for path in (root / "notebooks").glob("[0-9]*.md"))
    parts = [part for part in re.split(r"^### ", text, flags=re.M) if "\ncheck." in part]
    found = {re.search(r"^check\.(\w+)", part, re.M)[1]: len(re.search("★+", part)[0]) for part in parts}
    assert found == {name: checker.stars for name, checker in EXERCISES.items()}


@exercises
def test_the_solution_passes(said, name):
    found = EXERCISES[name].exercise()
    assert said(name, found.truth) == f"✓ {name}: right on all {len(found.cases)} cases\n"


@exercises
def test_each_mistake_gets_its_own_hint(said, name):
    for hint, functions in EXERCISES[name].exercise().mistakes.items():
        for mistake in functions if isinstance(functions, tuple) else (functions,):
            assert said(name, mistake) == f"✗ {name}: {hint}\n"


@exercises
def test_what_is_right_nowhere_is_refused(name):
    found = EXERCISES[name].exercise()
    answers = [as_tensor(found.truth(*given)) for given in found.cases.values()] if not found.properties else []
    wrong = NEVER_RIGHT | {kind: spoiled(found.truth) for kind, spoiled in SPOILED.items()}
    if found.properties or any(bool((values != values.trunc()).any()) for values in answers):
        wrong["the right answer cut to whole numbers"] = spoil(lambda values: values.long())(found.truth)
    assert [kind for kind, function in wrong.items() if found.complaint(function) is None] == []


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


@exercises
def test_the_right_answer_with_changed_arguments_is_refused(name):
    found = EXERCISES[name].exercise()
    first = next(iter(found.cases.values()))
    for position in (k for k, value in enumerate(first) if spoil_argument(copy.deepcopy(value))):

        def meddling(*given, position=position):
            answer = copy.deepcopy(found.truth(*given))
            spoil_argument(given[position])
            return answer

        assert "changes its arguments" in found.complaint(meddling)


def test_a_zero_whose_sign_is_turned_counts_as_changed(said):
    def meddling(points, target, direction):
        answer = EXERCISES["line_arrows"].exercise().truth(points, target, direction)
        direction[direction == 0] = -0.0
        return answer

    assert "changes its arguments" in said("line_arrows", meddling)


def divided_tent(corners, x):
    """The tent without a thought for an upright side. It is wrong at the jump alone, where nothing is defined."""
    low, middle, high = corners.sort().values
    heights = torch.minimum((x - low) / (middle - low), (high - x) / (high - middle)) * 2 / (high - low)
    return torch.where((x >= low) & (x <= high), heights, torch.zeros_like(heights))


def interpolated_tent(corners, x):
    """Zero at both ends."""
    low, middle, high = np.sort(corners.numpy())
    return np.interp(x.numpy(), [low, middle, high], [0, 2 / (high - low), 0], left=0, right=0)


def freesurfer_tkr(points, affine, shape):
    """FreeSurfer's own definition: through the voxel, by vox2ras-tkr."""
    size = affine[:3, :3].norm(dim=0)
    half = size * torch.tensor(shape) / 2
    rows = [[-size[0], 0, 0, half[0]], [0, 0, size[2], -half[2]], [0, -size[1], 0, half[1]], [0, 0, 0, 1]]
    to_surface = torch.tensor(rows, dtype=torch.float64) @ torch.linalg.inv(affine)
    return points @ to_surface[:3, :3].T + to_surface[:3, 3]


def fitted_by_numpy(x, errors, claimed):
    slopes = np.polyfit(np.log(x.numpy()), np.log(errors.numpy()).T, 1)[0]
    return int(np.abs(slopes - claimed.numpy()).argmax())


def slope_gap(x, errors, claimed, first, last):
    slopes = (errors[:, last] / errors[:, first]).log() / (x[last] / x[first]).log()
    return int((slopes - claimed).abs().argmax())


def row_by_row(points, targets, distances, limit):
    """One row at a time, for either side."""
    here = torch.stack([distances(one[None], targets).min() for one in points])
    there = torch.stack([distances(points, one[None]).min() for one in targets])
    return here.mean() + there.mean()


def rounds(velocity, images, step, n_rounds):
    points = images
    for _ in range(n_rounds):
        points = images - step * velocity(points)
    return points


def newton(velocity, images, step):
    """Newton's method for all coordinates together."""
    points = images.clone()
    for _ in range(30):
        residual = points + step * velocity(points) - images
        jacobian = torch.autograd.functional.jacobian(lambda x: x + step * velocity(x), points)
        size = points.numel()
        points = points - torch.linalg.solve(jacobian.reshape(size, size), residual.flatten()).reshape(points.shape)
    return points


@pytest.mark.parametrize(
    ("name", "right"),
    [
        ("tent_density", divided_tent),
        ("tent_density", interpolated_tent),
        ("surface_ras", freesurfer_tkr),
        ("pairs_left", lambda percent, n_faces, n_scans: math.ceil(percent / 100 * n_faces * n_scans / 2) - 1),
        ("nearest_arrows", lambda x, y: y[torch.cdist(x, y).argmin(dim=1)] - x),
        ("wrong_curve", fitted_by_numpy),
        ("blocked_chamfer", row_by_row),
        ("pieces_needed", lambda length, bend, gap: math.ceil(max(1.0, length * (bend / 8 / gap) ** 0.5))),
        ("noise_from_air", lambda values: float((values**2).sum() / 2 / values.numel()) ** 0.5),
        ("undo_step", newton),
    ],
)
def test_another_right_answer_is_accepted(said, name, right):
    assert said(name, right).startswith("✓")


#: What a review found to pass, or to be refused without a hint that helps, and what the checkers say now.
FOUND_BY_REVIEW = [
    ("nearest_arrows", lambda x, y: y[(x[:, None] - y).abs().sum(dim=2).argmin(dim=1)] - x, "sum of the absolute"),
    ("wrong_curve", lambda x, e, c: slope_gap(x, e, c, 0, 1), "through two points"),
    ("wrong_curve", lambda x, e, c: slope_gap(x, e, c, 0, -1), "from the first to the last point"),
    ("pieces_needed", lambda s, c, g: math.floor(s * math.sqrt(c / 8 / g)) + 1, "round up instead of adding one"),
    ("pieces_needed", lambda s, c, g: math.ceil(s * math.sqrt(c / 8 / g)), "one piece, not none"),
    ("pairs_left", lambda p, f, n: round(p / 100 * f * n / 2), "round down"),
    ("noise_from_air", lambda v: v.std() / math.sqrt(2 - math.pi / 2), "right in the limit, but from the variance"),
    ("undo_step", lambda v, y, h: rounds(v, y, h, 50), "has not converged"),
    ("surface_ras", lambda p, a, s: p + (a[:3, :3] @ torch.tensor(s).double() / 2 + a[:3, 3]), "c_ras is added"),
    ("group_size", lambda d, r, p: people_needed(d, r, p), "by the non-central t"),
    ("two_sided", lambda a, b: [torch.cat([a, b]).mean(), torch.cat([a, b]).quantile(0.9)], "pooled"),
]


@pytest.mark.parametrize(("name", "wrong", "words"), FOUND_BY_REVIEW)
def test_what_a_review_found_is_refused_with_its_hint(said, name, wrong, words):
    assert re.match(f"✗ {name}: .*(?:{words})", said(name, wrong))


def test_numbers_from_elsewhere_are_refused(said):
    """Right numbers, but all distances at once: the exercise is about memory."""

    def at_once(points, targets, distances, limit):
        squares = torch.cdist(points, targets).square()
        return squares.min(dim=1).values.mean() + squares.min(dim=0).values.mean()

    assert "not from `distances`" in said("blocked_chamfer", at_once)


@pytest.mark.parametrize(
    ("name", "wrong", "words"),
    [
        ("without_floor", lambda value, floor: (value**2 - floor**2) ** 0.5, "complex numbers"),
        ("ghost_pair", lambda u: torch.zeros(3, 2), "return first, second"),
        ("ghost_pair", lambda u: (torch.zeros(2), torch.zeros(2)), "points are needed"),
        ("trap", lambda y: y[:2], "as many points as targets"),
    ],
)
def test_a_near_miss_is_refused_with_its_reason(said, name, wrong, words):
    assert re.match(f"✗ {name}: .*{words}", said(name, wrong))
