"""The exercises of chapter 39: truths from NumPy, SciPy and PyTorch, and a different hint for each usual mistake."""

import numpy as np
import pytest
import torch
from scipy.signal import lfilter
from scipy.stats import norm
from torch import nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from meshot_book.exercises import check


def halves(distances):
    return np.array([np.mean(np.array_split(each, 2)[1]) for each in distances])


def by_halves(rates, distances):
    return rates[int(halves(distances).argmin())]


def by_torch(weights, decay):
    """The average that a training with averaged weights keeps."""
    network = nn.Linear(weights.shape[1], 1, bias=False, dtype=torch.float64)
    average = AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(decay))
    for own in weights:
        network.weight.data[0] = own
        average.update_parameters(network)
    return average.module.weight.data[0]


def from_zero(weights, decay):
    return torch.from_numpy(lfilter([1 - decay], [1, -decay], weights.numpy(), axis=0)[-1].copy())


def by_quantiles(n, deviation):
    """The smallest of n uniform numbers is 1 − (1 − u)^(1/n) for a uniform u."""
    u = (np.arange(2_000_000) + 0.5) / 2_000_000
    return deviation * float(norm.ppf(1 - (1 - u) ** (1 / n)).mean())


@pytest.mark.parametrize(
    ("checker", "function"),
    [(check.chosen_rate, by_halves), (check.averaged_weights, by_torch), (check.luck_of_the_best, by_quantiles)],
)
def test_independent_solutions_pass(capsys, checker, function):
    checker(function)
    assert capsys.readouterr().out.startswith("✓")


@pytest.mark.parametrize(
    ("checker", "function", "hint"),
    [
        (check.chosen_rate, lambda r, d: r[int(np.argmin([each[-1] for each in d]))], "the last checks only"),
        (check.chosen_rate, lambda r, d: r[int(np.argmin([np.min(each) for each in d]))], "the lowest checks"),
        (check.chosen_rate, lambda r, d: r[int(np.argmin([np.mean(each) for each in d]))], "all checks"),
        (check.chosen_rate, lambda r, d: int(halves(d).argmin()), "not the rate"),
        (check.chosen_rate, lambda r, d: r[int(halves(d).argmax())], "the smallest distance"),
        (check.averaged_weights, lambda w, c: w[-1], "of the last step"),
        (check.averaged_weights, lambda w, c: w.sum(0) / len(w), "the mean of all steps"),
        (check.averaged_weights, lambda w, c: by_torch(w, 1 - c), "not that of the step"),
        (check.averaged_weights, from_zero, "not with zero"),
        (check.averaged_weights, lambda w, c: by_torch(w.flip(0), c), "from the last one to the first"),
        (check.luck_of_the_best, lambda n, s: -by_quantiles(n, s), "is negative"),
        (check.luck_of_the_best, lambda n, s: by_quantiles(n, 1), "proportional to the deviation"),
        (check.luck_of_the_best, lambda n, s: -s / np.sqrt(n), "the error of a mean"),
        (check.luck_of_the_best, lambda n, s: s * norm.isf(n / (n + 1)), "a quantile"),
        (check.luck_of_the_best, lambda n, s: -s * np.sqrt(2 * np.log(n)), "a very large number"),
    ],
)
def test_usual_mistakes_get_their_hint(hinted, checker, function, hint):
    hinted(checker, function, hint)
