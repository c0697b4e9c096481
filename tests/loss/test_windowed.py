"""Transport within windows: against POT on what windows see, and what becomes of mass that is missing far away."""

import numpy as np
import ot
import pytest
import torch

import problems
from meshot import random_directions, sliced_wasserstein
from meshot.loss.windowed import windowed_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure

CENTRES = torch.tensor([[0.0, 0.1, 0.0], [0.5, -0.4, 0.2]], dtype=torch.float64)
RADIUS = 0.6


def pair(d=3):
    return problems.cloud(0, 60, d, True), problems.cloud(1, 45, d, True)


def lines(d, n_windows=2, n=7):
    return torch.stack([random_directions(n, d, k) for k in range(n_windows)])


def seen(measure, centre, weights):
    """Shares of every point in a window, zero outside; differentiable in the weights, not in the places."""
    squared = ((measure.points.detach()[:, :3] - centre) ** 2).sum(dim=1)
    shares = weights * torch.where(squared.sqrt() < 2.5 * RADIUS, torch.exp(-squared / 2 / RADIUS**2), 0.0)
    return shares / shares.sum()


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("d", [3, 6])
def test_against_pot_on_what_a_window_sees(p, d):
    source, target = pair(d)
    expected = []
    for centre, directions in zip(CENTRES, lines(d), strict=True):
        shares = [seen(measure, centre, measure.weights).numpy() for measure in (source, target)]
        assert all(0 < (share == 0).sum() < len(share) for share in shares)
        expected += [
            ot.emd2_1d(
                source.points.numpy() @ line, target.points.numpy() @ line, *shares, metric="minkowski", p=p
            )
            for line in directions.numpy()
        ]  # fmt: skip
    found = windowed_sliced_wasserstein(source, target, CENTRES, RADIUS, lines(d), p)
    assert float(found) == pytest.approx(np.mean(expected), rel=1e-9)


def test_mass_that_is_missing_far_away_does_not_pull():
    """Two lumps sixty apart; one has two per cent too much: transport carries it over, a window does not see it."""
    lump = problems.cloud(0, 200, 3).points
    both = torch.cat([lump, lump + torch.tensor([60.0, 0.0, 0.0], dtype=torch.float64)])
    halves = torch.full((400,), 1 / 400, dtype=torch.float64)
    uneven = torch.cat([halves[:200] * 1.02, halves[200:] * 0.98])
    source, target = DiscreteMeasure(both, uneven), DiscreteMeasure(both, halves)
    assert float(sliced_wasserstein(source, target, lines(3, 1, 50)[0])) > 1
    assert float(windowed_sliced_wasserstein(source, target, both[[0, 250]], 5.0, lines(3))) < 1e-12


def test_windows_in_empty_places_do_not_count():
    source, target = pair()
    empty = torch.cat([CENTRES, torch.full((1, 3), 90.0, dtype=torch.float64)])
    found = windowed_sliced_wasserstein(source, target, empty, RADIUS, lines(3, 3))
    expected = windowed_sliced_wasserstein(source, target, CENTRES, RADIUS, lines(3, 3)[:2])
    assert float(found) == pytest.approx(float(expected), rel=1e-12)
    with pytest.raises(ValueError, match=r"none of 1 windows of radius 0\.6 holds mass of both measures"):
        windowed_sliced_wasserstein(source, target, empty[2:], RADIUS, lines(3, 1))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"radius": 0.0}, "radius is 0.0; a finite number > 0 is needed"),
        ({"radius": float("nan")}, "radius is nan"),
        ({"directions": random_directions(7, 3, 0)}, r"directions has shape \(7, 3\); \(2, L, 3\) is needed"),
        ({"directions": torch.stack([random_directions(7, 3, 0)])}, "a set for every window"),
        ({"centres": torch.zeros(2, 4, dtype=torch.float64)}, "centres has 4 coordinates, the points 3"),
        ({"centres": torch.full((2, 3), torch.nan)}, "centres"),
        ({"target": problems.cloud(1, 9, 2)}, "R\\^2"),
    ],
)
def test_what_does_not_fit_is_refused(change, words):
    source, target = pair()
    given = {"source": source, "target": target, "centres": CENTRES, "radius": RADIUS, "directions": lines(3)}
    with pytest.raises(ValueError, match=words):
        windowed_sliced_wasserstein(**(given | change))
