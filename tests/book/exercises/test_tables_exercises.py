"""The exercises of chapter 38: truths from SciPy, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from scipy.stats import kendalltau, rankdata, ttest_1samp, ttest_ind, ttest_rel

from meshot_book.exercises import check


def by_kendall(printed, ours):
    return (kendalltau(printed, ours).statistic + 1) / 2


def by_a_test(ours, other, larger):
    found = ttest_rel(ours.numpy(), other.numpy())
    return 0 if found.pvalue >= 0.05 else (1 if (found.statistic > 0) == larger else -1)


def by_rotation(moving, fixed):
    here, there = moving.numpy().mean(axis=0), fixed.numpy().mean(axis=0)
    turn, _ = Rotation.align_vectors(fixed.numpy() - there, moving.numpy() - here)
    matrix = turn.as_matrix()
    return torch.from_numpy(np.column_stack([matrix, there - matrix @ here]))


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.same_order, by_kendall), (check.who_is_better, by_a_test), (check.best_motion, by_rotation)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


def by_groups(ours, other, larger):
    found = ttest_ind(ours.numpy(), other.numpy())
    return 0 if found.pvalue >= 0.05 else (1 if (found.statistic > 0) == larger else -1)


def by_a_normal(ours, other, larger):
    t = ttest_1samp((ours - other).numpy(), 0).statistic
    return 0 if abs(t) <= 1.96 else (1 if (t > 0) == larger else -1)


def turned_over(moving, fixed):
    """SciPy's rotation, transposed."""
    turn = by_rotation(moving, fixed)[:, :3].T
    return torch.cat([turn, (fixed.mean(0) - turn @ moving.mean(0))[:, None]], dim=1)


def with_reflections(moving, fixed):
    cross = (fixed - fixed.mean(0)).T @ (moving - moving.mean(0))
    left, _, right = np.linalg.svd(cross.numpy())
    turn = torch.from_numpy(left @ right)
    return torch.cat([turn, (fixed.mean(0) - turn @ moving.mean(0))[:, None]], dim=1)


def about_the_origin(moving, fixed):
    turn, _ = Rotation.align_vectors(fixed.numpy(), moving.numpy())
    matrix = torch.from_numpy(turn.as_matrix())
    return torch.cat([matrix, (fixed.mean(0) - matrix @ moving.mean(0))[:, None]], dim=1)


def shifted_only(moving, fixed):
    return torch.cat([by_rotation(moving, fixed)[:, :3], (fixed.mean(0) - moving.mean(0))[:, None]], dim=1)


@pytest.mark.filterwarnings("ignore:Optimal rotation is not uniquely")
@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.same_order, lambda p, o: kendalltau(p, o).statistic, "Kendall's τ"),
        (check.same_order, lambda p, o: np.mean(rankdata(p) == rankdata(o)), "same rank"),
        (check.same_order, lambda p, o: np.mean(np.diff(p) * np.diff(o) > 0), "only neighbours"),
        (check.same_order, lambda p, o: 1 - by_kendall(p, o), "opposite order"),
        (check.same_order, lambda p, o: by_kendall(p, o) * len(p) * (len(p) - 1) / 2, "a share is needed"),
        (check.who_is_better, by_groups, "two independent groups"),
        (check.who_is_better, by_a_normal, "quantile of Student's t"),
        (check.who_is_better, lambda a, b, larger: by_a_test(a, b, False), "of normals, a larger value is better"),
        (check.who_is_better, lambda a, b, larger: by_a_test(b, a, larger), "the sign is reversed"),
        (check.who_is_better, lambda a, b, larger: 1 if ((a - b).mean() > 0) == larger else -1, "the means only"),
        (check.best_motion, with_reflections, "a reflection"),
        (check.best_motion, about_the_origin, "subtract the mean"),
        (check.best_motion, lambda m, f: by_rotation(f, m), "moves the fixed points"),
        (check.best_motion, turned_over, "the rotation is transposed"),
        (check.best_motion, shifted_only, "without a rotation"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)
