"""Claim 18: each status is reached by intervals that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.sinkhorn import SHOWN, blur_verdict


def difference(blur, low, high, **more):
    ends = {f"{name}_{end}": value for name in SHOWN for end, value in (("low", low), ("high", high), ("mean", 0.1))}
    return {"loss": "sinkhorn", "blur_mm": blur, "scaling": 0.5} | ends | more


def fit(loss, **more):
    return {"loss": loss} | {f"{name}_{part}": 0.5 for name in SHOWN for part in ("mean", "sd")} | more


@pytest.fixture
def record():
    limits = [{"p": 2, "blur": 1.0, "scaling": s, "off_exact": -0.1, "off_energy": 2.0, "cosine_to_exact": 0.9}
              for s in (0.5, 0.9, 0.99)]  # fmt: skip
    return {
        "results": {
            "fits": [fit("sliced"), fit("exact"), fit("sinkhorn", blur_mm=5.0, scaling=0.5)],
            "differences": [
                difference(5.0, 0.1, 0.2),
                difference(20.0, 0.1, 0.2),
                difference(None, -1.0, -0.5, loss="exact"),
            ],
            "limits": limits,
            "start": dict.fromkeys(SHOWN, 2.0),
            "floor": dict.fromkeys(SHOWN, 0.0),
            "lengths_mm": {"diameter": 92.0, "spacing": 8.0},
        }
    }


def test_reproduced_where_every_blur_is_weaker(record):
    verdict = blur_verdict(record)
    assert verdict.status == ledger.REPRODUCED
    assert "weaker at a blur of 5, 20 mm, on surfaces 92 mm wide" in verdict.ours
    assert verdict.numbers.count("Sinkhorn, 5 mm") == 2
    assert "annealed by | off exact" in verdict.numbers
    assert "| 2 | 1 | 0.99 | -10.0% | +200.0% | 0.9 |" in verdict.numbers


def test_a_blur_that_is_better_is_a_condition(record):
    record["results"]["differences"][0] = difference(5.0, -0.2, -0.1, scaling=0.8)
    verdict = blur_verdict(record)
    assert verdict.status == ledger.CHOICE
    assert "weaker at a blur of 20 mm; better at a blur of 5 (annealed by 0.8) mm" in verdict.ours


def test_one_distance_alone_does_not_make_a_blur_weaker(record):
    for row in record["results"]["differences"][:2]:
        row["sw2_surface_low"] = -0.1
    verdict = blur_verdict(record)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "neither weaker nor better at a blur of 5, 20 mm" in verdict.ours
