"""Each claim has words that its committed results bear out, and other results give it another status."""

import copy
import functools
import string

import pytest
import scipy.stats
import yaml

from meshot.provenance import read_results
from meshot_book.claims import (
    AT_THIS_BUDGET,
    CHOICE,
    IN_PART,
    NOT_REPRODUCED,
    NOT_TESTABLE,
    NOT_TESTED,
    PROVED,
    REPRODUCED,
    ledger,
)
from meshot_book.claims.rules import RULES

RIVALS = ["deepcsr", "vox2cortex", "corticalflow", "cortexode"]
MEASURES = ("assd_mm", "hausdorff90_mm", "swd_mm", "normals", "crossing_percent")
DISTANCES = ("emd_mm", "swd_mm", "assd_mm")


def to(*values):
    """A list of which the first items are kept, and the last ones have these values."""
    return lambda old: [*old[: len(old) - len(values)], *values]


def each(path, *keys, value):
    """The same value at several keys of a path."""
    return {path.format(key): value for key in keys}


# Results that other statuses deserve. A path leads through the results of the claim's experiment, or of a further one
# after its number and a colon: a key, an index, * for all, key=value for the rows of a list.
STEEP = {"transport/*/low": -2.0, "transport/*/high": 0.0}
CUBES = "transport/shape=two_cubes&p=2"
DUELS = {"duels/*/low": 2.0, "duels/*/high": 3.0}
SAME = {"differences/*/sw_surface_low": -1.0, "differences/*/sw_surface_high": 1.0}
CLEAN = {"fits/*/crossing": 0, "fits/*/most_on_the_way": 0, "fits/spacing=0.0/crossing": 40} | {
    "carried/*/rows/*/levels/*/most": 0,
    "1:fits/*/end/intersecting_faces": 0,
    "2:summary/*/flow_crossing_percent/mean": 0.0,
    "3:means/*/crossing_percent/mean": 0.0,
}
TREE, BRUTE = "cases/peer=Chamfer, k-d tree", "cases/peer=Chamfer, brute force"
CARRIED = {"carried/*/rows/*/levels/*/most": 3}
BEST = {"claims/best/*/ours": RIVALS, "claims/best/*/other": [], "claims/against_initial/*/assd_mm": "ours"} | {
    **each("differences/budget=seconds/{}/gap", *DISTANCES, value=-1.0),
    **each("seeds/arm=ddot/{}/means", *DISTANCES, value=[0.0, 0.0, 0.0]),
}
AGREE = {"claims/consistency/*/ours": RIVALS, "claims/consistency/*/other": []}
HELPS = {"1:decided/ddot_1mm/last/helps": True, "0:decided/*/last/beats": False}
EVEN = {
    f"differences/n_seeds={n}/{name}_variation_{end}": value
    for n in (3, 5)  # one seed has no interval
    for name in ("edge", "area")
    for end, value in (("low", 0.1), ("high", 0.2))
}
PAIR = "direct/first=local&second=cortexode&budget=seconds&cohort=adni_like&side=left"
WON = each("direct/first=local&second=cortexode/{}/better", *MEASURES, value="ours")
AFTER = [f"{k}:means/weights={which}/assd_mm/mean" for k in (0, 1, 2) for which in ("best", "last")]
ALONE = [f"3:surfaces/arm={arm}/assd_mm" for arm in ("ddot", "ddot_long", "ddot_half", "ddot_wide")]
NEARER, FARTHER = (dict.fromkeys(AFTER + ALONE, value) for value in (0.01, 9.0))
LAST = [
    f"2:means/arm=ddot_{name}&weights=last/crossing_percent/mean"
    for name in ("20mm", "1mm", "104mm", "binary", "constant", "all_faces")
]
LAST += [f"3:means/arm={arm}&weights=last/crossing_percent/mean" for arm in ("ddot_long", "ddot_wide")]
SMALL, CROSSING = (dict.fromkeys(LAST, value) for value in (0.0, 60.0))
CASES = [
    (1, {"differences/*/coverage_high": -0.1}, REPRODUCED),
    (1, {"differences/*/w2_low": -0.01}, NOT_REPRODUCED),
    (3, STEEP, REPRODUCED, "28 of 28"),  # what decides nothing contradicts nothing
    (3, {f"{CUBES}/expected": -1 / 3}, REPRODUCED, "28 of 28"),
    (3, {"transport/*/low": -0.91, "transport/*/high": -0.89}, REPRODUCED, "28 of 28"),  # all faster
    (3, {f"{CUBES}/low": -0.26}, NOT_REPRODUCED, "27 of 28"),
    (3, {"transport/0/low": -0.3, "transport/0/high": -0.2}, NOT_REPRODUCED, "27 of 28"),
    (3, {"sliced/0/low": -0.4, "sliced/0/high": -0.3}, NOT_REPRODUCED),
    (4, {"chamfer/shape=sphere/high": -0.4}, IN_PART),
    (4, {"chamfer/*/high": -0.4}, REPRODUCED),
    (4, {"chamfer/shape=cube/high": 0.0}, NOT_REPRODUCED),  # solids do not count
    (5, {"directions/1/low": -0.521}, NOT_REPRODUCED),
    (5, {"directions/1/high": -0.479}, NOT_REPRODUCED),
    (5, {"directions/1/constant": to(1.06)}, IN_PART),
    (5, {"directions/1/constant": to(0.94)}, IN_PART),
    (5, {"directions/1/constant/0": 1.2}, REPRODUCED),  # too few directions
    (6, {"time/ratio_to_exact/100000 points": 0.5}, IN_PART),
    (6, {"descent/encoding=continuous/end/sliced_distance": 100.0}, IN_PART),
    (6, {"accuracy/values/0/error": 0.01}, REPRODUCED),
    (6, {"accuracy/gradients/0/largest_relative_error": 0.01}, REPRODUCED),
    (7, DUELS, REPRODUCED, "248 of 248"),
    (7, DUELS | {"duels/0/low": 0.9}, IN_PART, "247 of 248"),
    (7, {"duels/*/low": 0.5, "duels/*/high": 0.9}, NOT_REPRODUCED),
    (8, {"pairs/*/rows/*/gradient_share": 0.5}, REPRODUCED),
    (8, {"pairs/0/rows/*/gradient_share": 0.99}, NOT_REPRODUCED),
    (8, {"pairs/pair=white and shifted/rows/*/gradient_share": 0.99}, CHOICE),  # it differs in positions only
    (9, SAME, REPRODUCED, "0 of 8"),
    (9, SAME | {"differences/0/sw_surface_low": 0.1}, CHOICE, "1 of 8"),
    (9, SAME | {"differences/0/sw_surface_high": -0.1}, CHOICE, "1 of 8"),
    (9, {"merging/0/pot_sorting": 1e-9}, NOT_REPRODUCED),
    (9, {"merging/0/scipy": 1e-9}, NOT_REPRODUCED),
    (10, {f"{TREE}/low": 1e4, f"{TREE}/high": 2e4}, REPRODUCED, "6 of 6"),
    (10, {f"{TREE}/seconds": 1e4}, IN_PART, "3 of 6"),  # ranges decide, not medians
    (10, {f"{TREE}/low": 1e-9, f"{TREE}/high": 2e-9}, IN_PART, "0 of 6"),
    (10, {f"{TREE}&m=100000/rounds": 1}, IN_PART, "1 of 4"),  # one call has no range
    (10, {f"{BRUTE}/low": 1e-9}, NOT_REPRODUCED),
    (10, {f"{BRUTE}&m=30000/low": 1e-9}, IN_PART),  # one call
    (10, {"exponents/peer=sliced, fused&quantity=seconds/exponent": 1.6}, NOT_REPRODUCED),
    (10, {"exponents/quantity=bytes/exponent": 9.0}, IN_PART),
    (12, CLEAN, REPRODUCED),
    (12, CLEAN | {"carried/*/rows/*/levels/*/most": 1}, IN_PART),
    (12, CLEAN | CARRIED | {"carried/*/rows/*/step_times_lipschitz": 1.2}, REPRODUCED, "0 of 0"),
    (12, CLEAN | CARRIED | {"carried/*/rows/*/flips": 1}, REPRODUCED, "0 of 0"),
    (12, CLEAN | CARRIED | {"carried/*/rows/*/way": "rk4"}, REPRODUCED, "0 of 0"),
    (12, CLEAN | {"fits/spacing=6.0/most_on_the_way": 2}, IN_PART),
    (12, CLEAN | {"2:summary/arm=cortexode/flow_crossing_percent/mean": 2.3}, IN_PART),
    (12, CLEAN | {"3:means/arm=ddot_long&weights=last&split=test/crossing_percent/mean": 0.42}, IN_PART),
    (12, CLEAN | {"3:means/arm=ddot_long&weights=best/crossing_percent/mean": 0.42}, REPRODUCED),
    (12, CLEAN | {"2:summary/arm=initial/flow_crossing_percent/mean": 2.3}, REPRODUCED),
    (12, {"1:fits/*/end/intersecting_faces": 7}, NOT_REPRODUCED),
    (12, {"fits/*/crossing": 5}, NOT_REPRODUCED),
    (12, {"fits/spacing=0.0/crossing": 0}, NOT_REPRODUCED),
    (13, BEST, REPRODUCED, "48 of 48"),
    (13, BEST | {"claims/best/0/ours": RIVALS[1:]}, IN_PART),
    (13, BEST | {"claims/best/0/other": ["cortexode"]}, AT_THIS_BUDGET),
    (13, BEST | {"claims/best/*/ours": []}, AT_THIS_BUDGET),
    (13, BEST | {"claims/against_initial/0/assd_mm": "undecided"}, AT_THIS_BUDGET),
    (13, BEST | {"differences/budget=seconds&second=deepcsr/swd_mm/gap": 0.1}, IN_PART),
    (13, BEST | {"seeds/arm=ddot/assd_mm/means/1": 99.0}, IN_PART),
    (13, BEST | {"seeds/arm=cortexode/arm": "another"}, IN_PART),
    (13, {"claims/best/0/missing": ["deepcsr"]}, NOT_TESTED),
    (14, {"table/oasis_exchanged/0/n_broken": 0}, IN_PART),
    (14, {"table/as_printed/1/n_broken": 0}, REPRODUCED),
    (14, {"table/as_printed/6/n_broken": 0}, REPRODUCED),  # the Sinkhorn divergence
    (15, {"readings/0/high": 0.35}, CHOICE),
    (15, {"readings/*/high": 0.35}, REPRODUCED),
    (15, {"readings/*/high": 0.36}, NOT_REPRODUCED),
    (15, {"readings/*/low": 0.34, "readings/*/high": 0.36}, NOT_TESTABLE),
    (16, SMALL | {"counts/factors/*/factor": 130.0}, REPRODUCED, "8 of 8"),
    (16, SMALL, IN_PART, "8 of 8"),  # the printed factor is not reached
    (16, {"counts/factors/*/factor": 130.0}, CHOICE, "2 of 8"),
    (16, CROSSING | {"1:table_1/arm=ddot/crossing_percent/mean": 0.5}, NOT_REPRODUCED, "0 of 8"),
    (16, CROSSING | {"1:table_1/arm=cortexode/crossing_percent/mean": 0.0}, NOT_REPRODUCED),
    (16, SMALL | {"1:table_1/arm=ddot&cohort=adni_like&side=left/crossing_percent/mean": 0.5}, CHOICE, "8 of 8"),
    (16, SMALL | {"1:table_1/arm=ddot&budget=steps/crossing_percent/mean": 5e-5}, IN_PART),
    (16, SMALL | {"1:table_1/budget=seconds/crossing_percent/mean": 60.0}, IN_PART),
    (16, {"1:table_1": []}, NOT_TESTED),
    (17, HELPS | {"1:decided/ddot_1mm/last/beats": True}, IN_PART, "1 of 6"),
    (17, HELPS, AT_THIS_BUDGET, "0 of 6"),
    (17, HELPS | {"1:decided/ddot_binary/last/beats": True}, AT_THIS_BUDGET, "0 of 6"),
    (17, HELPS | {"1:decided/ddot_1mm/best/beats": True}, AT_THIS_BUDGET, "0 of 6"),
    (17, HELPS | {"1:decided/ddot_1mm/last/beats": True, "0:decided/samples/last/beats": True}, AT_THIS_BUDGET),
    (17, HELPS | {"1:decided/ddot_1mm/last/beats": True, "0:decided/ddot_slow/last/beats": True}, IN_PART),
    (18, each("differences/loss=sinkhorn/{}_low", "w2_varifold", "sw2_surface", value=0.1), REPRODUCED, "7 of 7"),
    (18, {"differences/loss=sinkhorn/sw2_surface_low": -0.1}, NOT_REPRODUCED, "0 of 7"),
    (19, AGREE, REPRODUCED, "8 of 8"),
    (19, AGREE | {"claims/consistency/metric=swd_mm/other": RIVALS}, REPRODUCED, "8 of 8"),
    (19, AGREE | {"claims/consistency/metric=emd_mm/ours": RIVALS[1:]}, IN_PART, "7 of 8"),
    (19, AGREE | {"claims/consistency/metric=emd_mm/other": ["deepcsr"]}, AT_THIS_BUDGET),
    (19, AGREE | {"claims/consistency/*/ours": []}, AT_THIS_BUDGET),
    (19, {"claims/consistency/metric=emd_mm/missing": ["deepcsr"]}, NOT_TESTED),
    (20, {"costs/variant=all/step_bytes": 1e6}, NOT_REPRODUCED),
    (20, {"costs/variant=carried&n_faces=81920/step_bytes": 1e9}, REPRODUCED),
    (21, {"memory/peer=Sinkhorn, GeomLoss lazy&m=10000/bytes": 4e7}, REPRODUCED, "2"),  # 93-fold
    (21, {"memory/peer=Sinkhorn, GeomLoss lazy/bytes": 1e9}, NOT_REPRODUCED, "0"),  # large, but it does not grow
    (21, {"memory/peer=Sinkhorn, OTT lazy/bytes": 1.0}, NOT_REPRODUCED, "0.96"),  # left out
    (21, {"memory/peer=Sinkhorn, GeomLoss lazy/peer": "another"}, NOT_TESTABLE),
    (22, EVEN, REPRODUCED),
    (22, EVEN | {"differences/0/area_variation_low": -0.1}, IN_PART),
    (22, EVEN | each("differences/at=closeness&n_seeds={}/edge_variation_low", 3, 5, value=-0.1), CHOICE),
    (22, {key: -value for key, value in EVEN.items()}, NOT_REPRODUCED),
    (23, {f"{part}/*/fixed_draws/{end}": value for part in ("curve", "losses")
          for end, value in (("low", -1e3), ("high", 1e3))}, REPRODUCED),
    (23, {"descent/kind=samples, fixed draws&n_corners=6/sliced_distance": 0.2}, NOT_REPRODUCED),
    (25, WON, REPRODUCED, "50 of 50"),
    (25, WON | {f"{PAIR}/normals/better": "undecided"}, IN_PART, "49 of 50"),
    (25, WON | {f"{PAIR}/normals/better": "other"}, AT_THIS_BUDGET, "49 of 50"),
    (25, WON | {f"{PAIR}/emd_mm/better": "other"}, REPRODUCED, "50 of 50"),  # not one of the five
    (25, WON | each(PAIR + "/{}/better", *MEASURES, value="undecided"), AT_THIS_BUDGET, "45 of 50"),
    (25, {"direct": []}, NOT_TESTED),
    (26, NEARER, REPRODUCED, "0 of 52"),
    (26, NEARER | {"3:surfaces/arm=ddot_half/assd_mm": 9.0}, IN_PART, "0 of 52"),
    (26, FARTHER, NOT_REPRODUCED, "52 of 52"),
    (26, FARTHER | {"0:means/arm=ddot_1mm&weights=last&split=test/assd_mm/mean": 0.01}, IN_PART, "51 of 52"),
    (26, NEARER | {"0:means/arm=cortexode&weights=last/assd_mm/mean": 9.0}, REPRODUCED),  # another loss
    (26, {"0:means/arm=ddot_1mm&weights=last/loss_after/mean": 9e9}, IN_PART, "49 of 49"),  # a loss that grows
    (26, {f"{k}:means/weights={which}/loss_after/mean": 9e9 for k in (0, 1, 2) for which in ("best", "last")}
         | {place.replace("assd_mm", "sliced_20"): 9e9 for place in ALONE}, NOT_TESTED),
]  # fmt: skip
#: Results that leave the status, and deny what the words say without a number.
DENIALS = [
    (1, {"differences/0/w2_low": -1.0, "differences/*/coverage_high": -1.0}),
    (2, {"sizes/0/high": -0.4}),
    (2, {"bounds/0/slice_error": 1e9}),
    (2, {"distance/0/error": to(1e9)}),
    (2, {"distance/p=2/low": 0.1, "distance/p=2/high": 0.2}),  # with D in the error, as proved, the slope is one
    (2, {"distance/p=1/low": 0.9, "distance/p=1/high": 1.1}),
    (3, {"sliced/shape=two_cubes/low": -0.6}),
    (7, {"duels/*/high": 5.0}),
    (11, {"ghosts/0/own": 0.1}),
    (11, {"triangles/loss=SW₂/largest_found": 1.0001}),
    (11, {"triangles/loss=SW₂/n_broken": 1}),
    (11, {"triangles/loss=root of Chamfer/largest_found": 1.005}),
    (11, {"sequences/loss=SW₁/tends_to_zero": lambda old: not old}),
    (11, each("sequences/loss=root of Chamfer/{}", "tends_to_zero", "converges_weakly", value=True)),
    (18, {"differences/loss=sinkhorn/w2_varifold_high": 5.0}),
    (20, {"differences/variant=carried/assd_low": -1.0}),
    (21, {"memory/peer=Sinkhorn, OTT dense/bytes": 1e9}),
    (22, {"differences/*/edge_variation_gap": 1.0}),
    (24, {"summary/*/ratio_mean": 0.999}),
    (24, {"summary/*/ratio_mean": 0.9}),
    (24, {"summary/p=1/ratio_mean": 1.0}),
]
#: Results that say nothing about a theorem.
SILENCES = [
    (11, {"triangles/root=False/largest_found": 0.5}),
    (11, {"sequences/bounded=False/tends_to_zero": lambda old: not old}),
]


@pytest.fixture(scope="module")
def claims(root):
    return {row["id"]: row for row in yaml.safe_load((root / "book" / "claims.yaml").read_text(encoding="utf-8"))}


@pytest.fixture(scope="module")
def records(root, claims):
    """The records that a claim's rule reads."""
    read = functools.cache(lambda name: read_results(root / "experiments" / name / "results.json"))
    return lambda claim: [read(name) for name in (claims[claim]["experiment"], *claims[claim].get("also", []))]


def alter(found, path, value):
    """Set a value at every place of a path."""
    key, *rest = path
    if key == "*":
        keys = list(found) if isinstance(found, dict) else range(len(found))
    elif "=" in key:
        pairs = [pair.partition("=")[::2] for pair in key.split("&")]
        keys = [k for k, row in enumerate(found) if all(str(row.get(name)) == text for name, text in pairs)]
    else:
        keys = [int(key) if isinstance(found, list) else key]
    if rest:
        return sum(alter(found[key], rest, value) for key in keys)
    known = [key for key in keys if isinstance(found, list) or key in found]
    for key in known:
        found[key] = value(found[key]) if callable(value) else copy.deepcopy(value)
    return len(known)


def altered(records, edits):
    """The records with values set by path; every path leads somewhere."""
    found = [dict(record, results=copy.deepcopy(record["results"])) for record in records]
    for path, value in edits.items():
        number, _, own = path.rpartition(":")
        assert alter(found[int(number or 0)]["results"], own.split("/"), value), path
    return found


def roots(text):
    return {name.split("[")[0].split(".")[0] for _, name, _, _ in string.Formatter().parse(text) if name}


@pytest.mark.parametrize("number", RULES)
def test_the_words_have_every_number_of_the_committed_results(number, claims, records):
    claim, verdict = claims[number], RULES[number](*records(number))
    parts = ("number", "meaning", "says", "found", "rule")
    assert set().union(*(roots(claim[part]) for part in parts)) == set(verdict.numbers)
    assert roots(claim["number"]), "the headline is computed"


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]} {next(iter(case[1]))} {len(case[1])} {case[2]}")
def test_other_results_give_another_status(case, claims, records):
    number, edits, status, *headline = case
    verdict = RULES[number](*altered(records(number), edits))
    assert verdict.status == status
    if headline:
        assert ledger.fill(claims[number]["number"], verdict.numbers) == headline[0]
    if status != claims[number]["status"]:
        with pytest.raises(ValueError, match=f"claim {number} .*now say '{status}'"):
            ledger.Entry(claims[number], verdict, ())


def test_what_stays_decided_of_many_comparisons_is_found_step_by_step(records):
    """Holm's rule by its definition: the smallest p-values, as long as p is below 5 % over the tests that remain."""
    (record,) = records(25)
    gaps = [gap for gap in record["results"]["direct"] if (gap["first"], gap["second"]) == ("local", "cortexode")]
    scores = []
    for gap in gaps:
        for measure in MEASURES:
            of = gap[measure]
            error = (of["high"] - of["low"]) / 2 / scipy.stats.t.ppf(0.975, gap["n_shared"] - 1)
            p_value = 2 * scipy.stats.t.sf(abs(of["gap"]) / error, gap["n_shared"] - 1)
            scores.append((p_value, of["better"]))
    held = 0
    for left, (p_value, who) in zip(range(len(scores), 0, -1), sorted(scores)):
        if p_value >= 0.05 / left:
            break
        held += who == "ours"
    assert RULES[25](record).numbers["held"] == held == 45


def test_every_status_can_flip_but_that_of_a_theorem(claims):
    """What measurements cannot change is a theorem, and results that contradict it are an error."""
    flipped = {number for number, _, status, *_ in CASES if status != claims[number]["status"]}
    theorems = {number for number, claim in claims.items() if claim["status"] == PROVED}
    assert set(RULES) == set(claims)
    assert flipped == set(claims) - theorems
    assert theorems <= {number for number, _ in DENIALS}


def named(case):
    return f"{case[0]} {next(iter(case[1]))}"


@pytest.mark.parametrize("case", DENIALS, ids=named)
def test_results_that_deny_the_words_are_an_error(case, claims, records):
    number, edits = case
    verdict = RULES[number](*altered(records(number), edits))
    assert verdict.status == claims[number]["status"]
    with pytest.raises(ValueError, match=f"claim {number} .*deny a fact"):
        ledger.Entry(claims[number], verdict, ())


@pytest.mark.parametrize("case", SILENCES, ids=named)
def test_results_beside_a_theorem_leave_its_words(case, claims, records):
    number, edits = case
    ledger.Entry(claims[number], RULES[number](*altered(records(number), edits)), ())
