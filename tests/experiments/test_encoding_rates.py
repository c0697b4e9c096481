"""Encodings: rules are exact where they must be, committed numbers repeat."""

from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "encoding_rates"


@pytest.mark.parametrize(("rule", "degree"), [("barycentres", 1), ("midpoints", 2), ("vertices", 1)])
def test_rules_integrate_polynomials_to_their_degree(part, rule, degree):
    """Over a turned box, against a rule of degree two on a fine subdivision."""
    box = part("run").turned_box()
    encoded = part("run").atoms(box, rule, 0.0)
    assert float(encoded.weights.sum()) == pytest.approx(1)
    fine = part("run").atoms(part("run").refined(box, 5), "midpoints", 0.0)
    for power in (1, 2, 4):  # odd powers about the centre of a symmetric box would vanish for every rule
        values = [float(m.weights @ m.points[:, 0] ** power) for m in (encoded, fine)]
        assert (values[0] == pytest.approx(values[1], rel=1e-6)) == (power <= degree)


def test_crossings_are_read_off_power_laws(part):
    lines = [{"way": "exact", "size": 100, "seconds": 1.0, "error": 0.0}]
    lines += [{"way": "varifold", "size": 100, "seconds": 0.1, "error": 1e-4}]
    for way in ("samples", "samples, same draws"):
        times = np.geomspace(1e-3, 10, 8)
        lines += [{"way": way, "size": 1, "seconds": t, "error": 0.01 * t**-0.5} for t in times]
    found = part("summary").crossings(lines)["samples"]
    assert found["error_in_the_time_of_exact"] == pytest.approx(0.01, rel=1e-4)
    assert found["slope_in_seconds"] == pytest.approx(-0.5)
    assert found["seconds_for_the_error_of_varifold"] == pytest.approx(1e4, rel=1e-4)
    assert found["times_slower_than_varifold"] == pytest.approx(1e5, rel=1e-4)
    assert found["extrapolated"] is True


@pytest.mark.parametrize(("family", "d", "k"), [("cube", 3, 1), ("sphere", 6, 0), ("uneven_cube", 3, 1)])
def test_a_small_part_repeats_the_committed_numbers(part, record, config, family, d, k):
    rates = record["results"]["rates"]
    level = config["families"][family]["levels"][k]
    found = part("run").measure_level({"family": family, "d": d, "level": level}, config)
    for row in (row for row in rates if (row["family"], row["d"]) == (family, d)):
        lists = found["samples"] if row["encoding"] == "samples" else found["atoms"][row["encoding"]]
        assert np.abs(lists[str(row["p"])][row["quantity"]]).mean() == pytest.approx(row["error"][k], rel=1e-5)
    keys, duels = {"family": family, "d": d, "level": level}, record["results"]["duels"]
    for row in (row for row in duels if keys.items() <= row.items()):
        samples, varifold = (lists[str(row["p"])][row["quantity"]] for lists in
                             (found["samples"], found["atoms"]["barycentres"]))  # fmt: skip
        duel = part("summary").ratio_of_means(samples, varifold)
        assert duel == pytest.approx({name: row[name] for name in ("ratio", "low", "high")}, rel=1e-5)
