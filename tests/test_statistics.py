"""Slopes: exact on power laws, intervals that hold what they promise, and every guard seen to fire."""

import numpy as np
import pytest
from scipy import stats

from meshot.statistics import averages, fitted_slope

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


def test_averages():
    assert averages([[3.0, -4.0]]) == pytest.approx([3.5])
    assert averages([[3.0, -4.0]], "rms") == pytest.approx([np.sqrt(12.5)])


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
        ([1, 2], [[1.0, 1.0], [1.0, 1.0]], "median", "'mean', 'rms'"),
    ],
)
def test_guards(x, errors, statistic, message):
    with pytest.raises(ValueError, match=message):
        fitted_slope(x, errors, statistic)
