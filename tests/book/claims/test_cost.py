"""Claims 10 and 21: every status from made-up records."""

import pytest

from meshot_book.claims.ledger import IN_PART, NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED
from meshot_book.claims.rules.cost import BRUTE, OURS, TREE, memory_verdict, speed_verdict


def speed_record(tree=2.0, brute=50.0, exponent=1.1):
    cases = []
    for d in (3, 6):
        for m in (1000, 10_000, 100_000):
            ours = 1e-6 * m
            # Below the smallest size nothing counts.
            factors = {OURS: 1.0, TREE: tree if m > 1000 else 0.1, BRUTE: brute if m > 1000 else 0.1}
            cases += [{"peer": p, "d": d, "m": m, "seconds": ours * factor} for p, factor in factors.items()]
    exponents = [{"peer": OURS, "d": d, "quantity": "seconds", "exponent": exponent} for d in (3, 6)]
    exponents += [{"peer": OURS, "d": 6, "quantity": "bytes", "exponent": 9.0}]
    return {"results": {"cases": cases, "exponents": exponents}, "config": {"n_directions": 100}}


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({}, REPRODUCED),
        ({"tree": 0.9}, IN_PART),
        ({"brute": 0.9}, NOT_REPRODUCED),
        ({"exponent": 1.6}, NOT_REPRODUCED),
    ],
)
def test_speed(change, status):
    verdict = speed_verdict(speed_record(**change))
    assert verdict.status == status
    assert "m = 100000 (s)" in verdict.numbers


def test_speed_says_by_how_much():
    said = speed_verdict(speed_record(tree=0.9)).ours
    assert "1.1 (d = 3)" in said
    assert "50× the time" in said
    assert "0.9× with a k-d tree" in said


def memory_record(lazy, kinds=("dense", "lazy")):
    amounts = {"dense": {1000: 8e6, 10_000: 8e8}, "lazy": {1000: 8e6, 10_000: lazy}}
    memory = [
        {"peer": f"Sinkhorn, GeomLoss {kind}", "d": 3, "m": m, "bytes": used}
        for kind in kinds
        for m, used in amounts[kind].items()
    ]
    memory.append({"peer": OURS, "d": 3, "m": 10_000, "bytes": 1e6})
    return {"results": {"memory": memory}}


@pytest.mark.parametrize(("lazy", "status"), [(1e7, NOT_REPRODUCED), (3e8, IN_PART), (7e8, REPRODUCED)])
def test_memory(lazy, status):
    verdict = memory_verdict(memory_record(lazy))
    assert verdict.status == status
    assert "m = 10000: 800 MB dense" in verdict.ours.replace("8e+02", "800")
    assert OURS not in verdict.numbers


def test_memory_without_a_lazy_variant():
    verdict = memory_verdict(memory_record(1e7, ("dense",)))
    assert verdict.status == NOT_TESTABLE
    assert "no lazy" in verdict.ours
