"""Transport within windows against POT, its limits, and which axioms of a metric hold."""

import itertools

import numpy as np
import pytest
import torch

import problems
from meshot import quasi_directions, random_directions, sliced_wasserstein
from meshot.loss.windowed import windowed_sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from refusals import refuses

CENTRES = torch.tensor([[0.0, 0.1, 0.0], [0.5, -0.4, 0.2]], dtype=torch.float64)
RADIUS = 0.6


def pair(d=3):
    return problems.cloud(0, 60, d, True), problems.cloud(1, 45, d, True)


def lines(d, n_windows=2, n=7):
    return torch.stack([random_directions(n, d, k) for k in range(n_windows)])


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
    refuses(words, windowed_sliced_wasserstein, **given | change)


REACH = 2.5  # in radii


def points_at(places, weights=None):
    places = torch.as_tensor(places, dtype=torch.float64)
    return DiscreteMeasure(places, None if weights is None else torch.as_tensor(weights, dtype=torch.float64))


def cap(radius, turn, bend=10.0, n=180, extent=2.7):
    """A dense piece of a sphere through the origin, tangent to a plane that is turned about the first axis."""
    step = torch.linspace(-extent * radius, extent * radius, n, dtype=torch.float64)
    u, v = (t.flatten() for t in torch.meshgrid(step, step, indexing="ij"))
    squared = u**2 + v**2
    height = bend - (bend**2 - squared).sqrt()
    areas = bend / (bend**2 - squared).sqrt()
    places = torch.stack([u, v, height], dim=1)
    cos, sin = np.cos(turn), np.sin(turn)
    rotation = torch.tensor([[1.0, 0, 0], [0, cos, -sin], [0, sin, cos]], dtype=torch.float64)
    return DiscreteMeasure(places @ rotation.T, areas / areas.sum()), rotation[:, 2]


ORIGIN = torch.zeros(1, 3, dtype=torch.float64)


@pytest.mark.parametrize("p", [1, 2])
def test_wide_windows_approach_the_sliced_loss_like_the_inverse_square_of_the_radius(p):
    source, target = problems.cloud(0, 60, 3, True), problems.cloud(1, 45, 3, True)
    lines = quasi_directions(9, 3)
    whole = float(sliced_wasserstein(source, target, lines, p))
    errors = [
        abs(float(windowed_sliced_wasserstein(source, target, ORIGIN + 0.3, radius, lines[None], p)) - whole)
        for radius in (20.0, 40.0, 80.0, 160.0)
    ]
    assert errors[0] > 1e-5
    for wide, wider in itertools.pairwise(errors):
        assert wide / wider == pytest.approx(4, rel=0.05)


def test_narrow_windows_leave_the_angle_between_the_tangent_planes():
    """At a common point the loss, divided by radius², tends to that of two flat discs: κ² (|Pθ| − |Qθ|)².

    P and Q project on the tangent planes; κ² is the variance along a line of a Gaussian in the plane, cut off at 2.5.
    """
    turn, lines = 0.8, quasi_directions(32, 3)
    a = REACH**2 / 2
    variance = 1 - a * np.exp(-a) / (1 - np.exp(-a))
    errors = []
    for radius in (1.0, 0.5, 0.25, 0.125):
        (one, normal), (other, turned) = cap(radius, 0.0), cap(radius, turn)
        lengths = [(1 - (lines @ n) ** 2).sqrt() for n in (normal, turned)]
        expected = float((variance * (lengths[0] - lengths[1]) ** 2).mean())
        found = float(windowed_sliced_wasserstein(one, other, ORIGIN, radius, lines[None]))
        errors.append(abs(found / radius**2 / expected - 1))
    assert errors[-1] < 0.01
    assert errors[-1] < errors[-2] < errors[-3] < errors[-4]


def test_narrow_windows_compare_normals_where_the_surfaces_meet():
    """With normals of length s in the last coordinates, the limit is the mean of ⟨θ, (0, s(m − n))⟩²."""
    scale, lines, found = 3.0, quasi_directions(32, 6), []
    for radius in (0.4, 0.04):
        sides, normals = [], []
        for turn in (0.0, 0.8):
            flat, normal = cap(radius, turn, bend=1e4)
            normals.append(scale * normal)
            sides.append(DiscreteMeasure(torch.cat([flat.points, normals[-1].expand(len(flat.points), 3)], 1)))
        found.append(float(windowed_sliced_wasserstein(*sides, ORIGIN, radius, lines[None])))
    expected = float(((lines[:, 3:] @ (normals[0] - normals[1])) ** 2).mean())
    assert found[1] == pytest.approx(expected, rel=1e-2)
    assert abs(found[1] - expected) < abs(found[0] - expected) / 5


def test_parallel_sheets_are_measured_within_the_reach_and_not_beyond():
    """Two planes at a distance h: mean of ⟨θ, h n⟩² for h well below 2.5 radii, and no common window above."""
    lines, radius = quasi_directions(64, 3), 1.0
    flat, normal = cap(radius, 0.0, bend=1e4)
    for height in (0.02, 0.2, 0.5):
        lifted = DiscreteMeasure(flat.points + height * normal, flat.weights)
        found = float(windowed_sliced_wasserstein(flat, lifted, ORIGIN, radius, lines[None]))
        assert found == pytest.approx(float(((lines @ normal) * height).square().mean()), rel=0.02)
    beyond = DiscreteMeasure(flat.points + 2.6 * radius * normal, flat.weights)
    refuses("holds mass of both measures", windowed_sliced_wasserstein, flat, beyond, ORIGIN, radius, lines[None])


@pytest.mark.parametrize("p", [1, 1.5, 2, 3])
def test_fixed_windows_that_hold_mass_of_all_give_a_pseudo_metric(p):
    centres = torch.tensor([[0.0, 0.1, 0.0], [0.5, -0.4, 0.2], [-0.3, 0.6, 0.0]], dtype=torch.float64)
    lines = torch.stack([quasi_directions(4, 3, k) for k in range(3)])

    def distance(one, other):
        return float(windowed_sliced_wasserstein(one, other, centres, 0.8, lines, p)) ** (1 / p)

    for seed in range(20):
        triple = [problems.cloud(3 * seed + k, 12 + 5 * k, 3, True) for k in range(3)]
        legs = [distance(*pair) for pair in itertools.combinations(triple, 2)]
        assert max(legs) <= sum(legs) - max(legs) + 1e-12
        assert distance(triple[1], triple[0]) == pytest.approx(legs[0], rel=1e-12)


def test_parts_farther_apart_than_twice_the_reach_may_exchange_mass_unseen():
    """No ball of 2.5 radii holds both points if they are more than 5 radii apart: zero for all centres, yet unequal."""
    centres = torch.zeros(301, 3, dtype=torch.float64)
    centres[:, 0] = torch.linspace(-2, 7, 301)
    lines = quasi_directions(8, 3)[None].expand(301, -1, -1)
    for gap, unseen in ((5.05, True), (4.9, False)):
        places = [[0.0, 0, 0], [gap, 0, 0]]
        pair = points_at(places, [0.5, 0.5]), points_at(places, [0.7, 0.3])
        value = float(windowed_sliced_wasserstein(*pair, centres, 1.0, lines))
        assert (value < 1e-15) == unseen
        assert float(sliced_wasserstein(*pair, lines[0])) > 1


def test_windows_that_are_left_out_break_the_triangle_inequality():
    """A measure without mass in a window is at distance zero from all that differ only there."""
    centres = torch.tensor([[0.0, 0, 0], [100.0, 0, 0]], dtype=torch.float64)
    lines = quasi_directions(8, 3)[None].expand(2, -1, -1)

    def loss(one, other):
        return float(windowed_sliced_wasserstein(one, other, centres, 1.0, lines))

    near, aside = ([[x, 0, 0], [100.0, 0, 0]] for x in (0.0, 1.0))
    one, other, between = points_at(near), points_at(aside), points_at([[100.0, 0, 0]])
    assert loss(one, between) == loss(between, other) == 0
    assert loss(one, other) > 0.1
