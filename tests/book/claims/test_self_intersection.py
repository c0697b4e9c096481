"""Claim 12: each status is reached by counts that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.self_intersection import self_intersection_verdict


def fit(spacing, crossing, seed):
    row = {"pair": "small", "loss": "sliced", "encoding": "varifold", "spacing": spacing, "seed": seed, "assd": 0.2}
    row |= {"crossing": crossing}
    return row | ({"most_on_the_way": crossing, "step_times_lipschitz": 0.4} if spacing else {})


def carried(most, step_times_lipschitz=0.5, flips=0, way="euler"):
    row = {"way": way, "step_times_lipschitz": step_times_lipschitz, "flips": flips}
    return {"rows": [row | {"levels": {"2": {"end": 0, "most": 0}, "5": {"end": 0, "most": most}}}]}


@pytest.fixture
def record():
    fits = [fit(s, c, seed) for s, c in ((0.0, 40), (6.0, 0), (3.0, 8)) for seed in range(2)]
    return {"config": {"pairs": {"small": {"level": 3}}}, "results": {"fits": fits, "carried": [carried(3)]}}


def deformed(crossing):
    return {"end": {"intersecting_faces": crossing}}


def network(arm, percent):
    return {"arm": arm, "flow_crossing_percent": {"mean": percent, "sd": 0.0}}


def test_in_part_where_fewer_fits_cross_than_with_free_vertices(record):
    verdict = self_intersection_verdict(record)
    assert verdict.status == ledger.NOT_REPRODUCED  # two of four flows cross: not fewer than half
    record["results"]["fits"] += [fit(6.0, 0, 2)]
    verdict = self_intersection_verdict(record)
    assert verdict.status == ledger.IN_PART
    assert "in 1 of 2 meshes carried" in verdict.says
    assert "in 2 of 5 fits by flows, against 2 of 2 fits with free vertices" in verdict.says
    assert "0 of 3 with a finest grid of 6 mm, 2 of 2 with a finest grid of 3 mm" in verdict.ours
    assert "free vertices: 2 of 2 (up to 40 faces)" in verdict.ours
    assert "| small, 1280 faces | sliced Wasserstein, varifold | no flow | 40.0 ± 0.0 | 3.1 |  | 0.2 | 2 |" in (
        verdict.numbers
    )


def test_fits_of_other_experiments_count(record):
    verdict = self_intersection_verdict(record, {"results": {"fits": [deformed(0)] * 3}})
    assert verdict.status == ledger.IN_PART
    assert "2 of 7 fits by flows" in verdict.says
    verdict = self_intersection_verdict(record, {"results": {"fits": [deformed(7)] * 3}})
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "3 of 3 in the fits of chapter 21 (up to 7 faces)" in verdict.ours


def test_reproduced_where_nothing_crosses_under_a_flow(record):
    results = record["results"]
    results["fits"] = [row for row in results["fits"] if row["spacing"] != 3.0]
    results["carried"] = [carried(0)]
    assert self_intersection_verdict(record).status == ledger.REPRODUCED
    results["carried"] = [carried(3, step_times_lipschitz=1.2), carried(3, flips=1), carried(3, way="rk4")]
    assert self_intersection_verdict(record).status == ledger.REPRODUCED
    results["carried"] = [carried(1)]
    assert self_intersection_verdict(record).status == ledger.IN_PART


def test_a_network_whose_faces_cross_is_no_full_reproduction(record):
    results = record["results"]
    results["fits"] = [row for row in results["fits"] if row["spacing"] != 3.0]
    results["carried"] = [carried(0)]
    deforming = {"results": {"fits": [deformed(0)]}}
    summary = [network("ddot", 0.0), network("cortexode", 0.0), network("initial", 3.0)]
    ddot = {"results": {"summary": summary}}
    assert self_intersection_verdict(record, deforming, ddot).status == ledger.REPRODUCED
    summary.append(network("cortexode", 2.3))
    verdict = self_intersection_verdict(record, deforming, ddot)
    assert verdict.status == ledger.IN_PART
    assert "DDOT 0 to 0 %; CortexODE 0 to 2.3 %" in verdict.ours


def test_faces_that_cross_on_the_way_count(record):
    record["results"]["fits"] += [fit(6.0, 0, 2)]
    next(row for row in record["results"]["fits"] if row["spacing"] == 6.0)["most_on_the_way"] = 2
    verdict = self_intersection_verdict(record)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "1 of 3 with a finest grid of 6 mm" in verdict.ours


def test_a_flow_gets_no_credit_where_free_vertices_do_not_cross_either(record):
    record["results"]["fits"] += [fit(6.0, 0, 2)]
    for row in record["results"]["fits"]:
        row["crossing"] *= bool(row["spacing"])
    assert self_intersection_verdict(record).status == ledger.NOT_REPRODUCED
