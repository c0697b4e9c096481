"""Claim 25: each status is reached by differences that deserve it, through the tables of the experiment."""

from pathlib import Path

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.local import local_verdict
from scripts import scripts_in

FOLDER = Path(__file__).resolve().parents[3] / "experiments" / "comparison"
PLACES = [(cohort, side, budget, 0) for cohort in ("oasis_like", "adni_like") for side in ("left", "right")
          for budget in ("steps", "seconds")] + [("oasis_like", "left", "steps", seed) for seed in (1, 2)]  # fmt: skip
NOISE = (0.01, -0.01, 0.02, -0.02, 0.0)


def record(changes=None, places=PLACES, arms=("local", "cortexode")):
    """Five subjects in every place. ``changes`` are added to the distances of our loss, by place and measure."""
    rows = []
    for place in places:
        about = dict(zip(("cohort", "side", "budget", "seed"), place))
        for subject, noise in enumerate(NOISE):
            for arm in arms:
                ours = arm == arms[0]
                value = (0.2 if ours else 0.3) + noise * ours
                found = {"emd_mm": value, "swd_mm": value, "assd_mm": value, "hausdorff90_mm": value}
                found |= {"normals": 1 - value, "crossing_percent": value}
                if ours:
                    found = {key: each + (changes or {}).get((place, key), 0) for key, each in found.items()}
                counts = {"crossing_faces": 1, "euler_number": 2, "cpu_seconds": 1.0, "failed": None}
                rows.append(about | {"arm": arm, "subject": f"s{subject}", "kind": "template"} | found | counts)
    with scripts_in(FOLDER) as load:
        tables = load("tables")
        first = [row for row in rows if row["seed"] == 0]
        lines = [tables._line(part, tables.COLUMN) for part in tables.grouped(first, tables.COLUMN)]
        return {"results": {"table_1": lines, "direct": tables.direct(rows, [list(arms), ["windows", "cortexode"]])}}


def test_better_everywhere_is_reproduced():
    verdict = local_verdict(record())
    assert verdict.status == ledger.REPRODUCED
    assert verdict.headline[0] == "50 of 50"
    assert "oasis like, left: 0.2 against 0.3" in verdict.ours
    assert "| adni like, right | equal seconds | 0 | -0.1 [" in verdict.numbers
    assert verdict.numbers.count("equal steps") == 6


@pytest.mark.parametrize(
    ("changes", "status", "won"),
    [
        ({(PLACES[0], "assd_mm"): 0.1}, ledger.IN_PART, 49),  # undecided
        ({(PLACES[9], "crossing_percent"): 0.1}, ledger.IN_PART, 49),
        ({(PLACES[3], "normals"): -0.1}, ledger.IN_PART, 49),
        ({(PLACES[3], "normals"): -0.3}, ledger.AT_THIS_BUDGET, 49),  # worse
        ({(PLACES[0], "swd_mm"): 0.2}, ledger.AT_THIS_BUDGET, 49),
        ({(PLACES[0], "emd_mm"): 0.2}, ledger.REPRODUCED, 50),  # not one of the five
    ],
)
def test_one_exception_changes_the_status(changes, status, won):
    verdict = local_verdict(record(changes))
    assert (verdict.status, verdict.headline[0]) == (status, f"{won} of 50")


def test_a_pair_of_trainings_without_any_better_measure_is_no_part():
    measures = ("swd_mm", "assd_mm", "hausdorff90_mm", "crossing_percent")
    changes = {(PLACES[5], key): 0.1 for key in measures} | {(PLACES[5], "normals"): -0.1}
    assert local_verdict(record(changes)).status == ledger.AT_THIS_BUDGET


def test_other_systems_are_not_counted():
    verdict = local_verdict(record(arms=("windows", "cortexode")))
    assert verdict.status == ledger.NOT_TESTED
    assert verdict.says == "The winning loss is not measured beside Chamfer yet."
