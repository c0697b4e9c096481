"""Blemishes: where they are, how large they are, and what they leave alone."""

import numpy as np
import pytest

from meshot.synth.imaging import TISSUES, Blemishes, blemished
from meshot.volume.volume import Volume

N = 64
GRID = Volume(np.zeros((N, N, N), dtype=np.uint8), np.diag([1.5, 1.5, 1.5, 1.0]))
RADIUS = np.linalg.norm(1.5 * (np.stack(np.meshgrid(*(np.arange(N),) * 3, indexing="ij"), axis=-1) - N / 2), axis=-1)


def head() -> dict[str, np.ndarray]:
    """White matter within 25 mm, grey matter to 30, fluid to 33."""
    found = {tissue: np.zeros((N, N, N)) for tissue in TISSUES}
    found["white"][RADIUS < 25] = 1
    found["grey"][(RADIUS >= 25) & (RADIUS < 30)] = 1
    found["fluid"][(RADIUS >= 30) & (RADIUS < 33)] = 1
    return found


def changed(blemishes: Blemishes, seed: int = 0) -> tuple[dict[str, np.ndarray], np.ndarray]:
    before, after = head(), blemished(head(), GRID, blemishes, seed)
    assert all(part.min() >= -1e-9 and part.max() <= 1 + 1e-9 for part in after.values())
    assert sum(after.values()).max() <= 1 + 1e-9
    return after, sum(np.abs(after[name] - before[name]) for name in before) > 0.1


def test_a_perfect_scan_has_none():
    assert not changed(Blemishes())[1].any()


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_dura_covers_its_share_of_the_outer_surface(share):
    after, where = changed(Blemishes(dura=share, dura_mm=4.0))
    assert where[(RADIUS > 34) & (RADIUS < 36)].mean() == pytest.approx(share, abs=0.12)
    assert not where[(RADIUS < 33) | (RADIUS > 39)].any()
    assert after["scalp"][where].min() == 1


def test_cuts_remove_everything_to_their_depth():
    after, where = changed(Blemishes(cut=0.3, cut_mm=6.0))
    assert sum(after.values())[where].max() == 0
    assert where[(RADIUS > 29) & (RADIUS < 32)].mean() == pytest.approx(0.3, abs=0.12)
    assert not where[RADIUS < 25].any()


def test_lesions_lie_deep_in_white_matter_with_their_share():
    after, where = changed(Blemishes(lesions=0.1))
    assert not where[RADIUS > 23.5].any()
    assert after["deep grey"][RADIUS < 20].mean() == pytest.approx(0.1, abs=0.05)


def test_vessels_stay_near_the_surface_and_are_thin():
    after, where = changed(Blemishes(vessels=5))
    assert not where[(RADIUS < 28) | (RADIUS > 43)].any()
    volume = after["scalp"].sum() * 1.5**3
    assert 5 * 60 * np.pi * 0.5**2 / 2 < volume < 5 * 60 * np.pi * 1.5**2 * 2.5


def test_the_seed_decides():
    kinds = Blemishes(dura=0.2, cut=0.2, vessels=2, lesions=0.1)
    one, other, third = (changed(kinds, seed)[1] for seed in (1, 1, 2))
    assert np.array_equal(one, other)
    assert not np.array_equal(one, third)


@pytest.mark.parametrize(
    ("sizes", "words"),
    [({"dura": 1.5}, "dura is 1.5; a share"), ({"cut": -0.1}, "cut is -0.1"), ({"vessels": -1}, "not possible")],
)
def test_impossible_sizes_are_refused(sizes, words):
    with pytest.raises(ValueError, match=words):
        Blemishes(**sizes)


def test_an_empty_scan_is_refused():
    with pytest.raises(ValueError, match="contain no brain"):
        blemished({tissue: np.zeros((4, 4, 4)) for tissue in TISSUES}, GRID, Blemishes(dura=0.1), 0)
