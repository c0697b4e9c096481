"""Claim 26: one training in which the loss falls and the distance grows is enough to refute it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.own_loss import own_loss_verdict

NEARER, FARTHER = {"gap": -0.1, "low": -0.2, "high": -0.05}, {"gap": 0.1, "low": 0.05, "high": 0.2}
COUNTED = ("last", "test", "template")
OPEN = {"gap": -0.01, "low": -0.1, "high": 0.05}


def record(arms):
    """Results of a protocol: for every arm the system, the quotient of its loss, and the gap in ASSD."""
    means, differences = [], []
    for arm, (_, quotient, gap) in arms.items():
        for place in (COUNTED, ("best", "test", "template"), ("last", "train", "template"), ("last", "test", "other")):
            value = 3.0 * (quotient if place == COUNTED else 9.0)
            losses = {"loss_before": {"mean": 3.0}, "loss_after": {"mean": value}}
            means.append({"arm": arm} | dict(zip(("weights", "split", "kind"), place)) | losses)
        differences.append({"first": arm, "second": "start", "weights": "last", "assd_mm": gap})
        differences.append({"first": arm, "second": "start", "weights": "best", "assd_mm": OPEN})
    config = {"readings": {arm: {"title": f"the {arm}", "system": system} for arm, (system, _, _) in arms.items()}}
    trainings = [{"arm": arm, "n_steps": 1680} for arm in arms]
    return {"results": {"means": means, "differences": differences, "trainings": trainings}, "config": config}


def on_one_subject():
    rows = {"initial": (1.0, 0.3), "a": (0.1, 0.35), "b": (0.05, 0.25), "c": (0.01, 0.1), "d": (0.06, 0.2)}
    surfaces = [{"arm": arm, "sliced_20": loss, "assd_mm": distance} for arm, (loss, distance) in rows.items()]
    systems = {"a": "ddot", "b": "ddot", "c": "windows", "d": "ddot"}
    config = {"arms": {arm: {"system": system} for arm, system in systems.items()}}
    return {"results": {"surfaces": surfaces}, "config": config}


@pytest.mark.parametrize(
    ("arms", "status"),
    [
        ({"a": ("ddot", 0.5, NEARER), "b": ("ddot", 0.5, NEARER)}, ledger.REPRODUCED),
        ({"a": ("ddot", 0.5, NEARER), "b": ("ddot", 0.5, OPEN)}, ledger.IN_PART),
        ({"a": ("ddot", 0.5, NEARER), "b": ("ddot", 0.5, FARTHER)}, ledger.NOT_REPRODUCED),
        ({"a": ("ddot", 0.5, NEARER), "b": ("ddot", 1.1, FARTHER)}, ledger.REPRODUCED),  # its loss does not fall
        ({"a": ("ddot", 0.5, NEARER), "b": ("cortexode", 0.5, FARTHER)}, ledger.REPRODUCED),  # another loss
        ({"a": ("ddot", 1.1, FARTHER)}, ledger.NOT_TESTED),
    ],
)
def test_one_training_refutes_it(arms, status):
    assert own_loss_verdict(record(arms), record({}), on_one_subject()).status == status
    assert own_loss_verdict(record({}), record(arms), on_one_subject()).status == status


def test_it_counts_and_lists_the_trainings_of_both_protocols():
    readings = record({"a": ("ddot", 0.5, FARTHER), "b": ("cortexode", 0.4, NEARER), "c": ("ddot", 1.5, OPEN)})
    found = own_loss_verdict(readings, record({"long": ("ddot", 0.25, NEARER)}), on_one_subject())
    assert found.says == (
        "The loss of DDOT falls on new subjects in 2 of 3 trainings. In 1 of these the surfaces end farther from the "
        "truth in ASSD than they begin, and in 1 nearer."
    )
    assert found.headline[0] == "1 of 2"
    assert "the long, 1680 steps: loss × 0.25, ASSD -0.1 [-0.2, -0.05] mm" in found.ours
    assert "the b" not in found.ours
    assert found.ours.endswith("2 of 3 trainings end nearer than they begin, with loss × 0.05 to 0.1")
    assert found.numbers.split("\n")[2] == "| the a | 1680 | 0.5 | +0.1 [+0.05, +0.2] |"
    assert len(found.numbers.split("\n")) == 2 + 3
