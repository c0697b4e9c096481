"""Claim 17: each status is reached by results that deserve it, also while networks are missing."""

from pathlib import Path

import pytest
import yaml

from meshot_book.claims import ledger
from meshot_book.claims.rules.ddot import METRICS, ablation_verdict

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


def results(differences):
    places = dict.fromkeys((d["cohort"], d["side"]) for d in differences)
    arms = dict.fromkeys(["initial", "ddot", *(d["second"] for d in differences)])
    value = {"mean": 0.25, "sd": 0.03}
    summary = [
        {"cohort": cohort, "side": side, "arm": arm, "seed": None if arm == "initial" else 0, "kind": kind}
        | dict.fromkeys(METRICS, value)
        for cohort, side in places for arm in arms for kind in ("template", "procedural")
    ]  # fmt: skip
    return {"results": {"differences": differences, "summary": summary}, "config": CONFIG}


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
