"""The search for broken triangles: committed triples break what they are said to break, ghosts are ghosts."""

import math
from pathlib import Path

import numpy as np
import ot
import pytest
import torch

from meshot.measure.discrete import DiscreteMeasure

FOLDER = Path(__file__).resolve().parents[2] / "experiments" / "axioms"


def test_committed_triples_have_these_sides(part, config, results):
    losses = part("run")
    for row in results["triangles"]:
        triple = [(np.array([side["points"]]), np.array([side["weights"]])) for side in row["triple"]]
        assert all(weights.sum() == pytest.approx(1, abs=1e-9) for _, weights in triple)
        sides = losses.sides(triple, config["losses"][row["loss"]], config, 3000)[:, 0]
        assert sides == pytest.approx(row["sides"], rel=1e-4)
        assert part("run").longest_share(sides[:, None])[0] == pytest.approx(row["largest_found"], rel=1e-4)
        if "largest_by_package" in row:
            assert row["largest_by_package"] == pytest.approx(row["largest_found"], rel=1e-3)


def test_the_solver_agrees_with_pot(part, config):
    """OT_ε of POT for the cost over p, its entropy against the product measure as in GeomLoss."""
    generator = np.random.default_rng(0)
    (x, a), (y, b) = ((generator.normal(size=(4, 2)), generator.dirichlet(np.ones(4))) for _ in range(2))
    for p, blur in ((1, 0.7), (2, 1.0)):
        cost, epsilon = np.linalg.norm(x[:, None] - y, axis=2) ** p / p, blur**p
        plan = ot.sinkhorn(a, b, cost, epsilon, method="sinkhorn_log", numItermax=20_000, stopThr=1e-13)
        expected = p * ((plan * cost).sum() + epsilon * (plan * np.log(plan / np.outer(a, b))).sum())
        found = part("run")._entropic_cost((x[None], a[None]), (y[None], b[None]), p, blur, 3000)[0]
        assert found == pytest.approx(expected, rel=1e-8)


def test_a_search_finds_what_it_should(part, config):
    small = config | {"n_triples": 40, "n_climbs": 12, "n_neighbours": 8}
    triangles = part("run")
    metric = triangles.search("W", {"kind": "transport", "p": 2, "root": True}, small)
    square = triangles.search("W²", {"kind": "transport", "p": 2, "root": False}, small)
    assert metric["n_broken"] == 0
    assert metric["largest_drawn"] - 1e-3 <= metric["largest_found"] <= 1 + 1e-9
    assert square["n_broken"] > 5
    assert square["largest_found"] > square["largest_drawn"] - 1e-3


def test_ghosts_again(part, results):
    assert part("run").measured(4, 2, 0) == pytest.approx(results["ghosts"][3], abs=1e-9)
    first, second = part("run").ghost_pair(np.array([[0.0, 1.0], [1.0, 0.0]]))
    assert {tuple(x) for x in first.points.tolist()} == {(0, 0), (1, 1)}
    assert {tuple(x) for x in second.points.tolist()} == {(0, 1), (1, 0)}


def test_sequences_end_where_they_should(part, config):
    sequences = part("run")
    w2 = {"kind": "transport", "p": 2, "root": True}
    walked = sequences.followed("a point approaches the target", "W₂", w2, config)
    assert walked["values"] == pytest.approx([1 / k for k in config["sequence"]], rel=1e-5)
    assert walked["tends_to_zero"]
    wrong = sequences.followed("a far point keeps the wrong mass", "W₂", w2, config)
    assert wrong["values"] == pytest.approx([math.sqrt(0.5 - 1 / k) for k in config["sequence"]], rel=1e-5)
    assert not wrong["tends_to_zero"]
    row, target = sequences.pair("an even row gets finer", 4)
    assert isinstance(row, DiscreteMeasure)
    assert torch.equal(row.points[:, 0], torch.tensor([0.125, 0.375, 0.625, 0.875]).double())
    assert len(target.points) == 1024
