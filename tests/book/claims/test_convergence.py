"""The verdicts on the theorem and on random directions: every status is reached, by intervals."""

import copy

import pytest

from meshot_book.claims.ledger import ASSUMING, IN_PART, NOT_REPRODUCED, REPRODUCED
from meshot_book.claims.rules.convergence import directions_verdict, theorem_verdict

SIZE = {
    "pair": "generic", "d": 3, "p": 2, "slope": -0.5, "low": -0.52, "high": -0.48, "bound_slope": -0.43,
    "upper_slope": -0.5, "upper_low": -0.55, "upper_high": -0.45, "points": [100, 1000], "n_repetitions": [200, 30],
}  # fmt: skip
BOUND = {"slice_error": 1.0, "sharper": 2.0}
DISTANCE = {
    "n_points": 1000, "p": 2, "apart": [0, 10, 1000], "error": [1.0, 1.0, 1.1], "sharper": [5.0, 6.0, 9.0],
    "ratio": [1.0, 1.0, 1.1], "ratio_low": [1.0, 0.9, 0.9], "ratio_high": [1.0, 1.2, 1.3],
}  # fmt: skip
DIRECTION = {
    "case": "translation, d = 3", "p": 2, "mean": 48.0, "variance": 1843.2, "counts": [1, 10, 100],
    "constant": [1.2, 1.01, 0.99], "absolute_over_rms": [0.8, 0.8, 0.8], "slope": -0.5, "low": -0.51, "high": -0.49,
}  # fmt: skip


@pytest.fixture
def theorem():
    found = {"sizes": [SIZE], "bounds": [BOUND], "distance": [DISTANCE]}
    return {"results": copy.deepcopy(found)}


def test_theorem_as_it_stands(theorem):
    verdict = theorem_verdict(theorem)
    assert verdict.status == REPRODUCED
    assert "−0.50 [−0.52, −0.48]" in verdict.ours
    assert "holds throughout" in verdict.ours


def test_a_constant_that_grows_is_a_condition(theorem):
    theorem["results"]["distance"][0] |= {"ratio_low": [1.0, 1.1, 2.1], "ratio": [1.0, 1.5, 3.0]}
    verdict = theorem_verdict(theorem)
    assert verdict.status == ASSUMING
    assert "1000 mm apart err 3 times as much as concentric ones, and 2 times as much as 10 mm apart" in verdict.ours
    theorem["results"]["distance"][0]["p"] = 1
    assert theorem_verdict(theorem).status == REPRODUCED


def test_a_slope_that_may_be_too_flat_refutes(theorem):
    theorem["results"]["sizes"][0]["high"] = -0.42
    assert theorem_verdict(theorem).status == NOT_REPRODUCED


@pytest.mark.parametrize(
    ("part", "change"), [("bounds", {"slice_error": 2.1}), ("distance", {"error": [1.0, 1.0, 9.1]})]
)
def test_a_broken_bound_refutes(theorem, part, change):
    theorem["results"][part][0] |= change
    verdict = theorem_verdict(theorem)
    assert verdict.status == NOT_REPRODUCED
    assert "exceeded 1 times" in verdict.ours


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({}, REPRODUCED),
        ({"low": -0.521}, NOT_REPRODUCED),
        ({"high": -0.479}, NOT_REPRODUCED),
        ({"constant": [1.2, 1.06, 1.0]}, IN_PART),
        ({"constant": [1.2, 1.0, 0.94]}, IN_PART),
    ],
)
def test_directions(change, status):
    verdict = directions_verdict({"results": {"directions": [DIRECTION, DIRECTION | change]}})
    assert verdict.status == status
    assert "translation, d = 3" in verdict.numbers
