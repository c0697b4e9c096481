"""Measures without a floor on spheres, and the rules of the protocol on rows that decide them."""

from pathlib import Path

import numpy as np
import pytest
import scipy.stats

from meshot.mesh.shapes import icosphere
from meshot.metrics import Surface

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "new_heads"
COLUMNS = [("oasis_like", "left"), ("oasis_like", "right"), ("adni_like", "left"), ("adni_like", "right")]


def rows_of(judging, levels: dict[str, dict[str, float]], seeds: dict[str, int] | None = None) -> list[dict]:
    """Rows of eight subjects in all columns; an arm has the given mean in the named measures, and 1 in others."""
    rng, rows = np.random.default_rng(0), []
    for cohort, side in COLUMNS:
        for arm, own in levels.items():
            for seed in range((seeds or {}).get(arm, 3)):
                for subject in range(8):
                    row = {"cohort": cohort, "side": side, "subject": f"{subject}", "arm": arm, "seed": seed}
                    row |= {"protocol": "comparison/config", "budget": "steps", "which": "best"}
                    noise = rng.normal(0, 0.01)
                    rows.append(row | {m: own.get(m, 1.0) + noise for m in judging.MEASURES})
    return rows


def test_spheres_have_the_measures_of_the_closed_form(part, config):
    settings = config["evaluation"] | {"n_points": 4000}
    found = part("run").measures(icosphere(5, 33.0), Surface(icosphere(5, 30.0)), settings)
    for name, value in {"assd_mm": 3, "hausdorff90_mm": 3, "signed_mm": 3, "exact_sw_mm": 3 / 3**0.5}.items():
        assert found[name] == pytest.approx(value, rel=5e-3), name
    assert (found["beyond_percent"], found["crossing_percent"]) == (100, 0)
    assert part("run").measures(icosphere(5, 28.0), Surface(icosphere(5, 30.0)), settings)["signed_mm"] < -1.9
    same = part("run").measures(icosphere(5, 30.0), Surface(icosphere(5, 30.0)), settings)
    assert same["exact_sw_mm"] < 1e-12
    assert same["assd_mm"] < 1e-9


def test_an_interval_is_that_of_scipy(part):
    interval, rng = part("judging").interval, np.random.default_rng(1)
    a, b = rng.normal(0.3, 1, 9), rng.normal(0, 3, 5)
    one, two = ((x.var(ddof=1) / len(x), len(x) - 1) for x in (a, b))
    expected = scipy.stats.ttest_1samp(a, 0)
    found, wanted = interval(a.mean(), [one]), expected.confidence_interval(0.95)
    assert (found["low"], found["high"], found["p"]) == pytest.approx((wanted.low, wanted.high, expected.pvalue))
    expected = scipy.stats.ttest_ind(a, b, equal_var=False)
    found, wanted = interval(a.mean() - b.mean(), [one, two]), expected.confidence_interval(0.95)
    assert (found["low"], found["high"], found["p"]) == pytest.approx((wanted.low, wanted.high, expected.pvalue))


def test_p_values_are_adjusted_as_r_does(part):
    ps = [0.01, 0.04, 0.03, 0.005]
    gaps = [{"measure": "assd_mm", "gap": -1.0, "low": -2.0, "high": 0.0, "p": p} for p in ps]
    found = part("judging").decided(gaps)
    assert [row["adjusted_p"] for row in found] == pytest.approx([0.03, 0.06, 0.06, 0.02])  # p.adjust(ps, "holm")
    assert [row["first_is"] for row in found] == ["better", "undecided", "undecided", "better"]


def test_seeds_widen_an_interval_by_their_variance(part, config):
    judging = part("judging")
    rows = rows_of(judging, {"a": {}, "b": {"assd_mm": 1.1}})
    for row in rows:
        row["assd_mm"] += {0: -0.2, 1: 0.0, 2: 0.2}[row["seed"]] if row["arm"] == "a" else 0.0
    heads = judging.Heads(rows, {})
    assert heads.seed_variance("a", "assd_mm")[0] == pytest.approx(0.04, rel=0.1)
    assert heads.seed_variance("a", "assd_mm")[1] == 8
    gap = heads.gap("a", "b", COLUMNS[0], "assd_mm")
    assert gap["gap"] == pytest.approx(-0.1, abs=0.02)
    assert gap["low"] < 0 < gap["high"]


def test_a_winner_has_to_beat_all_rivals_in_all_measures(part):
    judging = part("judging")
    good = dict.fromkeys(judging.MEASURES, 0.5) | {"normals": 1.5}
    levels = {"local": good} | {rival: {} for rival in judging.RIVALS_25}
    assert judging.claim_25(judging.Heads(rows_of(judging, levels), {}), "local")["verdict"] == "holds"
    levels["cortexode_104mm"] = {"crossing_percent": 0.1}
    found = judging.claim_25(judging.Heads(rows_of(judging, levels), {}), "local")
    assert (found["verdict"], found["lost"]["cortexode_104mm"]) == ("in part", ["crossing_percent"])
    levels["ddot_104mm"] = dict.fromkeys(judging.MEASURES, 0.1) | {"normals": 9}
    assert judging.claim_25(judging.Heads(rows_of(judging, levels), {}), "local")["verdict"] == "fails"


def test_the_initial_surface_is_judged_by_the_rule_of_claim_13(part):
    judging = part("judging")
    levels = {"ddot": {"assd_mm": 0.5, "exact_sw_mm": 0.5}, "initial": {}, "ddot_104mm": {"assd_mm": 1.5}}
    levels |= {rival: {"assd_mm": 2.0, "exact_sw_mm": 2.0} for rival in judging.RIVALS_13}
    found = judging.claim_13(judging.Heads(rows_of(judging, levels), {}))
    assert found["verdict"] == "reproduced"
    assert found["counts_of_initial"]["better"] == 40
    levels["ddot"] = {"assd_mm": 1.5, "exact_sw_mm": 0.5}  # worse than the start
    found = judging.claim_13(judging.Heads(rows_of(judging, levels), {}))
    assert found["verdict"] == "not reproduced at this budget"
    assert found["counts"]["mm"]["better"] == 40


def test_crossing_faces_and_units_are_judged_by_reading(part):
    judging = part("judging")
    levels = {"ddot": {"crossing_percent": 0.5}, "cortexode": {}, "ddot_104mm": {"assd_mm": 2}, "cortexode_104mm": {}}
    heads = judging.Heads(rows_of(judging, levels), {})
    assert judging.claim_16(heads)["verdict"] == "not reproduced"
    for row in heads.rows:
        if row["arm"] == "ddot":
            row["crossing_percent"] = 0.0
    assert judging.claim_16(heads)["verdict"] == "depends on a choice left open"
    found = judging.claim_17(judging.Heads(rows_of(judging, levels), {}))
    assert found["verdicts"] == {"mm": "reproduced", "104 mm": "not reproduced"}
    levels["ddot"] |= {"assd_mm": 2}  # better in one measure, worse in another
    assert judging.claim_17(judging.Heads(rows_of(judging, levels), {}))["verdicts"]["mm"] == "not reproduced"


def test_pairs_are_judged_by_person(part):
    judging, rng, pairs = part("judging"), np.random.default_rng(0), []
    for arm in ("ddot", "ddot_104mm", "initial", *judging.RIVALS_13):
        for person in range(12):
            for side in ("left", "right"):
                value = (0.5 if arm == "ddot" else 1.0) + rng.normal(0, 0.01)
                row = {"subject": f"{person}", "side": side, "arm": arm, "budget": "steps", "which": "best"}
                pairs.append(row | {"protocol": "comparison/config"} | dict.fromkeys(judging.MEASURES, value))
    found = judging.claim_19(pairs)
    assert (found["verdict"], found["n_people"], found["gaps"]["ddot"][0]["n"]) == ("reproduced", 12, 12)
    assert found["counts"]["initial"]["better"] == 0
    near = [row | dict.fromkeys(judging.MEASURES, 0.1) if row["arm"] == "deepcsr" else row for row in pairs]
    assert judging.claim_19(near)["verdict"] == "not reproduced at this budget"
    same = [
        row | dict.fromkeys(judging.MEASURES, 0.5 + rng.normal(0, 0.1)) if row["arm"] == "deepcsr" else row
        for row in pairs
    ]
    assert judging.claim_19(same)["verdict"] == "in part"
