"""The sweep of Sinkhorn's blur: committed numbers belong to the configuration, and a small slice makes them again."""

from pathlib import Path

import numpy as np
import pytest
import torch

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "blur"


def test_the_committed_fit_by_slices_is_made_again(part, record, one_thread):
    fitting = part("run")
    mesh = fitting.fit({"loss": "sliced"}, 0, record["config"])
    scale = record["config"]["normal_scale_mm"]
    _, target = fitting.make_pair(0, record["config"])
    found = fitting.exact_distance(
        fitting.varifold(mesh, normal_scale=scale), fitting.varifold(target, normal_scale=scale)
    )
    # Two hundred steps amplify a last bit that another order of sums, or another CPU, leaves.
    assert found == pytest.approx(record["results"]["fits"][0]["w2_varifold_seeds"][0], rel=0.005)


def test_one_row_of_the_limits_is_made_again(part, record):
    limits = {"blurs_mm": [1000.0], "scalings": [0.5], "exponents": [1, 2]}
    rows = part("run").limit_rows(record["config"] | {"limits": limits})
    for row in rows:
        keys = ("p", "blur", "scaling")
        (stored,) = [r for r in record["results"]["limits"] if all(r[k] == row[k] for k in keys)]
        assert {k: row[k] for k in ("value", "exact", "energy")} == pytest.approx(
            {k: stored[k] for k in ("value", "exact", "energy")}, rel=1e-4
        )


def test_the_energy_distance_of_squares_is_that_of_the_means(part):
    limits, fitting = part("run"), part("run")
    generator = np.random.default_rng(0)
    x, y = (fitting.DiscreteMeasure(torch.from_numpy(generator.normal(size=(n, 3)))) for n in (5, 8))
    between = (x.points.mean(dim=0) - y.points.mean(dim=0)).square().sum()
    assert limits.energy_distance(x, y, 2) == pytest.approx(float(between))


@pytest.mark.parametrize("run", [{"loss": "exact"}, {"loss": "sinkhorn", "blur_mm": 5.0, "scaling": 0.5}])
def test_few_steps_come_nearer(part, record, run):
    fitting = part("run")
    small = record["config"] | {"subdivisions": 1, "n_steps": 10, "n_emd_points": 50, "n_surface_points": 500}
    start, target = fitting.make_pair(3, small)
    before, after = fitting.judged(start, target, small), fitting.run_once(run, 3, small)
    assert after["w2_varifold"] < before["w2_varifold"]
    assert after["sw2_surface"] < before["sw2_surface"]
