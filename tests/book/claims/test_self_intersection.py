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


def test_a_condition_where_only_coarse_flows_leave_none(record):
    verdict = self_intersection_verdict(record)
    assert verdict.status == ledger.IN_PART
    assert "faces cross in 1 of 2 carried meshes; none in any fit by flows with a finest grid of 6 mm" in verdict.ours
    assert "up to 8 faces at 3 mm; up to 40 faces where vertices are free" in verdict.ours
    assert "| small, 1280 faces | sliced Wasserstein, varifold | no flow | 40.0 ± 0.0 | 3.1 |  | 0.2 | 2 |" in (
        verdict.numbers
    )


def test_reproduced_where_nothing_crosses_under_a_flow(record):
    results = record["results"]
    results["fits"] = [row for row in results["fits"] if row["spacing"] != 3.0]
    results["carried"] = [carried(0)]
    assert self_intersection_verdict(record).status == ledger.REPRODUCED
    results["carried"] = [carried(3, step_times_lipschitz=1.2), carried(3, flips=1), carried(3, way="rk4")]
    assert self_intersection_verdict(record).status == ledger.REPRODUCED
    results["carried"] = [carried(1)]
    assert self_intersection_verdict(record).status == ledger.IN_PART


def test_faces_that_cross_on_the_way_count(record):
    next(row for row in record["results"]["fits"] if row["spacing"] == 6.0)["most_on_the_way"] = 2
    verdict = self_intersection_verdict(record)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "some in fits by every flow; up to 2 faces at 6 mm; up to 8 faces at 3 mm" in verdict.ours


def test_a_flow_gets_no_credit_where_free_vertices_do_not_cross_either(record):
    for row in record["results"]["fits"]:
        row["crossing"] *= bool(row["spacing"])
    assert self_intersection_verdict(record).status == ledger.NOT_REPRODUCED
