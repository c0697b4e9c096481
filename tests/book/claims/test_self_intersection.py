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
    """Edges are 6 mm long: cells of 12 mm are twice as wide."""
    fits = [fit(s, c, seed) for s, c in ((0.0, 40), (12.0, 0), (6.0, 8)) for seed in range(2)]
    pairs = {"small": {"level": 3, "radius": 40.0}}
    return {"config": {"pairs": pairs}, "results": {"fits": fits, "carried": [carried(3)]}}


def on_cortex(*counts):
    """Fits to a cortex, and one to another surface, which does not count."""
    rows = [{"target": "fsaverage5_left", "end": {"intersecting_faces": float(n)}} for n in counts]
    return {"results": {"fits": [*rows, {"target": "folded", "end": {"intersecting_faces": 9.0}}]}}


def trained(ours=0.0, rival=0.0):
    rows = [{"arm": arm, "flow_crossing_percent": {"mean": x}} for arm, x in (("a", ours), ("b", rival), ("c", 9.0))]
    return {"config": {"comparison": {"ours": "a", "rival": "b"}}, "results": {"summary": rows}}


def verdict_of(record, counts=(0,), **shares):
    return self_intersection_verdict(record, on_cortex(*counts), trained(**shares))


def test_in_part_where_only_wide_flows_leave_none(record):
    verdict = verdict_of(record, (0, 5), rival=2.3)
    assert verdict.status == ledger.IN_PART
    assert "in none of 2 fits by flows with cells about twice as wide as the edges" in verdict.says
    assert "faces cross in 1 of 2 carried meshes and in none of 2 fits by wide flows" in verdict.ours
    assert "up to 8 faces at 6 mm; up to 40 faces where vertices are free" in verdict.ours
    assert "fits to a cortex: 1 of 2; trained flows of DDOT, groups of held-out subjects: 0 of 1" in verdict.ours
    assert "trained flows of CortexODE, groups of held-out subjects: 1 of 1" in verdict.ours
    assert "| small, 1280 faces | sliced Wasserstein, varifold | no flow | 40.0 ± 0.0 | 3.1 |  | 0.2 | 2 |" in (
        verdict.numbers
    )


def test_reproduced_where_nothing_crosses_under_any_flow(record):
    results = record["results"]
    results["fits"] = [row for row in results["fits"] if row["spacing"] != 6.0]
    results["carried"] = [carried(0)]
    assert verdict_of(record).status == ledger.REPRODUCED
    results["carried"] = [carried(3, step_times_lipschitz=1.2), carried(3, flips=1), carried(3, way="rk4")]
    assert verdict_of(record).status == ledger.REPRODUCED
    assert verdict_of(record, (5,)).status == ledger.IN_PART
    assert verdict_of(record, ours=0.1).status == ledger.IN_PART
    results["carried"] = [carried(1)]
    assert verdict_of(record).status == ledger.IN_PART


def test_faces_that_cross_on_the_way_count(record):
    next(row for row in record["results"]["fits"] if row["spacing"] == 12.0)["most_on_the_way"] = 2
    verdict = verdict_of(record)
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "in 1 of 2 fits by wide flows; up to 2 faces at 12 mm, up to 8 faces at 6 mm" in verdict.ours


def test_a_flow_gets_no_credit_where_free_vertices_do_not_cross_either(record):
    for row in record["results"]["fits"]:
        row["crossing"] *= bool(row["spacing"])
    assert verdict_of(record).status == ledger.NOT_REPRODUCED


def test_no_wide_flow_proves_nothing(record):
    record["results"]["fits"] = [row for row in record["results"]["fits"] if row["spacing"] != 12.0]
    assert verdict_of(record).status == ledger.NOT_REPRODUCED
