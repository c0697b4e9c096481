"""Claims 13 and 19: each status is reached by rows that deserve it, through the tables of the experiment."""

from pathlib import Path

import pytest
import yaml

from meshot_book.claims import ledger
from meshot_book.claims.rules.comparison import consistency_verdict, systems_verdict
from scripts import scripts_in

FOLDER = Path(__file__).resolve().parents[3] / "experiments" / "comparison"
CONFIG = yaml.safe_load((FOLDER / "config.yaml").read_text(encoding="utf-8"))
COLUMNS = [(cohort, side) for cohort in ("oasis_like", "adni_like") for side in ("left", "right")]
RIVALS = CONFIG["comparison"]["rivals"]
NOISE = (0.01, -0.01, 0.02, -0.02, 0.0)
#: Distances of all systems if every one is as the paper says.
AS_THE_PAPER = dict.fromkeys(RIVALS, 0.3) | {"ddot": 0.2, "windows": 0.1, "classical": 0.4}


def row(column, arm, subject, value, budget="steps", seed=0):
    found = {"cohort": column[0], "side": column[1], "subject": f"s{subject}", "kind": "template", "arm": arm}
    found |= {"budget": budget, "seed": seed, "failed": None, "cpu_seconds": 1.0, "crossing_faces": 0}
    found |= {"emd_mm": 5 * value, "swd_mm": 2 * value, "assd_mm": value, "hausdorff90_mm": 2 * value}
    return found | {"normals": 1 - value, "crossing_percent": 0.0, "euler_number": 2}


def rows(changes=None, seconds=None, seeds=None, initial=0.5):
    """Rows of five subjects a column: ``changes`` by (column, arm), ``seconds`` by arm, ``seeds`` by arm and seed."""
    changes, found = changes or {}, []
    for subject, noise in enumerate(NOISE):
        for column in COLUMNS:
            found += [row(column, "initial", subject, initial + noise, None, None)]
            found += [row(column, "perfect", subject, 0.0, None, None)]
            for arm, value in AS_THE_PAPER.items():
                own = noise if arm == "ddot" else -noise
                found.append(row(column, arm, subject, changes.get((column, arm), value) + own))
                if arm in RIVALS:
                    found.append(row(column, arm, subject, (seconds or {}).get(arm, 0.3) - noise, "seconds"))
        for arm in ("ddot", *RIVALS):
            for seed in (1, 2):
                value = (seeds or {}).get((arm, seed), AS_THE_PAPER[arm])
                found.append(row(COLUMNS[0], arm, subject, value + noise, seed=seed))
    return found


def pairs(values):
    """Rows of five pairs of scans, by arm."""
    return [
        row(("", side), arm, subject, value + (noise if arm == "ddot" else -noise))
        | {"session": 1, "icp_residue_mm": 0.05, "rigid_residue_mm": 0.2}
        for subject, noise in enumerate(NOISE) for side in ("left", "right") for arm, value in values.items()
    ]  # fmt: skip


def record(subjects, of_pairs=()):
    with scripts_in(FOLDER) as load:
        found = load("tables").tables(subjects, list(of_pairs), CONFIG)
    return {"results": found | {"n_pairs": 5}, "config": CONFIG}


def test_best_everywhere_is_reproduced():
    verdict = systems_verdict(record(rows()))
    assert verdict.status == ledger.REPRODUCED
    assert verdict.headline[0] == "48 of 48"
    assert "Vox2Cortex 12 : 0" in verdict.ours
    assert "oasis like, left: initial surface 0.5, DDOT 0.2, DeepCSR 0.3" in verdict.ours
    assert "| adni like, right | floor: a perfect surface | 0 ± 0 | 0 ± 0 | 0 ± 0 | 1 ± 0 | 0 ± 0 | 5 | 0 |" in (
        verdict.numbers
    )
    assert "| oasis like, left | CortexODE | equal steps | -0.5 [" in verdict.numbers


@pytest.mark.parametrize(
    ("given", "status"),
    [
        ({"changes": {(COLUMNS[2], "cortexode"): 0.2}}, ledger.IN_PART),  # undecided there
        ({"changes": {(COLUMNS[2], "cortexode"): 0.1}}, ledger.AT_THIS_BUDGET),  # better there
        ({"changes": {(COLUMNS[2], "windows"): 0.1}}, ledger.REPRODUCED),  # not one of the paper's
        ({"seconds": {"deepcsr": 0.19}}, ledger.IN_PART),
        ({"seeds": {("deepcsr", 2): 0.19}}, ledger.IN_PART),
        ({"seeds": {("ddot", 1): 0.31}}, ledger.IN_PART),
        ({"initial": 0.2}, ledger.AT_THIS_BUDGET),
        ({"initial": 0.1}, ledger.AT_THIS_BUDGET),
        ({"changes": {(c, arm): 0.2 for c in COLUMNS for arm in RIVALS}}, ledger.AT_THIS_BUDGET),
    ],
)
def test_one_exception_changes_the_status(given, status):
    assert systems_verdict(record(rows(**given))).status == status


def test_the_distances_are_counted_apart():
    # One rival of four is nearer in every column and distance.
    verdict = systems_verdict(record(rows(changes={(c, "cortexode"): 0.01 for c in COLUMNS})))
    assert "in 36 of 48 comparisons and worse in 12 (EMD: 12, 4). In ASSD" in verdict.says
    assert "The same by distance: EMD 12 : 4, SWD 12 : 4, ASSD 12 : 4. EMD has 2000 points" in verdict.ours


def test_nearness_to_the_start_is_counted():
    verdict = systems_verdict(record(rows(initial=0.1)))
    assert "In ASSD it ends farther from the truth than the initial surface in 4 of 4 columns, and in" in verdict.says
    assert verdict.says.endswith("in SWD nearer in 0 of 4.")
    assert systems_verdict(record(rows(initial=0.9))).says.endswith(
        "surface in 0 of 4 columns, and in SWD nearer in 4 of 4."
    )


@pytest.mark.parametrize("value", [0.01, 0.9])
def test_seeds_on_the_other_side_are_left_out(value):
    other = [row(COLUMNS[1], "deepcsr", s, value + NOISE[s], seed=seed) for s in range(5) for seed in (1, 2)]
    assert systems_verdict(record(rows() + other)).status == ledger.REPRODUCED
    left = {("deepcsr", 2): 0.19}
    assert systems_verdict(record(rows(seeds=left) + other)).status == ledger.IN_PART


def test_missing_systems_are_named():
    there = [each for each in rows() if (each["arm"], each["side"]) != ("deepcsr", "right")]
    verdict = systems_verdict(record(there))
    assert verdict.status == ledger.NOT_TESTED
    assert verdict.says == "Not all systems are measured in every column yet: DeepCSR."


@pytest.mark.parametrize(
    ("values", "status"),
    [
        ({}, ledger.REPRODUCED),
        ({"classical": 0.1, "windows": 0.1}, ledger.REPRODUCED),
        ({"deepcsr": 0.2}, ledger.IN_PART),
        ({"deepcsr": 0.1}, ledger.AT_THIS_BUDGET),
        (dict.fromkeys(RIVALS, 0.2), ledger.AT_THIS_BUDGET),
    ],
)
def test_consistency(values, status):
    verdict = consistency_verdict(record(rows(), pairs(AS_THE_PAPER | values)))
    assert verdict.status == status


def test_consistency_states_the_residue_of_the_alignment():
    verdict = consistency_verdict(record(rows(), pairs(AS_THE_PAPER)))
    assert verdict.headline[0] == "8 of 8"
    assert "EMD: better than DeepCSR, Vox2Cortex, CorticalFlow++, CortexODE, worse than none" in verdict.ours
    assert "error of its motion (mm)" in verdict.numbers
    assert "| DDOT | 1 ± 0.079 | 0.4 ± 0.032 | 0.2 ± 0.016 | 0.05 ± 0 | 0.2 ± " in verdict.numbers


def test_missing_pairs_are_not_a_result():
    verdict = consistency_verdict(record(rows()))
    assert verdict.status == ledger.NOT_TESTED
    assert verdict.says.startswith("Not all systems are measured on the pairs yet: DeepCSR, Vox2Cortex")
