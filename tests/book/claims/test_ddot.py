"""Claims 13 and 17: each status is reached by results that deserve it, also while networks are missing."""

from pathlib import Path

import pytest
import yaml

from meshot_book.claims import ledger
from meshot_book.claims.rules.ddot import METRICS, ablation_verdict, systems_verdict

OURS, RIVAL = {"gap": -0.1, "low": -0.2, "high": -0.05}, {"gap": 0.1, "low": 0.05, "high": 0.2}
OPEN = {"gap": 0.01, "low": -0.1, "high": 0.2}
COLUMNS = [(cohort, side) for cohort in ("oasis_like", "adni_like") for side in ("left", "right")]
ALL_OPEN = dict.fromkeys(METRICS, OPEN)
#: DDOT better in everything: the normals grow with quality.
ALL_OURS = dict.fromkeys(METRICS, OURS) | {"normals": RIVAL}

CONFIG = yaml.safe_load(
    (Path(__file__).resolve().parents[3] / "experiments" / "ddot" / "config.yaml").read_text(encoding="utf-8")
)


def difference(place, second, metrics):
    return {"cohort": place[0], "side": place[1], "first": "ddot", "second": second} | metrics


def results(differences, seeds=()):
    places = dict.fromkeys((d["cohort"], d["side"]) for d in differences)
    arms = dict.fromkeys(["initial", "ddot", *(d["second"] for d in differences)])
    value = {"mean": 0.25, "sd": 0.03}
    summary = [
        {"cohort": cohort, "side": side, "arm": arm, "seed": None if arm == "initial" else 0, "kind": kind}
        | dict.fromkeys(METRICS, value)
        for cohort, side in places for arm in arms for kind in ("template", "procedural")
    ]  # fmt: skip
    trainings = [{"n_steps": 3080, "n_weights": 29987}]
    found = {"differences": differences, "seeds": list(seeds), "summary": summary, "trainings": trainings}
    return {"results": found, "config": CONFIG}


def test_better_in_every_cell_holds_in_part():
    columns = [difference(place, "cortexode", ALL_OURS) for place in COLUMNS]
    both = difference(("oasis_like", "both"), "cortexode", dict.fromkeys(METRICS, RIVAL))
    seeds = [{"cohort": "oasis_like", "side": "left", "seeds": [0, 1]} | ALL_OURS]
    verdict = systems_verdict(results([*columns, both, difference(COLUMNS[0], "initial", ALL_OPEN)], seeds))
    assert verdict.status == ledger.IN_PART
    assert "in 4 of 4 columns: DDOT is better in 20 of 20 cells, CortexODE in 0" in verdict.ours
    assert "ASSD 4 : 0, Chamfer normals 4 : 0" in verdict.ours
    assert "oasis like, left: 0.25 against 0.25, initially 0.25" in verdict.ours
    assert verdict.numbers.count("\n") == 21
    assert verdict.numbers.count("-0.1 [-0.2, -0.05]") == 16 + 4


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ([{"normals": OURS}], ledger.IN_PART),
        ([{"normals": OURS}, {"normals": OURS}], ledger.AT_THIS_BUDGET),
        ([{"assd_mm": OPEN}], ledger.IN_PART),
        ([{"assd_mm": OPEN, "swd_mm": OPEN, "emd_mm": OPEN}], ledger.AT_THIS_BUDGET),
    ],
)
def test_one_lost_cell_of_twenty_is_granted_and_each_column_needs_a_distance(changes, status):
    changes = [*changes, *[{}] * (4 - len(changes))]
    columns = [difference(place, "cortexode", ALL_OURS | c) for place, c in zip(COLUMNS, changes, strict=True)]
    assert systems_verdict(results(columns)).status == status


def test_seeds_that_disagree_leave_a_cell_undecided():
    column = difference(COLUMNS[0], "cortexode", ALL_OURS)
    for over_seeds in (ALL_OPEN, dict.fromkeys(METRICS, RIVAL) | {"normals": OURS}):
        seeds = [{"cohort": "oasis_like", "side": "left", "seeds": [0, 1]} | over_seeds]
        verdict = systems_verdict(results([column], seeds))
        assert verdict.status == ledger.AT_THIS_BUDGET
        assert "in 1 of 4 columns: DDOT is better in 0 of 5 cells, CortexODE in 0" in verdict.ours
    elsewhere = [{"cohort": "oasis_like", "side": "right", "seeds": [0, 1]} | ALL_OPEN]
    assert systems_verdict(results([column], elsewhere)).status == ledger.IN_PART


def test_without_a_fair_pair_nothing_is_tested():
    verdict = systems_verdict(results([difference(COLUMNS[0], "initial", ALL_OURS)]))
    assert (verdict.status, verdict.numbers) == (ledger.NOT_TESTED, "")


def grid(initial=ALL_OURS, **arms):
    found = {"sliced_samples": ALL_OURS, "chamfer_varifold": ALL_OURS, "sinkhorn_varifold": ALL_OURS} | arms
    pairs = [difference(COLUMNS[0], "cortexode", dict.fromkeys(METRICS, RIVAL))]
    pairs.append(difference(COLUMNS[2], "initial", initial))
    return results(pairs + [difference(COLUMNS[2], arm, metrics) for arm, metrics in found.items() if metrics])


def test_ablation_holds_in_part():
    verdict = ablation_verdict(grid(sliced_surface=ALL_OPEN, cortexode=ALL_OPEN | {"assd_mm": RIVAL}))
    assert verdict.status == ledger.IN_PART
    assert verdict.ours.startswith("adni like, left, DDOT with one thing exchanged. samples for the varifold: worse in")
    assert "Chamfer for sliced Wasserstein: worse in EMD, SWD, ASSD, better in nothing" in verdict.ours
    assert "table: sliced, continuous surface: worse in nothing, better in nothing; Chamfer, sam" in verdict.ours
    assert "(CortexODE): worse in nothing, better in ASSD. ASSD in mm: DDOT 0.25, initially 0.25" in verdict.ours
    assert verdict.numbers.count("\n") == 1 + 7
    assert "| initial surface | 0.25 ± 0.03 |" in verdict.numbers


@pytest.mark.parametrize("arm", ["sliced_samples", "chamfer_varifold", "sinkhorn_varifold"])
def test_ablation_fails_by_one_exchange(arm):
    assert ablation_verdict(grid(**{arm: ALL_OPEN})).status == ledger.AT_THIS_BUDGET
    mixed = ALL_OURS | {"assd_mm": RIVAL}
    verdict = ablation_verdict(grid(**{arm: mixed}))
    assert verdict.status == ledger.AT_THIS_BUDGET
    assert "worse in EMD, SWD, better in ASSD" in verdict.ours
    assert ablation_verdict(grid(**{arm: ALL_OPEN | {"swd_mm": OURS}})).status == ledger.IN_PART


@pytest.mark.parametrize("initial", [ALL_OPEN, ALL_OURS | {"assd_mm": RIVAL}])
def test_a_loss_that_does_not_improve_the_initial_surface_is_no_better_choice(initial):
    verdict = ablation_verdict(grid(initial=initial))
    assert verdict.status == ledger.AT_THIS_BUDGET
    assert "the initial surface from which it starts" in verdict.says


def test_one_exchange_that_is_better_is_enough_while_others_are_missing():
    verdict = ablation_verdict(grid(sliced_samples=None, chamfer_varifold=ALL_OURS | {"assd_mm": RIVAL}))
    assert verdict.status == ledger.AT_THIS_BUDGET
    assert "Chamfer for sliced Wasserstein: worse in EMD, SWD, better in ASSD" in verdict.ours
    assert "; not trained yet: sliced, samples. ASSD in mm" in verdict.ours
    assert "samples for the varifold" not in verdict.ours
    assert verdict.numbers.count("\n") == 1 + 4


def test_ablation_says_what_is_missing():
    verdict = ablation_verdict(grid(chamfer_varifold=None))
    assert verdict.status == ledger.NOT_TESTED
    assert "Sinkhorn, on 500 faces, for sliced Wasserstein: worse in EMD, SWD, ASSD, better in nothing" in verdict.ours
    assert "; not trained yet: Chamfer, varifold. ASSD in mm" in verdict.ours
    assert verdict.numbers.count("\n") == 1 + 4
    verdict = ablation_verdict(results([]))
    assert verdict.status == ledger.NOT_TESTED
    assert verdict.ours.endswith("sliced, samples; Chamfer, varifold; Sinkhorn, varifold of 500")
