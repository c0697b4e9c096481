"""Claims 3 and 4: each status is reached by slopes that deserve it."""

import copy

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.rates import chamfer_rate_verdict, holds, transport_rate_verdict


def row(shape, d, relation, p, slope, expected, half=0.01):
    dimension = d if shape == "cube" else 2
    sizes = {"sizes": [100, 1000], "error": [0.1, 0.01], "dimension": dimension}
    interval = {"slope": slope, "low": slope - half, "high": slope + half, "expected": expected}
    return {"shape": shape, "d": d, "relation": relation, "p": p} | sizes | interval


@pytest.fixture
def transport():
    pairs = [("cube", 3, "equal"), ("cube", 6, "equal")]
    return {
        "results": {
            "transport": [row(*pair, 2, -1 / pair[1], -1 / pair[1]) for pair in pairs],
            "sliced": [row(*pair, 2, -0.5, -0.5) for pair in pairs],
        }
    }


def test_an_interval_holds_what_lies_a_little_beyond_its_ends():
    found = row("cube", 3, "equal", 2, -0.4, None)
    assert holds(found, -0.345)
    assert holds(found, -0.455)
    assert not holds(found, -0.335)
    assert not holds(found, -0.465)


def test_rates_as_stated_are_reproduced(transport):
    verdict = transport_rate_verdict(transport)
    assert verdict.status == ledger.REPRODUCED
    assert "in 2 of 2 cases, pair × p (cube in R^3 equal, cube in R^6 equal), is undecided in 0 (none)" in verdict.ours
    assert "disconnected or symmetric: none" in verdict.ours
    assert verdict.numbers.count("\n") == 3


def test_a_pair_that_is_faster_or_slower_is_a_condition(transport):
    record = copy.deepcopy(transport)
    for kind, slope in (("transport", -0.5), ("sliced", -0.5)):
        record["results"][kind] += [row("ellipsoid", 6, "equal", 1, slope, -0.5)]
        record["results"][kind] += [row("two_cubes", 3, "equal", 2, -0.25, None)]
    verdict = transport_rate_verdict(record)
    assert verdict.status == ledger.IN_PART
    assert "faster in 1 (ellipsoid in R^6 equal), and slower in 1 (two cubes in R^3 equal)" in verdict.ours
    assert "and is slower on two cubes with p = 2 (slope −0.25)" in verdict.says
    assert "two cubes in R^3 equal, p = 2: −0.25 [−0.26, −0.24]" in verdict.ours


def test_an_interval_that_holds_the_stated_rate_and_that_of_theory_decides_nothing(transport):
    wide = row("two_cubes", 3, "equal", 2, -0.24, -0.25, half=0.06)
    transport["results"]["transport"].append(wide)
    transport["results"]["sliced"].append(row("two_cubes", 3, "equal", 2, -0.28, None))
    verdict = transport_rate_verdict(transport)
    assert verdict.headline[0] == "2 of 3"
    assert "is undecided in 1 (two cubes in R^3 equal), faster in 0 (none)" in verdict.ours
    without_theory = row("ellipsoid", 3, "translated", 1, -0.42, None, half=0.1)
    transport["results"]["transport"][-1] = without_theory
    transport["results"]["sliced"][-1] = row("ellipsoid", 3, "translated", 1, -0.5, None)
    assert "undecided in 1 (ellipsoid in R^3 translated)" in transport_rate_verdict(transport).ours


def test_a_sliced_slope_that_knows_the_dimension_is_a_failure(transport):
    transport["results"]["sliced"][1] = row("cube", 6, "equal", 2, -0.3, -0.5)
    assert transport_rate_verdict(transport).status == ledger.NOT_REPRODUCED


def test_no_pair_with_the_stated_rate_is_a_failure(transport):
    for found in transport["results"]["transport"]:
        found |= {"slope": -0.9, "low": -0.91, "high": -0.89}
    assert transport_rate_verdict(transport).status == ledger.NOT_REPRODUCED


@pytest.fixture
def chamfer():
    pairs = [("sphere", 3, "equal"), ("folded_mesh", 3, "other_surface"), ("cube", 6, "equal")]
    slopes = dict(zip(pairs, (-1.0, -0.5, -0.33), strict=True))
    rows = [row(*pair, 2, slope, slope) for pair, slope in slopes.items()]
    limits = [{"shape": s, "d": d, "relation": r, "limit": 0.1, "known_by": "quadrature"} for s, d, r in pairs]
    return {"results": {"chamfer": rows, "limits": limits}}


def test_a_rate_on_every_surface_refutes_the_claim(chamfer):
    verdict = chamfer_rate_verdict(chamfer)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "on 2 of 2 pairs" in verdict.ours
    assert "−1.00 to −1.00 where the surfaces are equal" in verdict.ours
    assert "6 dimensions −0.33 to −0.33" in verdict.ours
    assert verdict.numbers.count("\n") == 4


def test_an_interval_must_end_below_the_mark_not_only_begin_there(chamfer):
    chamfer["results"]["chamfer"][1] |= {"slope": -0.45, "low": -0.5, "high": -0.4}
    assert chamfer_rate_verdict(chamfer).status == ledger.IN_PART


def test_a_slow_surface_is_a_condition_and_slow_ones_only_bear_the_claim_out(chamfer):
    chamfer["results"]["chamfer"][1] |= {"slope": -0.3, "low": -0.31, "high": -0.29}
    assert chamfer_rate_verdict(chamfer).status == ledger.IN_PART
    chamfer["results"]["chamfer"][0] |= {"slope": -0.1, "low": -0.2, "high": 0.0}
    assert chamfer_rate_verdict(chamfer).status == ledger.REPRODUCED
