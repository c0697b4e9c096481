"""Claim 9: each status is reached by results that deserve it."""

import copy

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.weights import weights_verdict


def difference(encoding, low, high):
    numbers = {"sw_surface_full": 0.001, "sw_surface_stopped": 0.002, "sw_surface_gap": (low + high) / 2}
    numbers |= {"sw_surface_low": low, "sw_surface_high": high, "n_seeds": 6}
    numbers |= {"edge_variation_full": 0.1, "edge_variation_stopped": 0.2}
    return {"target": "folded_sphere", "encoding": encoding} | numbers


@pytest.fixture
def record():
    merging = [{"p": 1, "n_cases": 30, "pot_sorting": 1e-15, "pot_linear_program": 2e-15, "scipy": 3e-15}]
    merging.append({"p": 2, "n_cases": 30, "pot_sorting": 1e-15, "pot_linear_program": 1e-15})
    differences = [difference("surface", -0.001, 0.001), difference("varifold", -0.002, 0.001)]
    gradients = [{"tangential_full_mean": 0.001, "tangential_stopped_mean": 0.25}]
    areas = [{"surface": "a sphere covered twice", "area_ratio": 2.0, "sw_surface": 1e-15}]
    results = {"merging": merging, "differences": differences, "gradients": gradients, "areas": areas}
    return {"results": results}


def test_reproduced_where_the_choice_does_not_matter(record):
    verdict = weights_verdict(record)
    assert verdict.status == ledger.REPRODUCED
    assert "Merged costs agree with POT and SciPy to 3e-15 in 60 cases" in verdict.ours
    assert "varifold: nearer on 0, farther on 0 of 1 targets" in verdict.ours
    assert "0.1% of the full gradient lies along the surface, 25% of the stopped one" in verdict.ours
    assert verdict.numbers.count("\n") == 3


@pytest.mark.parametrize(("low", "high", "words"), [(0.1, 0.2, "nearer on 1"), (-0.2, -0.1, "farther on 1")])
def test_a_difference_either_way_is_a_condition(record, low, high, words):
    altered = copy.deepcopy(record)
    altered["results"]["differences"][1] = difference("varifold", low, high)
    verdict = weights_verdict(altered)
    assert verdict.status == ledger.CHOICE
    assert words in verdict.ours


@pytest.mark.parametrize("library", ["pot_sorting", "scipy"])
def test_not_reproduced_where_another_library_disagrees(record, library):
    record["results"]["merging"][0][library] = 1e-9
    assert weights_verdict(record).status == ledger.NOT_REPRODUCED
