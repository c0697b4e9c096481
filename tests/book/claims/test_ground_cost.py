"""Claim 24: each status is reached by numbers that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.ground_cost import ground_cost_verdict


def summary(p, ratio):
    names = ("euclidean_root_mm", "coordinates_root_mm", "other_partner", "mean_angle_degrees", "turning_euclidean",
             "turning_coordinates", "minimisers_apart_mm")  # fmt: skip
    return {"p": p, "ratio_mean": ratio, "n_seeds": 5} | {f"{name}_mean": 0.25 for name in names}


def asked(loss, diagonal):
    return {"loss": loss, "p": 1, "axis_over_step": 1.0, "diagonal_over_axis": diagonal, "coordinates_would_say": 1.7}


@pytest.fixture
def record():
    rows = [summary(1, 1.47), summary(2, 1.0000001)]
    return {"results": {"summary": rows, "asked": [asked("wasserstein", 1.0), asked("other", 1.7)]}}


def test_agreement_for_one_exponent_is_a_condition(record):
    verdict = ground_cost_verdict(record)
    assert verdict.status == ledger.ASSUMING
    assert "both costs agree for p = 2; for p = 1 the paper's gives 1.47 times" in verdict.ours
    assert "1 of 2 losses and metrics" in verdict.ours
    assert verdict.numbers.count("| wasserstein | 1 |") == 1


def test_reproduced_where_all_agree(record):
    record["results"]["summary"][0]["ratio_mean"] = 0.999
    assert ground_cost_verdict(record).status == ledger.REPRODUCED


def test_not_reproduced_where_none_agrees(record):
    record["results"]["summary"][1]["ratio_mean"] = 0.9
    verdict = ground_cost_verdict(record)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "never agree" in verdict.ours
