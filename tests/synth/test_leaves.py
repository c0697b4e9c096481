"""Leaves of the cerebellum: their number, their parts and their depth."""

import numpy as np
import pytest

from meshot.synth import heads as module
from meshot.synth.heads import FAN_MM, Leaves, leaf_fractions


def arc(radius: float, degrees: float, n: int) -> np.ndarray:
    """Points on an arc behind the fan, in the plane of the midline."""
    angles = np.radians(np.linspace(-degrees / 2, degrees / 2, n))
    return np.array(FAN_MM) + np.stack([0 * angles, -radius * np.cos(angles), radius * np.sin(angles)], axis=1)


@pytest.fixture
def flat(monkeypatch):
    """No waves."""
    monkeypatch.setattr(module, "_WAVES_MM", 0.0)


def test_fissures_are_one_width_apart_and_as_wide_as_they_should_be(flat):
    places = arc(32.0, 120.0, 200_001)
    length = 32.0 * np.radians(120.0)
    found, white = leaf_fractions(places, np.full(len(places), 4.0), Leaves(4.0, 9.0, 0.5, 1.0), 1e-6, 0)
    assert (np.diff((found > 0.5).astype(int)) == 1).sum() in (int(length / 4), int(length / 4) + 1)
    assert found.mean() == pytest.approx(0.5 / 4, rel=0.05)
    assert white.mean() == pytest.approx((4 - 0.5 - 2 * 1.0) / 4, rel=0.05)
    assert not (found * white).any()


def test_leaves_become_narrower_towards_the_middle(flat):
    counts = []
    for radius in (32.0, 16.0):
        places = arc(radius, 120.0, 100_001)
        found, _ = leaf_fractions(places, np.full(len(places), 2.0), Leaves(), 1e-6, 0)
        counts.append((np.diff((found > 0.5).astype(int)) == 1).sum())
    assert counts[0] == counts[1]  # the same leaves, on half the length


def test_fissures_end_at_their_depth_and_the_outer_surface_is_grey(flat):
    places = arc(30.0, 100.0, 20_001)
    for depth, fluid, white in ((12.0, 0, 0), (0.5, 1, 0), (5.0, 1, 1)):
        found = leaf_fractions(places, np.full(len(places), depth), Leaves(depth=9.0), 1e-6, 0)
        assert [part.any() for part in found] == [bool(fluid), bool(white)]


def test_waves_shift_the_leaves_and_the_seed_repeats():
    places = np.random.default_rng(0).uniform(-20, 20, (5000, 3)) + np.array(FAN_MM) - [0, 25, 0]
    depths = np.full(5000, 3.0)
    one, other, third = (leaf_fractions(places, depths, Leaves(), 1.0, seed)[0] for seed in (1, 1, 2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, third)
    assert [part.shape for part in leaf_fractions(places[:0], depths[:0], Leaves(), 1.0, 1)] == [(0,), (0,)]


@pytest.mark.parametrize("sizes", [{"width": 0.0}, {"depth": -1.0}, {"fissure": np.nan}, {"width": 2.0, "cortex": 1.0}])
def test_impossible_leaves_are_refused(sizes):
    with pytest.raises(ValueError, match="is not possible: sizes are > 0"):
        Leaves(**sizes)
