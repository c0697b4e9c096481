"""The carried template on held-out subjects: committed means are those of the scores; known maps have known errors."""

from pathlib import Path

import numpy as np
import pytest
import torch

from meshot.anatomy.templates import fsaverage5_surface
from meshot.mesh.shapes import icosphere

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "correspondence"


def test_committed_means_are_those_of_the_scores(record, part):
    again = part("run").means(record["results"]["scores"])
    stored = record["results"]["means"]
    # Both are rounded to six digits.
    assert again["vertices_mm"]["carried"] == pytest.approx(stored["vertices_mm"]["carried"], rel=2e-5)
    assert again["surface_mm"] == pytest.approx(stored["surface_mm"], rel=2e-5)


def test_an_affine_image_of_the_template_has_no_error_after_the_best_affine_map(part):
    ball = icosphere(2, 30.0)
    matrix = torch.tensor([[1.1, 0.1, 0.0], [0.0, 0.9, 0.2], [0.1, 0.0, 1.0]], dtype=torch.float64)
    truth = (ball.vertices @ matrix.T + torch.tensor([3.0, -2.0, 5.0])).numpy()
    assert part("run").best_affine(ball, truth).vertices.numpy() == pytest.approx(truth, abs=1e-10)


def test_a_spread_is_that_of_numpy(part):
    values = np.arange(101.0)
    assert part("run").spread(values, 95) == {"mean": 50.0, "median": 50.0, "percentile_95": 95.0}


def test_a_template_in_its_true_place_makes_no_error_by_region(part):
    run, (white, pial) = part("run"), (fsaverage5_surface(kind, "left") for kind in ("white", "pial"))
    found = run.by_region(white, pial, white, white, "left")
    assert found["right_percent"] == 100
    assert set(found["area_percent"].values()) == set(found["thickness_mm"].values()) == {0.0}
    forwards = white.with_vertices(white.vertices + torch.tensor([0.0, 10.0, 0.0]).double())
    moved = run.by_region(white, pial, white, forwards, "left")
    assert moved["right_percent"] < 80
    assert max(abs(error) for error in moved["area_percent"].values()) > 20
