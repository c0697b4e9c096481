"""The floors: small slices make some of the committed numbers again."""

import math
from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "floors"


def row_of(record, metric, surface="white left", setting=None):
    rows = record["results"]["floors"]
    (row,) = [r for r in rows if (r["metric"], r["surface"], r["setting"]) == (metric, surface, setting or {})]
    return row


def values(row, m):
    (group,) = [group for group in row["measured"] if group["m"] == m]
    return group["values"]


@pytest.mark.parametrize(
    ("metric", "m", "surface", "setting"),
    [
        ("exact_w2", 500, "white left", {}),
        ("exact_w2", 500, "pial right", {}),
        ("exact_w1", 1000, "white left", {}),
        ("sw2", 10_000, "pial left", {}),
        ("point_to_point", 10_000, "white right", {}),
        ("sinkhorn", 1000, "white left", {"blur": 0.05, "debias": True}),
    ],
)
def test_a_committed_value_is_made_again(record, part, metric, m, surface, setting):
    task = {"metric": metric, "m": m, "surface": surface.split(), "seed": 1, "setting": setting, "scaling": 0.5}
    found = part("run").measured(task)
    assert found == pytest.approx(values(row_of(record, metric, surface, setting), m)[1], rel=1e-5)


def test_laws_pass_through_what_obeys_them(part):
    laws = part("run")
    power = {m: [3 * m**-0.4] * 4 for m in (100, 1000, 10_000)}
    assert laws.power_law(power, 100_000) == pytest.approx(3 * 1e5**-0.4)
    area, c = 50_000.0, -0.7
    matched = {m: [math.sqrt(area * (math.log(m) + c) / (2 * math.pi * m))] * 3 for m in (1000, 8000)}
    wanted = math.sqrt(area * (math.log(1e5) + c) / (2 * math.pi * 1e5))
    assert laws.matching_law(area)(matched, 100_000) == pytest.approx(wanted)
    found = laws.with_interval(laws.power_law, power, 100_000, 20, 0)
    assert found["low"] == pytest.approx(found["high"]) == pytest.approx(found["value"])


def test_readings_follow_from_the_floors(record, part):
    results = record["results"]
    assert part("run").paper_number() == results["number_mm"] == 0.702
    again = part("run").emd_readings(results["floors"], record["config"]["from_m"])
    for one, other in zip(again, results["readings"], strict=True):
        assert one["reading"] == other["reading"]
        assert [one["low"], one["high"]] == pytest.approx([other["low"], other["high"]], rel=1e-4)
    w2, _, half_root, half, *_ = results["readings"]
    assert half_root["low"] == pytest.approx(w2["low"] / math.sqrt(2), rel=1e-4)
    assert half["high"] == pytest.approx(w2["high"] ** 2 / 2, rel=1e-4)
