"""Intervals are SciPy's and hold what they promise; slopes are exact on power laws; every guard is seen to fire."""

import numpy as np
import pytest
from scipy import stats

from meshot.statistics import (
    bootstrap_interval,
    mean_interval,
    paired_interval,
    percentile_interval,
    robust_scores,
)
from meshot_book.statistics import arm_differences, fitted_slope

SIZES = [100, 1000, 10_000, 100_000]


@pytest.mark.parametrize("statistic", ["mean", "rms"])
@pytest.mark.parametrize("exponent", [-1.0, -0.5, 0.25])
def test_exact_power_laws(exponent, statistic):
    found = fitted_slope(SIZES, [[3 * x**exponent, -3 * x**exponent] for x in SIZES], statistic)
    assert found == pytest.approx((exponent,) * 3, rel=1e-9)


def test_the_two_statistics_differ_where_the_law_changes():
    errors = [[1.0] * 40, [0.0] * 30 + [2.0] * 10]
    assert fitted_slope([1, 2], errors).slope == pytest.approx(-1, rel=1e-9)
    assert fitted_slope([1, 2], errors, "rms").slope == pytest.approx(0, abs=1e-9)


def test_more_repetitions_weigh_more():
    by_hand = np.polyfit(np.log(SIZES), np.log([1.0, 2, 4, 3]), 1, w=np.sqrt([1, 5, 2, 7]))[0]
    rows = [[height] * count for height, count in zip([1.0, 2, 4, 3], [1, 5, 2, 7])]
    assert fitted_slope(SIZES, rows).slope == pytest.approx(by_hand, rel=1e-9)


def test_single_errors_get_students_interval():
    heights = [1.0, 0.5, 0.11, 0.03]
    line = stats.linregress(np.log(SIZES), np.log(heights))
    half = stats.t.ppf(0.975, 2) * line.stderr
    expected = (line.slope, line.slope - half, line.slope + half)
    assert fitted_slope(SIZES, [[height] for height in heights]) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("statistic", ["mean", "rms"])
def test_intervals_cover_the_truth_as_often_as_they_say(statistic):
    generator, n_trials = np.random.default_rng(0), 300
    covered, widths = 0, []
    for _ in range(n_trials):
        errors = [x**-0.5 * generator.normal(size=60) for x in SIZES]
        _, low, high = fitted_slope(SIZES, errors, statistic, n_draws=300, generator=generator)
        covered += low <= -0.5 <= high
        widths.append(high - low)
    # Binomial: 95 % of 300 is 285 ± 3.8; the bootstrap of few repetitions is a little too narrow.
    assert 0.90 < covered / n_trials < 0.985
    assert np.mean(widths) < 0.1


def test_repeatable_and_printable():
    errors = [np.random.default_rng(1).normal(size=30) / x for x in SIZES]
    assert fitted_slope(SIZES, errors) == fitted_slope(SIZES, errors)
    assert fitted_slope(SIZES, errors) != fitted_slope(SIZES, errors, generator=1)
    assert str(fitted_slope([1, 2], [[1.0, 1.0], [2.0, 2.0]])) == "1.000 [1.000, 1.000]"


@pytest.mark.parametrize(
    ("x", "errors", "statistic", "message"),
    [
        ([1, 2], [[1.0]], "mean", "2 sizes and 1 rows"),
        ([1, 2], [[1.0, 1.0], []], "mean", "no errors"),
        ([1, 2], [[1.0], [2.0]], "mean", "at least 3 different"),
        ([2, 2], [[1.0, 1.0], [2.0, 1.0]], "mean", "at least 2 different"),
        ([0, 2], [[1.0, 1.0], [2.0, 1.0]], "mean", "positive"),
        ([1, 2], [[1.0, 1.0], [0.0, 0.0]], "mean", "has no logarithm"),
        ([1, 2], [[1.0, 1.0], [np.nan, 0.0]], "mean", "not finite"),
        ([1, 2], [[1.0, 1.0], [1.0, 1.0]], "median", "one of mean, rms"),
    ],
)
def test_guards(x, errors, statistic, message):
    with pytest.raises(ValueError, match=message):
        fitted_slope(x, errors, statistic)


@pytest.mark.parametrize("n", [2, 5, 40])
def test_student_is_scipys(n):
    first, second = np.random.default_rng(n).normal([[1.0], [1.3]], size=(2, n))
    found = paired_interval(first, second)
    assert found.value == pytest.approx(np.mean(first) - np.mean(second))
    assert found[1:] == pytest.approx(tuple(stats.ttest_rel(first, second).confidence_interval(0.95)))
    assert mean_interval(first.tolist())[1:] == pytest.approx(tuple(stats.ttest_1samp(first, 0).confidence_interval()))


def ratio(top, bottom, axis):
    return top.mean(axis=axis) / bottom.mean(axis=axis)


@pytest.mark.parametrize("paired", [False, True])
def test_the_bootstrap_is_scipys(paired):
    first, second = np.random.default_rng(0).normal(5, 1, size=(2, 30))
    found = bootstrap_interval(first, second, statistic=ratio, paired=paired, n_draws=500, generator=7)
    theirs = stats.bootstrap(
        (first, second), ratio, n_resamples=500, paired=paired, method="percentile", rng=np.random.default_rng(7)
    )
    assert found == pytest.approx((first.mean() / second.mean(), *theirs.confidence_interval), rel=1e-12)


def test_samples_are_drawn_together_where_they_are_paired():
    first = np.random.default_rng(0).normal(5, 1, size=20)
    together = bootstrap_interval(first, 2 * first, statistic=ratio, paired=True)
    assert together == pytest.approx((0.5, 0.5, 0.5))
    apart = bootstrap_interval(first, 2 * first, statistic=ratio)
    assert apart.low < 0.49 < 0.51 < apart.high


def test_the_middle_of_draws():
    draws = np.arange(1001.0)
    assert percentile_interval(draws) == pytest.approx([25, 975])
    assert percentile_interval(np.stack([draws, 2 * draws])) == pytest.approx(np.array([[25, 50], [975, 1950]]))


def test_arms_are_compared_measure_by_measure():
    first, second = {"a": [1.0, 2.0, 4.0], "b": [1, 1, 1]}, {"b": [0, 0, 0], "a": [0.0, 2.0, 3.0]}
    found = arm_differences(first, second, centre="mean")
    assert list(found) == ["a_mean", "a_low", "a_high", "b_mean", "b_low", "b_high"]
    assert tuple(found.values()) == (*paired_interval(first["a"], second["a"]), 1, 1, 1)
    assert arm_differences({"a": [3.0]}, {"a": [1.0]}) == {"a_gap": 2.0, "a_low": None, "a_high": None}


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mean_interval([1.0]), "at least two"),
        (lambda: mean_interval(np.ones((1, 2))), r"the shape \(1, 2\)"),
        (lambda: mean_interval([1.0, np.nan]), "not finite"),
        (lambda: paired_interval([1.0, 2.0], [1.0]), "2 and 1 values; pairs"),
        (lambda: bootstrap_interval([1.0]), "at least two"),
        (lambda: bootstrap_interval([1.0, 2.0], [1.0, 2.0, 3.0], statistic=ratio, paired=True), "have 2, 3 values"),
        (lambda: arm_differences({"a": [1.0], "b": [1.0]}, {"a": [1.0]}), "b: measured in one arm only"),
    ],
)
def test_guards_of_intervals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_robust_scores_of_normal_values_are_standard_scores():
    drawn = np.random.default_rng(0).normal(7, 3, 40_001)
    expected = (drawn - np.median(drawn)) / stats.median_abs_deviation(drawn, scale="normal")
    np.testing.assert_allclose(robust_scores(drawn), expected, rtol=1e-12)
    # The relative standard error of MAD is 1.17/√n.
    assert robust_scores(drawn).std() == pytest.approx(1, abs=0.03)


def test_an_outlier_does_not_hide_itself():
    values = np.array([1.0, 2, 3, 4, 5, 1000, np.nan])
    found = robust_scores(values)
    assert np.isnan(found[-1])
    assert found[5] > 100
    assert np.abs(found[:5]).max() < 2


def test_values_beside_a_constant_have_infinite_scores():
    assert robust_scores(np.array([2.0, 2, 2, 4, -8, np.nan])).tolist()[:5] == [0, 0, 0, np.inf, -np.inf]
    assert np.isnan(robust_scores(np.array([2.0, 2, np.nan]))[2])
    assert np.isnan(robust_scores(np.full(3, np.nan))).all()


@pytest.mark.parametrize("values", [np.array([1.0, np.inf]), np.ones((2, 2))])
def test_values_without_a_score_are_refused(values):
    with pytest.raises(ValueError, match="one list of finite numbers"):
        robust_scores(values)
