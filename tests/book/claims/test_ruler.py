"""Verdicts on the ruler follow from numbers: each status is reached by results that deserve it."""

import pytest

from meshot_book.claims import ledger
from meshot_book.claims.rules.ruler import floor_verdict, table_verdict


def broken(n, names=("Table 1, ADNI left, A",)):
    return {"convention": "roots", "n_rows": 32, "n_broken": n, "broken": dict.fromkeys(names[: min(n, 1)], 1.5)}


def table(printed, swapped):
    pattern = {"cohort": "ADNI", "n_rows": 10, "emd_above_swd": 9, "emd_sd_below_swd_sd": 8, "exceptions": []}
    place = {"table": "Table 1", "part": "ADNI left", "column": "emd", "system": "A"}
    odd = [place | {"sd": 0.013, "next_sd": 0.13, "factor": 10}, place | {"sd": 0.5, "next_sd": 0.6, "factor": 1.2}]
    twice = [
        {"cell": "swd right sd", "table_1": 0.223, "table_3": 0.232, "equal": False},
        {"cell": "emd right sd", "table_1": 0.068, "table_3": 0.068, "equal": True},
    ]
    found = {"allowance": 1.38, "as_printed": [broken(n) for n in printed], "pattern": [pattern]}
    found |= {"oasis_exchanged": [broken(n) for n in swapped], "deviations": odd, "printed_twice": twice}
    return {"results": {"table": found}}


@pytest.mark.parametrize(
    ("printed", "swapped", "status"),
    [
        ([14, 12], [6, 2], ledger.NOT_REPRODUCED),
        ([14, 12], [6, 0], ledger.IN_PART),
        ([14, 0], [6, 2], ledger.REPRODUCED),
    ],
)
def test_the_columns(printed, swapped, status):
    verdict = table_verdict(table(printed, swapped))
    assert verdict.status == status
    assert f"14 of 32 break SW₂ ≤ W₂/√3, with the OASIS columns exchanged {swapped[0]} of 32" in verdict.ours
    assert "| Table 1, ADNI left: the smallest deviation of EMD | ± 0.013 (A) |" in verdict.numbers
    assert "± 0.5" not in verdict.numbers
    assert "0.223 (Table 1)" in verdict.numbers
    assert "0.068" not in verdict.numbers


def floors(*highs):
    readings = [
        {"reading": f"reading {i}", "low": 0.9 * high, "high": high, "unit": "mm", "how": "extrapolated"}
        for i, high in enumerate(highs)
    ]
    direct = [
        {"metric": metric, "at_target": {"measured": {"value": v, "low": v, "high": v}}}
        for metric, v in (("sw2", 0.2), ("point_to_point", 0.4), ("point_to_face", 3e-15))
    ]
    return {"results": {"readings": readings, "number_mm": 0.702, "floors": direct}}


@pytest.mark.parametrize(
    ("highs", "status"),
    [
        ((1.2, 0.9, 0.5), ledger.NOT_REPRODUCED),
        ((1.2, 0.9, 0.35), ledger.CHOICE),
        ((0.3, 0.2, 0.35), ledger.REPRODUCED),
    ],
)
def test_the_floor(highs, status):
    verdict = floor_verdict(floors(*highs))
    assert verdict.status == status
    assert "0.2 to 0.2 mm in SW₂" in verdict.ours
    assert "ASSD to the faces | 0 (rounding)" in verdict.numbers


def test_floors_above_the_number_are_counted():
    assert "above 0.702 mm in 2 of 3 readings" in floor_verdict(floors(1.2, 0.9, 0.5)).ours
