"""Claim 7: each status is reached by duels that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.varifold import varifold_verdict


def duel(family, low, high, quantity="own"):
    common = {"family": family, "level": 1, "n_faces": 48, "d": 3, "p": 2, "quantity": quantity}
    return common | {"ratio": (low * high) ** 0.5, "low": low, "high": high}


def rate(family, encoding, slope):
    common = {"family": family, "d": 3, "p": 2, "quantity": "own", "encoding": encoding}
    return common | {"slope": slope, "low": slope - 0.1, "high": slope + 0.1}


@pytest.fixture
def record():
    rates = [rate("cube", "barycentres", 1.5), rate("cube", "samples", 1.0), rate("cube", "vertices", 1.4)]
    return {"results": {"rates": rates, "duels": [duel("cube", 2, 4), duel("cube", 10, 40, "other")]}}


def test_reproduced_where_every_duel_is_won(record):
    verdict = varifold_verdict(record)
    assert verdict.status == ledger.REPRODUCED
    assert "smaller error in 2 of 2 comparisons, the larger in 0, and 0 are undecided" in verdict.ours
    assert "a factor of 20 (cube, 48 supports)" in verdict.ours
    assert "larger error:" not in verdict.ours
    assert verdict.numbers.count("\n") == 2 + 2 + 2


def test_a_duel_lost_or_open_is_a_condition(record):
    record["results"]["duels"].append(duel("uneven_cube", 0.1, 0.5))
    verdict = varifold_verdict(record)
    assert verdict.status == ledger.IN_PART
    assert verdict.ours.endswith("larger error: uneven cube")
    record["results"]["duels"][-1] |= {"low": 0.9, "high": 1.2}
    assert varifold_verdict(record).status == ledger.IN_PART


def test_not_reproduced_where_no_duel_is_won(record):
    for row in record["results"]["duels"]:
        row |= {"low": 0.5, "high": 0.9}
    assert varifold_verdict(record).status == ledger.NOT_REPRODUCED
