"""The exercises of chapter 35: truths from SciPy, and a different hint for each usual mistake."""

import numpy as np
import pytest
from scipy.stats import linregress, ttest_rel

from meshot_book.exercises import check


def by_a_test(first, second):
    """From t = mean / standard error; a constant difference has none."""
    gap = (first - second).mean()
    t = ttest_rel(first.numpy(), second.numpy()).statistic if (first - second).std() > 1e-9 else np.inf
    return [float(gap), float(gap / t)]


def by_a_loop(initial, checks):
    kept, least = -1, initial
    for number, distance in enumerate(checks):
        if distance < least:
            kept, least = number, distance
    return kept


def by_regression(n_steps, errors):
    return -linregress(np.log(n_steps.numpy()), np.log(errors.numpy())).slope


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.paired_gap, by_a_test), (check.kept_check, by_a_loop), (check.observed_order, by_regression)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def unpaired(x, y):
    return [float((x - y).mean()), float(((x.var() + y.var()) / len(x)).sqrt())]


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.paired_gap, unpaired, "two independent groups"),
        (check.paired_gap, lambda x, y: [(x - y).mean(), (x - y).std()], "smaller by √n"),
        (check.paired_gap, lambda x, y: [(x - y).mean(), (x - y).std(correction=0) / len(x) ** 0.5], "n − 1"),
        (check.paired_gap, lambda x, y: [(x - y).mean(), (x - y).std() / len(x)], "divided by n"),
        (check.paired_gap, lambda x, y: by_a_test(y, x), "the sign is reversed"),
        (check.kept_check, lambda a, c: min(range(len(c)), key=c.__getitem__), "candidate too"),
        (check.kept_check, lambda a, c: len(c) - 1 if c[-1] < a else -1, "keeps the last check"),
        (check.kept_check, lambda a, c: next((i for i in range(len(c)) if c[i] < a), -1), "keeps the first check"),
        (check.kept_check, lambda a, c: c.index(max(c)) if max(c) > a else -1, "smallest is the best"),
        (check.observed_order, lambda n, e: -by_regression(n, e), "positive order"),
        (check.observed_order, lambda n, e: (e[0] / e[-1]).log() / (n[-1] / n[0]).log(), "first and the last run"),
        (check.observed_order, lambda n, e: -linregress(n, e.log()).slope, "steps need a logarithm"),
        (check.observed_order, lambda n, e: -linregress(n.log(), e).slope, "errors need a logarithm"),
        (check.observed_order, lambda n, e: -(n.log() @ e.log()) / (n.log() @ n.log()), "through the origin"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)


def test_of_equal_checks_the_first_is_kept(hinted):
    hinted(check.kept_check, lambda a, c: len(c) - 1 - c[::-1].index(min(c)) if min(c) < a else -1, "first is kept")
