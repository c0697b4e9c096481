"""The two ground costs: committed numbers belong to the configuration, and a small slice makes them again."""

from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "ground_cost"


def test_the_committed_means_are_made_again(run, record):
    small = record["config"] | {"n_turns": 1}
    rows = [run.transport_row(seed, 1, small) for seed in small["seeds"]]
    for name in ("ratio", "other_partner", "mean_angle_degrees"):
        mean = np.mean([row[name] for row in rows])
        assert mean == pytest.approx(record["results"]["summary"][0][f"{name}_mean"], rel=1e-4)


def test_two_points_by_hand(run):
    here, there = np.zeros((1, 3)), np.array([[3.0, 4.0, 0.0]])
    assert run.cost_matrix(here, there, 3, run.EUCLIDEAN)[0, 0] == pytest.approx(125)
    assert run.cost_matrix(here, there, 3, run.COORDINATES)[0, 0] == pytest.approx(27 + 64)


def test_the_descent_of_coordinates_is_minus_the_gradient(run):
    step = np.array([[1.0, 2.0, -0.5]])
    shift = 1e-6 * np.eye(3)
    slope = [
        run.cost_matrix(shift[k : k + 1], step, 3, run.COORDINATES)[0, 0]
        - run.cost_matrix(-shift[k : k + 1], step, 3, run.COORDINATES)[0, 0]
        for k in range(3)
    ]
    descent = -np.array(slope) / np.linalg.norm(slope)
    np.testing.assert_allclose(
        run._descent_direction(np.zeros((1, 3)), step, 3, run.COORDINATES)[0], descent, atol=1e-6
    )


def test_for_squares_the_minimisers_are_both_the_mean(run, record):
    assert run.minimiser_row(0, 2, record["config"])["minimisers_apart_mm"] < 1e-5


def test_every_loss_is_euclidean(run, record):
    for row in run.asked_rows(record["config"]):
        assert row["diagonal_over_axis"] == pytest.approx(1, abs=0.01), row["loss"]
    assert len(record["results"]["asked"]) == 11
