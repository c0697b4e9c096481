"""The local share on points where it is known, and the predictions on trajectories that decide them."""

from pathlib import Path

import numpy as np
import pytest
import torch

from meshot.measure import DiscreteMeasure
from meshot.mesh.shapes import icosphere
from meshot.metrics import Surface

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "threshold"


def measure(points, weights) -> DiscreteMeasure:
    return DiscreteMeasure(torch.tensor(points, dtype=torch.float64), torch.tensor(weights, dtype=torch.float64))


def test_masses_go_to_the_nearest_support(part):
    source = measure([[0.0, 0, 0], [10, 0, 0], [20, 0, 0]], [0.2, 0.3, 0.5])
    target = measure([[1.0, 0, 0], [-1, 0, 0], [9, 0, 0]], [0.25, 0.25, 0.5])
    assert part("run").balanced(source, target).weights.tolist() == [0.5, 0.5, 0]


def test_the_local_share_is_that_of_places_and_masses_apart(part, config):
    run = part("run")
    target = measure([[0.0, 0, 0], [10, 0, 0]], [0.5, 0.5])
    moved, unbalanced = measure([[0.0, 1, 0], [10, 1, 0]], [0.5, 0.5]), measure([[0.0, 0, 0], [10, 0, 0]], [0.4, 0.6])
    for source, share in ((moved, 1.0), (unbalanced, 0.0)):
        found = run.loss_between(run.balanced(source, target), target, config) / run.loss_between(
            source, target, config
        )
        assert found == pytest.approx(share, abs=1e-12)


@pytest.mark.parametrize("kind", ["smoothed", "displaced"])
def test_starts_are_as_far_away_as_the_initial_surface(part, config, kind):
    run, settings = part("run"), config | {"n_points": 3000}
    target = icosphere(4, 30.0).to(torch.float32)

    class Example:
        initial = icosphere(4, 31.0).to(torch.float32)

    Example.target = target
    truth = Surface(target)
    found = run.assd(run.start_of(kind, Example, truth, settings), truth, settings)
    assert found == pytest.approx(1, abs=0.3 if kind == "smoothed" else 0.02)


def trajectory(share, q, r, **task):
    found = {"shares": {"local": share}, "before": {"sliced": 1.0, "assd_mm": 1.0}, "sliced": q, "assd_mm": r}
    return {"task": {"by": "fit", "start": "initial", "normal_scale": 20.0} | task, "found": found}


def test_predictions_are_judged_as_the_protocol_says(part):
    judged = part("run").judged
    falling = np.geomspace(0.8, 0.02, 20)
    agrees = judged(trajectory(0.1, falling.tolist(), np.where(falling > 0.11, 1.3, 0.7).tolist()))
    assert agrees["agrees"] is True
    assert 0.09 < agrees["crossing"] < 0.11
    assert judged(trajectory(0.1, falling.tolist(), [0.9] * 20))["agrees"] is False  # nearer from the beginning
    assert judged(trajectory(0.1, falling.tolist(), [1.2] * 20))["agrees"] is False  # never nearer
    assert judged(trajectory(0.8, falling.tolist(), [0.9] * 20))["agrees"] is True
    assert judged(trajectory(0.8, falling.tolist(), [1.2] * 20))["agrees"] is False
    assert judged(trajectory(0.8, falling.tolist(), [1.2] * 3 + [0.9] * 17))["agrees"] is False  # farther for a while
    assert judged(trajectory(0.5e-3, [0.95], [1.2]))["agrees"] is None  # nothing is spoken of


def test_the_crossing_is_compared_with_the_share_and_with_a_tenth(part, config):
    run, falling, rows = part("run"), np.geomspace(0.9, 0.005, 80), []
    for number, share in enumerate((0.02, 0.03, 0.2, 0.3)):
        r = np.where(falling > share, 1.3, 0.7).tolist()
        place = {
            "cohort": "a",
            "subject": f"{number}",
            "n_faces": 1,
            "finest_mm": 3.0,
            "normal_scale": 1.0 if number < 2 else 20.0,
        }
        rows.append(trajectory(share, falling.tolist(), r, **place))
    told = run.results(rows, config)["predictions"]
    assert told["1"] == {"n_agree": 4, "n": 4}
    assert told["3"]["mean_gap"] < -0.8
