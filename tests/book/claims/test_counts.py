"""Claim 16: each status is reached by shares of crossing faces that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.counts import counts_verdict


def counts(single=7.7e-4, mean=1e-5, factors=(130.0, 40.0)):
    share = {"n_faces": 260_000, "smallest_nonzero_percent": single, "pairs_below_bound_over_scans": 10}
    share |= {"smallest_nonzero_mean_percent": mean}
    columns = [{"column": "c", "cortexode_percent": 0.01, "cortexode_faces": 26.0, "factor": f} for f in factors]
    found = {"typical_faces": 260_000, "bound_percent": 1e-4, "stated_factor": 100, "n_scans": 80}
    return {"results": {"counts": found | {"shares": [share], "factors": columns}}}


def flows(*columns):
    """Trained flows: per column the crossing faces of ours and of the rival, in per cent."""
    summary = []
    for k, (ours, rival) in enumerate(columns):
        for arm, share in (("ddot", ours), ("cortexode", rival), ("other", 50.0)):
            row = {"arm": arm, "cohort": "c", "side": str(k), "kind": "template", "seed": 0}
            row["flow_crossing_percent"] = {"mean": share}
            summary += [row, row | {"kind": "procedural", "flow_crossing_percent": {"mean": 70.0}}]
            summary += [row | {"seed": 1, "flow_crossing_percent": {"mean": 60.0}}]
    return {"config": {"comparison": {"ours": "ddot"}}, "results": {"summary": summary}}


def compared(*columns):
    """The same columns as lines of the comparison's table, with lines that do not count."""
    table = []
    for k, (ours, rival) in enumerate(columns):
        for arm, share in (("ddot", ours), ("cortexode", rival), ("vox2cortex", 50.0)):
            line = {"arm": arm, "cohort": "c", "side": str(k), "kind": "template", "budget": "steps"}
            line["crossing_percent"] = {"mean": share}
            table += [line, line | {"kind": "procedural", "crossing_percent": {"mean": 70.0}}]
            table += [line | {"budget": "seconds", "crossing_percent": {"mean": 60.0}}]
    return {"config": {"comparison": {"ours": "ddot"}}, "results": {"table_1": table}}


@pytest.mark.parametrize("trained_in", [flows, compared])
@pytest.mark.parametrize(
    ("record", "trained", "status"),
    [
        (counts(factors=(130.0, 120.0)), [(0.0, 2.0), (5e-5, 1.0)], ledger.REPRODUCED),
        (counts(), [(0.0, 2.0), (5e-5, 1.0)], ledger.IN_PART),
        (counts(factors=(130.0, 120.0)), [(0.0, 2.0), (0.03, 1.6)], ledger.IN_PART),
        (counts(factors=(130.0, 120.0)), [(0.03, 20.0), (5e-5, 1e-3)], ledger.NOT_REPRODUCED),
        (counts(factors=(130.0, 120.0)), [(0.0, 0.0)], ledger.NOT_REPRODUCED),
        (counts(), [], ledger.NOT_TESTED),
    ],
)
def test_counts(record, trained, status, trained_in):
    assert counts_verdict(record, trained_in(*trained)).status == status


@pytest.mark.parametrize("trained_in", [flows, compared])
def test_counts_are_said(trained_in):
    verdict = counts_verdict(counts(), trained_in((0.0, 2.33), (0.034, 1.62)))
    assert f"(experiments/{'ddot' if trained_in is flows else 'comparison'})" in verdict.ours
    assert "one crossing pair is 0.00077 %" in verdict.ours
    assert "100 or more in 1 of 2 columns" in verdict.ours
    assert "DDOT 0 | 0.034 %, CortexODE 2.33 | 1.62 %" in verdict.ours
    assert "both statements hold in 1 of 2 columns" in verdict.says
    assert verdict.headline[0] == "1 of 2"
    assert "| c, 1 | 0.034 | 1.62 |" in verdict.numbers
