"""The exercises about long trainings: truths from NumPy and SciPy, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch
from scipy.stats import linregress, t

from meshot_book.exercises import check


def by_questions(seen, new, distance):
    if not seen < 1:
        return 0
    if not new < 1:
        return 1
    return 3 if distance < 1 else 2


def by_running_maximum(steps, ours, other):
    worst = np.maximum.accumulate((np.array(ours) - np.array(other))[::-1])[::-1]
    ahead = np.flatnonzero(worst < 0)
    return steps[ahead[0]] if len(ahead) else -1


def by_covariance(steps, distances, at, own=1.0, quantile=None, far=1.0):
    """The interval from the covariance of the two numbers of the line."""
    x, y, n = np.log(steps.numpy()), np.log(distances.numpy()), len(steps)
    middle = x.mean()
    (slope, height), covariance = np.polyfit(x - middle, y, 1, cov="unscaled")
    place = np.array([np.log(at) - middle, 1.0])
    rest = ((y - height - slope * (x - middle)) ** 2).sum() / (n - 2)
    spread = own + (place * [far, 1.0]) @ covariance @ (place * [far, 1.0])
    half = (quantile or t.ppf(0.975, n - 2)) * np.sqrt(rest * spread)
    centre = place @ [slope, height]
    return torch.tensor(np.exp([centre, centre - half, centre + half]))


@pytest.mark.parametrize(
    ("checker", "function"),
    [
        (check.diagnosis, by_questions),
        (check.first_lead, by_running_maximum),
        (check.forecast, by_covariance),
    ],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def first_nearer(steps, ours, other):
    nearer = np.flatnonzero(np.array(ours) < np.array(other))
    return steps[nearer[0]] if len(nearer) else -1


def last_behind(steps, ours, other):
    behind = np.flatnonzero(np.array(ours) >= np.array(other))
    return steps[behind[-1]] if len(behind) else -1


def number_of_lead(steps, ours, other):
    found = by_running_maximum(steps, ours, other)
    return steps.index(found) if found > 0 else -1


def always_some(steps, ours, other):
    found = by_running_maximum(steps, ours, other)
    return found if found > 0 else steps[0]


def distance_first(seen, new, distance):
    if seen < 1 and distance >= 1:
        return 2
    return by_questions(seen, new, distance)


def straight(steps, distances, at):
    """A line between the numbers themselves, with its interval."""
    x, y, n = steps.numpy(), distances.numpy(), len(steps)
    line = linregress(x, y)
    rest = ((y - line.intercept - line.slope * x) ** 2).sum() / (n - 2)
    spread = 1 + 1 / n + (at - x.mean()) ** 2 / ((x - x.mean()) ** 2).sum()
    half, centre = t.ppf(0.975, n - 2) * np.sqrt(rest * spread), line.intercept + line.slope * at
    return torch.tensor([centre, centre - half, centre + half])


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.diagnosis, distance_first, "ask for the loss first"),
        (check.diagnosis, lambda seen, new, d: by_questions(seen, seen, d), "of new subjects is not used"),
        (check.diagnosis, lambda seen, new, d: by_questions(new, new, d), "of training subjects is not used"),
        (check.diagnosis, lambda *q: by_questions(*(0.0 if each <= 1 else 2.0 for each in q)), "exactly 1"),
        (check.diagnosis, lambda *q: by_questions(*(1 / each for each in q)), "after / before"),
        (check.first_lead, first_nearer, "the first check at which"),
        (check.first_lead, number_of_lead, "the number of the check"),
        (check.first_lead, lambda s, a, b: by_running_maximum(s, b, a), "the other one is nearer"),
        (check.first_lead, last_behind, "the next one is asked for"),
        (check.first_lead, always_some, "the answer is −1"),
        (check.forecast, lambda s, d, at: by_covariance(s, d, at, own=0.0), "there is a 1 under the root"),
        (check.forecast, lambda s, d, at: by_covariance(s, d, at, quantile=1.96), "a normal distribution"),
        (check.forecast, lambda s, d, at: by_covariance(s, d, at, quantile=t.ppf(0.975, len(s) - 1)), "n − 2"),
        (check.forecast, lambda s, d, at: by_covariance(s, d, at, far=0.0), "does not grow"),
        (check.forecast, straight, "a line between logarithms"),
        (check.forecast, lambda s, d, at: by_covariance(s, d, at).log(), "these are logarithms"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)
