"""Verdicts on encodings follow from numbers: each status is reached by results that deserve it."""

import copy

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.encodings import continuous_verdict, normal_scale_verdict, sample_gradient_verdict


@pytest.fixture
def exact():
    errors = [{"n_points": n, "mean_error": 0.1, "rms_error": e} for n, e in ((1000, 51.3), (100_000, 0.2))]
    sampled = {"pair": "a", "exact": 1.5, "sampled": errors, "barycentres": -0.01}
    ends = [
        {
            "encoding": name,
            "seed": 0,
            "start": {"sliced_distance": 1.0, "surface_distance": 2.0},
            "end": {"sliced_distance": left, "surface_distance": left},
        }
        for name, left in (("continuous", 0.01), ("samples", 0.5))
    ]
    accuracy = {"values": [{"error": 1e-14}], "gradients": [{"p": 2, "largest_relative_error": 1e-7}]}
    time = {"ratio_to_exact": {"exact": 1.0, "100000 points": 2.0}}
    return {"results": {"accuracy": accuracy, "sampling": [sampled], "time": time, "descent": ends}}


def test_of_practical_use(exact):
    verdict = continuous_verdict(exact)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "2.0 times its CPU time" in verdict.ours
    assert "at most 1.0%" in verdict.ours
    assert "| a | 1.5 | 51.3 times | 20 % | -1 % |" in verdict.numbers


@pytest.mark.parametrize("lapse", ["slow", "stuck"])
def test_accurate_but_not_practical_is_a_condition(exact, lapse):
    if lapse == "slow":
        exact["results"]["time"]["ratio_to_exact"]["100000 points"] = 0.5
    else:
        exact["results"]["descent"][0]["end"]["sliced_distance"] = 0.4
    assert continuous_verdict(exact).status == ledger.IN_PART


@pytest.mark.parametrize(("part", "key"), [("values", "error"), ("gradients", "largest_relative_error")])
def test_inaccurate_means_theoretical(exact, part, key):
    exact["results"]["accuracy"][part][0][key] = 0.01
    assert continuous_verdict(exact).status == ledger.REPRODUCED


def sweep(name, shares, half_extent=80.0):
    scales = (1.0, 10.0, half_extent)
    rows = [{"scale": s, "share": g / 2, "gradient_share": g} for s, g in zip(scales, shares, strict=True)]
    return {"pair": name, "half_of_loss_at": None, "half_extent": half_extent, "rows": rows}


@pytest.fixture
def scales():
    pairs = [sweep("a", (0.01, 0.4, 0.9)), sweep("b", (0.02, 0.6, 0.98), 40.0), sweep("white and shifted", (0, 0, 0))]
    return {"results": {"pairs": pairs}}


def test_a_scale_between_the_conventions_is_a_condition(scales):
    verdict = normal_scale_verdict(scales)
    assert verdict.status == ledger.CHOICE
    assert "1 to 2 % of its gradient" in verdict.ours
    assert "normals of 10 to 10 mm" in verdict.ours
    assert verdict.numbers.count("\n") == 4


def test_both_conventions_within_bounds_reproduce_it(scales):
    for pair in scales["results"]["pairs"]:
        pair["rows"][0]["gradient_share"] = pair["rows"][2]["gradient_share"] = 0.5
    assert normal_scale_verdict(scales).status == ledger.REPRODUCED


def test_no_scale_for_all_refutes_it(scales):
    scales["results"]["pairs"][0]["rows"][1]["gradient_share"] = 0.99
    verdict = normal_scale_verdict(scales)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "no scale fits all" in verdict.ours


def slope(mean, half=0.01):
    return {"mean": mean, "low": mean - half, "high": mean + half}


@pytest.fixture
def gradients():
    row = {"case": "L", "n_points": 100, "exact": 0.375, "by_differences": 0.375, "exact_fixed_weights": 0.25}
    row |= {"fixed_draws": slope(0.25), "carried": slope(0.374)}
    kinds = {"continuous": 0.1, "samples, fixed draws": 0.105}
    ends = [{"n_corners": n, "kind": k, "sliced_distance": e} for n in (12, 6) for k, e in kinds.items()]
    return {"results": {"curve": [row], "losses": [copy.deepcopy(row)], "descent": ends}}


def test_biased_but_forgiving_is_a_condition(gradients):
    verdict = sample_gradient_verdict(gradients)
    assert verdict.status == ledger.CHOICE
    assert "0.25 (0.24 to 0.26) instead of 0.375" in verdict.ours
    assert "biased in 2 of 2 cases" in verdict.ours


def test_unbiased_reproduces_it(gradients):
    for part in ("curve", "losses"):
        gradients["results"][part][0]["fixed_draws"] = slope(0.376)
    assert sample_gradient_verdict(gradients).status == ledger.REPRODUCED


def test_a_descent_that_ends_elsewhere_refutes_it(gradients):
    for end in gradients["results"]["descent"]:
        if end["kind"].startswith("samples") and end["n_corners"] == 6:
            end["sliced_distance"] = 0.2
    assert sample_gradient_verdict(gradients).status == ledger.NOT_REPRODUCED
