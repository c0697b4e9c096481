"""One hemisphere trained on alone: a surface measures as committed, and its training has a curve."""

from pathlib import Path

import pytest

from meshot_book.example_file import read_example
from meshot_book.trainings import curve

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "experiments" / "one_subject"


def test_the_initial_surface_measures_as_committed(part, record, config, one_thread):
    example, _ = read_example(ROOT / config["example"])
    found = part("run").measured(example.initial, example, config)
    committed = record["results"]["surfaces"][0]
    # float32 differs between processors by some 3e-5. A point that is as near to two faces may be given to either. This
    # changes one of 2 × 20 000 cosines by at most about one: room for four such points.
    room = 4 / (2 * config["n_points"])
    for name, value in found.items():
        assert value == pytest.approx(committed[name], rel=1e-4, abs=room), name


def test_a_curve_has_the_mean_loss_between_checks():
    log = [{"step": k, "loss": float(k)} for k in (1, 2, 3)]
    log += [{"step": 3, "validation_loss": 0.5}]
    log += [{"step": k, "loss": float(k)} for k in (4, 5)]
    log += [{"step": 5, "validation_loss": 0.25}]
    assert curve(log) == {"step": [3, 5], "assd_mm": [0.5, 0.25], "loss": [2.0, 4.5]}


def test_the_last_weights_of_an_arm_are_measured(part, config, one_thread, tmp_path):
    changes = ["training.learning_rate=0.1", "training.schedule=constant"]  # the third step leads far away
    own = {"settings": "tiny", "arms": {"ddot": {"title": "", "system": "ddot", "steps": 3, "changes": changes}}}
    own |= {"validate_every": 1, "n_points": 2000, "n_directions": 20, "state": str(tmp_path)}
    found = part("run").train_arm("ddot", config | own)
    assert (found["curve"]["step"], found["surface"]["n_steps"]) == ([1, 2, 3], 3)
    assert found["curve"]["assd_mm"][-1] > 2 * min(found["curve"]["assd_mm"])
    assert found["surface"]["assd_mm"] == pytest.approx(found["curve"]["assd_mm"][-1], rel=0.1)  # other points
