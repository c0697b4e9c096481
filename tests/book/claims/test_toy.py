"""Verdicts follow from numbers: each status is reached by results that deserve it."""

import copy

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.toy import toy_verdict


def row(polygon, loss, w2, **more):
    means = {"w2": w2, "coverage": 0.9, "evenness": 0.8}
    values = {f"{k}_mean": v for k, v in means.items()} | {f"{k}_sd": 0.01 for k in means}
    return {"polygon": polygon, "sampling": "even", "loss": loss, "reduction": "mean", "n_seeds": 5} | values | more


def difference(polygon, w2_low, coverage_high):
    return {"polygon": polygon, "sampling": "even", "redraw": True, "w2_low": w2_low, "coverage_high": coverage_high}


@pytest.fixture
def record():
    summary = [row("acute_star", "chamfer", 0.223), row("acute_star", "sliced", 0.014, redraw=True)]
    differences = [difference("acute_star", 0.1, -0.2), difference("letter_e", 0.2, -0.1)]
    floors = [row("acute_star", "", 0.02)]
    return {"results": {"summary": summary, "differences": differences, "floors": floors}}


def test_reproduced_where_every_interval_agrees(record):
    verdict = toy_verdict(record)
    assert verdict.status == ledger.REPRODUCED
    assert "0.223 and 90% (Chamfer), against 0.014 and 90% (sliced Wasserstein, redrawn)" in verdict.ours
    assert "2 of 2 settings" in verdict.ours
    assert verdict.numbers.count("\n") == 4


def test_a_setting_where_coverage_does_not_agree_is_a_condition(record):
    altered = copy.deepcopy(record)
    altered["results"]["differences"][1]["coverage_high"] = 0.01
    verdict = toy_verdict(altered)
    assert verdict.status == ledger.IN_PART
    assert "letter e" in verdict.ours


def test_not_reproduced_where_no_interval_agrees(record):
    for entry in record["results"]["differences"]:
        entry["w2_low"] = -0.01
    assert toy_verdict(record).status == ledger.NOT_REPRODUCED
