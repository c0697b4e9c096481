"""Rows of measured surfaces: values by their names, groups in order, spreads of NumPy, gaps of a paired t-test."""

import numpy as np
import pytest
from scipy import stats

from meshot.mesh import icosphere
from meshot.metrics import evaluate
from meshot_book.measurements import COMPARED, METRICS, digest_of, grouped, metric_values, paired_gaps, spread

ROWS = [
    {"arm": arm, "side": side, "assd_mm": value} for arm, side, value in [("b", 1, 3.0), ("a", 1, 1.0), ("b", 2, 5.0)]
]


def test_the_values_of_a_surface_have_their_units_in_the_names():
    found = evaluate(icosphere(3, 38.0), icosphere(3, 40.0), n_points=4000, n_emd_points=300)
    values, floors = metric_values(found), metric_values(found, "floor")
    assert list(values) == list(METRICS) == list(floors)
    assert set(COMPARED) < set(values)
    assert values["assd_mm"] == pytest.approx(2.0, rel=0.02)
    assert floors["assd_mm"] < 1.0
    assert (values["euler_number"], values["crossing_faces"]) == (2, 0)


def test_groups_have_the_order_of_their_first_rows():
    assert grouped(ROWS, ("arm",)) == [[ROWS[0], ROWS[2]], [ROWS[1]]]
    assert grouped(iter(ROWS), iter(("arm", "side"))) == [[row] for row in ROWS]
    assert grouped([], ("arm",)) == []


def test_a_spread_has_no_deviation_of_one_value_and_no_mean_of_none():
    values = [1.0, 4.0, 4.5]
    assert spread(values) == {"mean": pytest.approx(np.mean(values)), "sd": pytest.approx(stats.tstd(values))}
    assert spread([2.0]) == {"mean": 2.0, "sd": None}
    assert spread([]) == {"mean": None, "sd": None}


def test_gaps_are_those_of_a_paired_t_test():
    rng = np.random.default_rng(0)
    first = {k: {"emd_mm": rng.normal(), "swd_mm": rng.normal(), "more": None} for k in range(7)}
    second = {k: {"emd_mm": rng.normal(), "swd_mm": rng.normal()} for k in (9, 5, 3, 1, 2)}
    found = paired_gaps(first, second, ("emd_mm", "swd_mm"))
    for metric, gap in found.items():
        one, other = ([rows[k][metric] for k in (1, 2, 3, 5)] for rows in (first, second))
        interval = stats.ttest_rel(one, other).confidence_interval()
        assert gap == pytest.approx({"gap": np.mean(one) - np.mean(other), "low": interval.low, "high": interval.high})
    assert list(found) == ["emd_mm", "swd_mm"]


def test_one_pair_has_no_interval():
    rows = {k: {"assd_mm": float(k)} for k in range(3)}
    assert paired_gaps(rows, {2: {"assd_mm": 1.0}}, ("assd_mm",)) == {}
    assert paired_gaps(rows, {}, ("assd_mm",)) == {}


def test_a_digest_depends_on_names_contents_and_order(tmp_path):
    one, other = tmp_path / "one", tmp_path / "other"
    one.write_bytes(b"1")
    other.write_bytes(b"1")
    digests = [digest_of(paths) for paths in ([one, other], [other, one], [one])]
    other.write_bytes(b"2")
    digests.append(digest_of([one, other]))
    assert len(set(digests)) == 4
    assert all(len(digest) == 12 for digest in digests)
