"""Weights and areas: committed results belong to their configuration, and a slice rebuilds what they say."""

import json
from pathlib import Path

import pytest
import torch

from meshot.mesh.geometry import face_areas
from meshot.mesh.shapes import icosphere

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "weights_and_areas"


def test_a_descent_rebuilds_its_committed_number(part, record, config, one_thread):
    row = next(r for r in record["results"]["descents"] if r["target"] == "cube" and r["encoding"] == "varifold")
    run = {key: row[key] for key in ("target", "encoding", "detach_weights", "learning_rate")}
    found = part("descents").run_once(run, 0, config)
    for name in ("sw_surface", "sw_varifold", "assd", "edge_variation"):
        assert found[name] == pytest.approx(row[f"{name}_seeds"][0], rel=0.02)


def test_gradients_rebuild_and_only_the_full_one_is_the_slope(part, record, config):
    found = part("descents").gradients_at_start("cube", "surface", 0, config)
    assert found["slope_error_full"] < 1e-6
    assert found["slope_error_stopped"] > 0.1
    assert found["tangential_full"] < 0.01 < found["tangential_stopped"]
    for row in record["results"]["gradients"]:
        assert row["tangential_full_mean"] < row["tangential_stopped_mean"]


def test_a_rate_that_destroys_the_mesh_is_a_result(part, config):
    run = {"target": "cube", "encoding": "surface", "detach_weights": False, "learning_rate": 1e300}
    assert part("descents").run_once(run, 0, config | {"n_steps": 5}) == {"collapsed": True}


def test_meshes_have_the_areas_they_are_said_to_have(part, record):
    meshes = part("descents")
    sphere = icosphere(2)
    assert float(face_areas(meshes.doubled(sphere)).sum() / face_areas(sphere).sum()) == pytest.approx(2)
    for count in (1, 3):
        pleated = meshes.pleated_square(count, 0.75)
        assert float(face_areas(pleated).sum()) == pytest.approx(1.25)
        assert float(pleated.vertices[:, 2].max()) == pytest.approx(0.75 / 2 / count)
    assert record["results"]["areas"][0]["sw_surface"] < 1e-12


def test_merging_errors_are_roundoff_and_a_wrong_cost_is_seen(part, config, monkeypatch):
    checks = part("run")
    small = config["merging"] | {"n_cases": 20, "exponents": [1]}
    (row,) = checks.merging_errors(small)
    assert max(row["pot_sorting"], row["pot_linear_program"], row["scipy"]) < 1e-13
    monkeypatch.setattr(checks, "quantile_cost", lambda *arguments: torch.tensor(0.0))
    (row,) = checks.merging_errors(small)
    assert min(row["pot_sorting"], row["pot_linear_program"], row["scipy"]) > 0.1


def test_summary_chooses_by_its_own_loss_and_counts_the_collapsed(part):
    summary = part("run")
    rows = []
    for detach in (False, True):
        for rate, own, other in ((0.1, 2.0, 1.0), (0.3, 1.0, 3.0)):
            run = {"target": "t", "encoding": "varifold", "detach_weights": detach, "learning_rate": rate}
            values = {"collapsed": False, "sw_varifold": own + detach, "sw_surface": other, "assd": 1.0}
            for k in (0.0, 0.5):
                rows.append({"run": run, "values": values | {"edge_variation": k}})
    run = {"target": "t", "encoding": "varifold", "detach_weights": False, "learning_rate": 1.0}
    rows += [{"run": run, "values": {"collapsed": True}}] * 2
    results = json.loads(json.dumps(summary.summarise(rows)))
    assert results["descents"][-1]["n_collapsed"] == 2
    (difference,) = results["differences"]
    assert difference["rate_full"] == difference["rate_stopped"] == 0.3
    assert (difference["sw_varifold_gap"], difference["sw_surface_full"]) == (1, 3)
