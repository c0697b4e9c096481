"""Crossing faces: small slices of the committed counts are made again."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "self_intersection"
pytestmark = pytest.mark.usefixtures("one_thread")


def committed(record, table, **wanted):
    (row,) = (r for r in record["results"][table] if all(r[k] == v for k, v in wanted.items()))
    return row


def test_committed_counts_under_whirls_are_made_again(part, record):
    task = {"strength": 8.0, "level": 2}
    rows = part("run").given_row(task, record["config"])
    assert rows == committed(record, "given", **task)["rows"]


def test_a_committed_fit_by_a_flow_and_one_without_are_made_again(part, record):
    fitting = part("run")
    task = {"pair": "coarse", "loss": "sliced", "encoding": "varifold", "spacing": 12.0, "seed": 0}
    found, kept = fitting.fit_row(task, record["config"]), committed(record, "fits", **task)
    assert (found["crossing"], found["flips"]) == (kept["crossing"], kept["flips"])
    assert found["assd"] == pytest.approx(kept["assd"], rel=0.01)
    assert found["lipschitz"] == pytest.approx(kept["lipschitz"], rel=0.02)
    task |= {"loss": "chamfer", "encoding": "barycentres", "spacing": 0.0}
    found, kept = fitting.fit_row(task, record["config"]), committed(record, "fits", **task)
    # The choice of a nearest neighbour turns a last bit into another path; the share stays.
    assert found["crossing"] == pytest.approx(kept["crossing"], rel=0.2)
    assert found["assd"] == pytest.approx(kept["assd"], rel=0.05)


@pytest.mark.thorough
def test_a_slice_of_the_carried_meshes_is_made_again(part, record):
    carrying = part("run")
    config = record["config"] | {"steps": [1, 10], "rk4_steps": 2}
    config["carried"] = config["carried"] | {"factors": [2.0], "levels": [2, 3]}
    task = {"pair": "coarse", "loss": "sliced", "encoding": "varifold", "spacing": 3.0, "seed": 1}
    kept = {(r["factor"], r["way"], r["steps"]): r for r in committed(record, "carried", **task)["rows"]}
    for row in carrying.carried_row(task, config)[:2]:
        stored = kept[row["factor"], row["way"], row["steps"]]
        assert row["step_times_lipschitz"] == pytest.approx(stored["step_times_lipschitz"], rel=0.05)
        for level in ("2", "3"):
            assert row["levels"][level]["end"] == pytest.approx(stored["levels"][level]["end"], rel=0.2, abs=8)
