"""The verdict on claim 11 follows from numbers: each status is reached by results that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.axioms import METRICS, axioms_verdict

FAILING = ("Sinkhorn, p = 1", "root of Sinkhorn, p = 2", "root of Chamfer")


def triangle(name, largest, root=True):
    ratio = {"largest_drawn": largest, "largest_found": largest}
    return {"loss": name, "root": root, "n_triples": 300, "n_broken": int(largest > 1)} | ratio


def sequence(name, loss, weakly, falls, bounded=True):
    shares = {"converges_weakly": weakly, "tends_to_zero": falls, "bounded": bounded}
    return {"sequence": name, "loss": loss, "values": [1.0, 0.1]} | shares


@pytest.fixture
def record():
    triangles = [triangle(name, 0.99) for name in METRICS] + [triangle(name, 1.3) for name in FAILING]
    triangles.append(triangle("W₂²", 2.0, root=False))
    sequences = [sequence("walk", loss, True, True) for loss in ("SW₁", "SW₂", "root of Chamfer")]
    sequences += [
        sequence("wrong", loss, False, loss == "root of Chamfer") for loss in ("SW₁", "SW₂", "root of Chamfer")
    ]
    sequences.append(sequence("flies", "SW₂", True, False, bounded=False))
    ghosts = [{"d": 2, "n_directions": 3, "n_points": 4, "own": 1e-17, "others": 0.4, "w2": 0.9}]
    results = {"triangles": triangles, "ghosts": ghosts, "sequences": sequences}
    return {"results": results, "config": {"tolerance": 1e-6}}


def test_finitely_many_directions_are_the_condition(record):
    verdict = axioms_verdict(record)
    assert verdict.status == ledger.ASSUMING
    assert "root of Chamfer: 1.3" in verdict.ours
    assert "1 of 1 constructions" in verdict.ours
    assert "W₂²" in verdict.numbers


def test_reproduced_if_no_ghosts_were_found(record):
    record["results"]["ghosts"][0]["own"] = 0.1
    assert axioms_verdict(record).status == ledger.REPRODUCED


@pytest.mark.parametrize(
    "spoil",
    [
        lambda r: r["triangles"][1].update(largest_found=1.0001),
        lambda r: r["triangles"][1].update(n_broken=1),
        lambda r: r["triangles"][4].update(largest_found=1.0),
        lambda r: r["triangles"][6].update(largest_found=1.005),
        lambda r: r["sequences"][0].update(tends_to_zero=False),
        lambda r: r["sequences"][4].update(tends_to_zero=True),
        lambda r: r["sequences"][5].update(tends_to_zero=False),
    ],
)
def test_not_reproduced_if_one_part_fails(record, spoil):
    spoil(record["results"])
    assert axioms_verdict(record).status == ledger.NOT_REPRODUCED
