"""Better directions: controls have the means they claim, estimators agree with plain twins, numbers repeat."""

from pathlib import Path

import numpy as np
import pytest

from meshot import random_directions
from meshot.loss.sliced import slice_costs

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "beyond_random"


@pytest.mark.parametrize("d", [3, 6])
def test_controls_have_mean_zero_over_the_sphere(part, config, d):
    controls = part("run").Controls(*part("run").measures("moved", d, config))
    directions = random_directions(200_000, d, 0).numpy()
    columns = np.column_stack([controls.moments_part(directions), controls.quadratic_part(directions)])
    assert columns.shape[1] == 3 + d * (d + 1) // 2 - 1
    assert np.abs(columns.mean(axis=0) / columns.std(axis=0)).max() < 4.5 / np.sqrt(len(columns))


def test_means_go_their_own_way(part, config):
    """For p = 2 the cost less ⟨t, θ⟩² is the cost of the centred measures, direction by direction."""
    source, target = part("run").measures("moved", 3, config)
    directions = random_directions(20, 3, 1)
    controls = part("run").Controls(source, target)
    left = slice_costs(source, target, directions).numpy() - (directions.numpy() @ controls.shift) ** 2
    measure = type(source)
    centred = [measure(m.points - m.weights @ m.points, m.weights) for m in (source, target)]
    assert left == pytest.approx(slice_costs(*centred, directions).numpy(), rel=1e-9, abs=1e-12)


def test_quadratics_are_integrated_without_error(part, config):
    estimators = part("run")
    controls = estimators.Controls(*part("run").measures("moved", 3, config))
    directions = random_directions(30, 3, 2).numpy()
    form = np.diag([1.0, 2.0, 5.0])
    costs = np.einsum("ld,de,le->l", directions, form, directions)
    assert estimators.without_quadratics(costs, directions, controls) == pytest.approx(8 / 3, rel=1e-10)
    assert abs(estimators.plain(costs, directions, controls) - 8 / 3) > 1e-3


def test_a_method_needs_twice_the_directions_of_its_coefficients(part):
    least = part("run").least_directions
    assert [least("random", 6), least("random, moments fitted", 6), least("random, quadratics fitted", 6)] == [2, 8, 42]


def test_factor_saved_is_a_ratio_of_root_mean_squares(part):
    found = part("run").factor_saved(np.array([2.0, -2.0, 2.0]), np.array([0.5, -0.5]))
    assert found == {"factor": 4.0, "low": 4.0, "high": 4.0}


def test_the_reference_leaves_biased_methods_out(part):
    sizes = {
        10: {"random": [9.0, 9.0]},
        100: {"random": [1.0, 3.0], "quasi": [2.0, 2.2], "quasi, x fitted": [7.0, 8.0]},
    }
    assert part("run").reference(sizes) == pytest.approx((2 * 1 + 2.1 * 100) / 101)


def test_a_small_part_repeats_the_committed_numbers(part, record, config):
    rows = record["results"]["methods"]
    row = next(r for r in rows if (r["pair"], r["d"], r["method"]) == ("centred", 3, "orthogonal"))
    n, n_sets = config["sizes"][0], config["n_sets"][0]
    task = {"pair": "centred", "d": 3, "way": "orthogonal", "n_directions": n, "n_sets": n_sets}
    found = np.array(part("run").estimates(task, config)["orthogonal"]) / row["truth"] - 1
    assert np.sqrt(np.mean(found**2)) == pytest.approx(row["rmse"][0], rel=1e-4)
