"""Reliability, p-values and group sizes against closed forms, SciPy and simulations; every guard fires."""

import math

import numpy as np
import pytest
from scipy import stats

from meshot.statistics import mean_interval
from meshot_book.statistics import (
    holm_adjusted,
    intraclass_correlation,
    p_of_interval,
    people_needed,
    power_of_groups,
    within_deviation,
)


def drawn(generator, n_people, n_visits, reliability, shape=()):
    people = math.sqrt(reliability) * generator.normal(size=(*shape, n_people, 1))
    return people + math.sqrt(1 - reliability) * generator.normal(size=(*shape, n_people, n_visits))


def test_pairs_have_a_closed_form():
    """With two visits the mean squares are the variances of sums and differences."""
    first, second = np.array([3.0, 5.0, 9.0, 4.0]), np.array([3.5, 4.0, 8.0, 6.0])
    between, within = np.var(first + second, ddof=1) / 2, np.mean((first - second) ** 2) / 2
    found = intraclass_correlation(np.stack([first, second], axis=1))
    assert found.value == pytest.approx((between - within) / (between + within), rel=1e-12)
    assert found.low < found.value < found.high
    assert within_deviation(np.stack([first, second], axis=1)).value == pytest.approx(math.sqrt(within), rel=1e-12)


def test_the_ratio_of_mean_squares_is_scipys():
    values = drawn(np.random.default_rng(0), 9, 3, 0.6)
    ratio = stats.f_oneway(*values).statistic
    assert intraclass_correlation(values).value == pytest.approx((ratio - 1) / (ratio + 2), rel=1e-9)


def test_extremes():
    people = np.array([[1.0], [2.0], [4.0]])
    assert intraclass_correlation(np.repeat(people, 2, axis=1)) == (1.0, 1.0, 1.0)
    assert intraclass_correlation([[1.0, 3.0], [3.0, 1.0]]).value == pytest.approx(-1.0)
    assert within_deviation(np.repeat(people, 2, axis=1)) == (0.0, 0.0, 0.0)


def test_a_difference_of_groups_is_no_variance_between_people():
    generator = np.random.default_rng(1)
    values, groups = drawn(generator, 12, 2, 0.5), ["a"] * 5 + ["b"] * 7
    shifted = values + np.array([100.0] * 5 + [0.0] * 7)[:, None]
    assert intraclass_correlation(shifted, groups) == pytest.approx(intraclass_correlation(values, groups), rel=1e-9)
    assert intraclass_correlation(shifted).value > 0.99


@pytest.mark.parametrize(("reliability", "n_visits"), [(0.9, 2), (0.4, 3)])
def test_intervals_cover_the_truth_as_often_as_they_say(reliability, n_visits):
    n_trials, covered = 1000, np.zeros(2)
    groups = [0] * 6 + [1] * 6
    for values in drawn(np.random.default_rng(2), 12, n_visits, reliability, (n_trials,)):
        for k, (found, truth) in enumerate(
            (
                (intraclass_correlation(values, groups), reliability),
                (within_deviation(values), math.sqrt(1 - reliability)),
            )
        ):
            covered[k] += found.low <= truth <= found.high
    # Binomial: 95 % of 1000 is 950 ± 7.
    assert (abs(covered / n_trials - 0.95) < 0.025).all()


@pytest.mark.parametrize(("effect", "n_people"), [(0.0, 5), (1.2, 6), (0.5, 40)])
def test_the_power_is_that_of_simulated_tests(effect, n_people):
    generator, n_trials = np.random.default_rng(3), 4000
    values = generator.normal(size=(2, n_people, n_trials)) + np.array([0.0, effect])[:, None, None]
    share = (stats.ttest_ind(*values).pvalue < 0.05).mean()
    assert power_of_groups(effect, n_people) == pytest.approx(share, abs=4 * math.sqrt(0.25 / n_trials))
    assert power_of_groups(-effect, n_people) == pytest.approx(power_of_groups(effect, n_people), rel=1e-9)


@pytest.mark.parametrize(("effect", "n_people"), [(5.0, 12), (1.0, 200), (0.2, 5000)])
def test_the_power_of_a_large_study_is_one(effect, n_people):
    assert power_of_groups(effect, n_people) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("reliability", [1.0, 0.7, 0.2])
@pytest.mark.parametrize("effect", [0.3, 0.8, 2.0])
def test_the_number_is_the_smallest_and_near_the_normal_formula(effect, reliability):
    found, seen = people_needed(effect, reliability), effect * math.sqrt(reliability)
    assert power_of_groups(seen, found) >= 0.8 > power_of_groups(seen, found - 1)
    by_normal = 2 * (stats.norm.ppf(0.975) + stats.norm.ppf(0.8)) ** 2 / seen**2
    assert by_normal < found < by_normal + 3


@pytest.mark.parametrize(
    ("values", "groups", "why"),
    [
        ([1.0, 2.0], None, "the shape"),
        ([[1.0], [2.0]], None, "at least two columns"),
        ([[1.0, math.nan], [2.0, 3.0]], None, "not finite"),
        ([[1.0, 2.0], [2.0, 3.0]], ["a"], "1 groups for 2 people"),
        ([[1.0, 2.0], [2.0, 3.0]], ["a", "b"], "more people are needed"),
        ([[1.0, 1.0], [1.0, 1.0]], None, "all values are equal"),
    ],
)
def test_bad_values_are_refused(values, groups, why, unchecked):
    with pytest.raises(ValueError, match=why):
        intraclass_correlation(values, groups)


def test_bad_sizes_are_refused():
    with pytest.raises(ValueError, match="at least two people"):
        power_of_groups(1.0, 1)
    with pytest.raises(ValueError, match="the reliability is 0"):
        people_needed(1.0, 0.0)
    with pytest.raises(ValueError, match="the power"):
        people_needed(1.0, power=0.01)
    with pytest.raises(ValueError, match="more than 10,000,000 people"):
        people_needed(1e-5)
    with pytest.raises(ValueError, match="the effect is nan"):
        people_needed(math.nan)


def test_the_p_value_of_an_interval_is_scipys():
    values = np.random.default_rng(3).normal(0.4, size=16)
    assert p_of_interval(*mean_interval(values), 16) == pytest.approx(stats.ttest_1samp(values, 0).pvalue, rel=1e-9)
    assert p_of_interval(0.2, 0.2, 0.2, 5) == 0
    assert p_of_interval(0.0, 0.0, 0.0, 5) == 1


def test_holms_rule_decides_as_its_definition():
    """Step by step: from the smallest on, as long as p is at most level / (number of tests that remain)."""
    generator = np.random.default_rng(1)
    for _ in range(200):
        p_values = generator.uniform(0, 0.1, size=generator.integers(1, 12))
        level, decided = generator.uniform(0.01, 0.2), np.zeros(len(p_values), dtype=bool)
        for left, k in zip(range(len(p_values), 0, -1), np.argsort(p_values)):
            if p_values[k] > level / left:
                break
            decided[k] = True
        np.testing.assert_array_equal(holm_adjusted(p_values) <= level, decided)
    np.testing.assert_allclose(holm_adjusted([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])
    assert holm_adjusted([0.9, 0.8]).tolist() == [1, 1]


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (lambda: p_of_interval(0.2, 0.3, 0.4, 5), "the mean is 0.2"),
        (lambda: p_of_interval(0.2, 0.1, 0.4, 1), "from 1 differences"),
        (lambda: holm_adjusted([0.5, 1.5]), "numbers from 0 to 1"),
    ],
)
def test_p_values_need_numbers_that_can_be(asked, words):
    with pytest.raises(ValueError, match=words):
        asked()
