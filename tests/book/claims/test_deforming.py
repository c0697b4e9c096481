"""Claims 20 and 22: each status is reached by results that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.deforming import evenness_verdict, supports_verdict


def difference(at, low, high, encoding="varifold", target="folded", assd=(0.1, 0.2)):
    row = {"target": target, "start": "sphere", "encoding": encoding, "supports": "full", "at": at, "n_seeds": 5}
    for name in ("edge_variation", "area_variation"):
        row |= {f"{name}_low": low, f"{name}_high": high, f"{name}_gap": 0.05}
        row |= {f"{name}_chamfer": 0.3, f"{name}_sliced": 0.25}
    row |= {"assd_low": assd[0], "assd_high": assd[1], "assd_gap": 0.15, "assd_chamfer": 0.2, "assd_sliced": 0.05}
    return row


def of_differences(*rows):
    tried = [
        {"loss": "sliced", "encoding": encoding, "supports": "full", "learning_rate": rate, "assd": assd,
         "edge_variation": 0.2}
        for encoding, rate, assd in (("varifold", 0.3, 0.05), ("varifold", 0.1, 0.07), ("samples", 0.3, 0.9))
    ]  # fmt: skip
    return {"results": {"differences": list(rows), "rates": tried}}


def test_trials_of_learning_rates_are_listed():
    verdict = evenness_verdict(of_differences(*at_every_clock(0.1, 0.2)))
    assert verdict.ours.endswith("(varifold, one seed): sliced 0.3: 0.05 mm, 0.2; sliced 0.1: 0.07 mm, 0.2")


def at_every_clock(low, high, **options):
    return [difference(at, low, high, **options) for at in ("steps", "seconds", "closeness")]


def without_interval(target="fsaverage5_right"):
    """One seed: no interval, so that nothing is decided."""
    row = difference("steps", 0, 0, target=target)
    names = ("assd", "edge_variation", "area_variation")
    return row | {f"{name}_{end}": None for name in names for end in ("low", "high")}


def test_evenness_reproduced_where_every_comparison_says_so():
    verdict = evenness_verdict(of_differences(*at_every_clock(0.1, 0.2), without_interval()))
    assert verdict.status == ledger.REPRODUCED
    assert (
        "0.25 with sliced Wasserstein against 0.3 with Chamfer (sphere, varifold, all supports; equal steps)"
        in verdict.ours
    )
    assert "equal steps: 1 against 0 of 1; equal seconds: 1 against 0 of 1; equal closeness: 1 against 0 of 1" in (
        verdict.ours
    )
    assert "ends nearer in 2 and farther in 0 of 2" in verdict.ours
    assert verdict.numbers.count("\n") == 5
    assert "+0.05 |" in verdict.numbers.splitlines()[-1]


def test_evenness_in_part_where_sliced_wasserstein_leads_at_every_clock():
    rows = at_every_clock(0.1, 0.2) + at_every_clock(-0.1, 0.2, encoding="samples")
    assert evenness_verdict(of_differences(*rows)).status == ledger.IN_PART


def test_evenness_depends_on_the_choice_where_equal_closeness_reverses_it():
    rows = [*at_every_clock(0.1, 0.2)[:2], difference("closeness", -0.2, -0.1)]
    verdict = evenness_verdict(of_differences(*rows))
    assert verdict.status == ledger.CHOICE
    assert "At equal closeness it is 0 against 1" in verdict.says
    assert verdict.headline[0] == "0 of 1"


def test_comparisons_of_identical_meshes_are_counted():
    same = difference("closeness", 0, 0) | {"edge_variation_gap": 0.0, "area_variation_gap": 0.0}
    verdict = evenness_verdict(of_differences(*at_every_clock(0.1, 0.2), same))
    assert "At equal closeness it is 1 against 0 (1 of 2 compare identical meshes)." in verdict.says
    assert "equal closeness: 1 against 0 of 2 (1 of 2 compare identical meshes)." in verdict.ours
    assert "equal steps: 1 against 0 of 1;" in verdict.ours


def test_evenness_on_the_cortex_counts():
    rows = at_every_clock(0.1, 0.2)
    cortex = at_every_clock(-0.2, -0.1, target="fsaverage5_left")
    verdict = evenness_verdict(of_differences(*rows, *cortex))
    assert verdict.status == ledger.NOT_REPRODUCED
    assert "On the cortex alone 0 against 3 of 3" in verdict.ours


def test_evenness_needs_edges_and_areas():
    rows = [row | {"area_variation_low": -0.1} for row in at_every_clock(0.1, 0.2)]
    assert evenness_verdict(of_differences(*rows)).status == ledger.NOT_REPRODUCED


def test_evenness_farther_ends_are_counted():
    rows = at_every_clock(0.1, 0.2, assd=(-0.2, -0.1))
    assert "farther in 2 of 2" in evenness_verdict(of_differences(*rows)).ours


def supports(growth_of_all, growth_of_carried):
    growth = {"all": growth_of_all, "drawn": 1.5, "carried": growth_of_carried}
    costs = []
    for loss in ("sliced", "chamfer"):
        for variant in growth:
            for n_faces, share in ((320, 0.0), (5120, 1.0), (20480, growth[variant])):
                row = {"loss": loss, "variant": variant, "n_faces": n_faces, "step_bytes": 1e6 * share}
                costs.append(row | {"loss_bytes": 1e5, "step_seconds": 0.1, "loss_seconds": 0.05})
    fit = {"assd_mean": 0.03, "assd_sd": 0.001, "edge_variation_mean": 0.2, "edge_variation_sd": 0.01}
    fit |= {"intersecting_faces_mean": 0.0, "n_seeds": 5}
    fits = [{"variant": "all", "n_supports": 5120} | fit, {"variant": "drawn", "n_supports": 125} | fit]
    gap = {"variant": "drawn", "n_supports": 125, "n_seeds": 5, "assd_gap": 0.2, "assd_low": 0.1, "assd_high": 0.3}
    results = {"costs": costs, "fits": fits, "differences": [gap]}
    return {"results": results, "config": {"cost": {"n_supports": 2000}}}


@pytest.mark.parametrize(
    ("of_all", "of_carried", "status"),
    [(4.0, 1.0, ledger.ASSUMING), (4.0, 2.0, ledger.REPRODUCED), (1.0, 1.0, ledger.NOT_REPRODUCED)],
)
def test_supports(of_all, of_carried, status):
    verdict = supports_verdict(supports(of_all, of_carried))
    assert verdict.status == status
    begun = (
        f"From 5120 to 20480 faces the memory of a step grows by a factor of {of_all:g} (all faces), 1.5 (drawn after"
    )
    assert begun in verdict.ours
    assert (
        "0.03 mm with all 5120; with fewer, change [95 %] in mm: 125 drawn after the flow (+0.200 [+0.100, +0.300])"
        in verdict.ours
    )
    assert verdict.numbers.count("| drawn before the flow |") == 6
