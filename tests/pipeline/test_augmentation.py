"""What augmentation does to a scan, and does not: image and truth stay together."""

import numpy as np
import pytest
import torch

from meshot.pipeline.segmentation import Augmentation, augmented
from phantoms import phantom_examples
from refusals import refuses

STILL = {"flip": 0.0, "shift": 0, "intensity": 0.0}


def test_mirroring_exchanges_the_sides():
    image, fractions = phantom_examples(1)[0].tensors()
    same, mirrored = (augmented(image, fractions, 0, Augmentation(float(f), 0, 0)) for f in (0.0, 1.0))
    assert torch.equal(same[0], image)
    assert torch.equal(same[1], fractions)
    assert torch.equal(mirrored[0], image.flip(1))
    assert torch.equal(mirrored[1][0], fractions[1].flip(0))
    back = augmented(*mirrored, 0, Augmentation(1.0, 0, 0))
    assert torch.equal(back[1], fractions)
    assert float(mirrored[1][0][:16].sum()) > 100 * float(mirrored[1][0][16:].sum())


def test_shifts_move_image_and_truth_alike_and_nothing_wraps_round():
    image = torch.zeros(1, 8, 8, 8)
    image[0, 0], image[0, 4, 4, 4] = 1, 0.5
    seen = set()
    for seed in range(30):
        moved, truth = augmented(image, torch.cat([image, image]), seed, Augmentation(float(0), 3, 0))
        assert torch.equal(moved[0], truth[0])
        place = (moved == 0.5).nonzero()[0, 1:]
        seen.add(tuple(place.tolist()))
        first = int(place[0]) - 4
        assert float(moved[0, first:, 1:].max() if first >= 0 else moved.max()) > 0
        assert (float(moved.max()) == 1) == (first >= 0)
        assert float(moved[0, : max(first, 0)].abs().sum()) == 0
    assert len(seen) > 20


def test_shifts_beyond_the_grid_leave_nothing():
    image = torch.ones(1, 4, 4, 4)
    found = [
        float(augmented(image, torch.cat([image, image]), seed, Augmentation(0.0, 90, 0.0))[0].sum())
        for seed in range(9)
    ]
    assert found == [0.0] * 9


def test_intensity_leaves_the_truth_and_the_range():
    image, fractions = phantom_examples(1)[0].tensors()
    other, truth = augmented(image, fractions, 1, Augmentation(float(0), 0, 0.3))
    assert torch.equal(truth, fractions)
    assert float((other - image).abs().max()) > 0.02
    assert 0 <= float(other.min()) <= float(other.max()) <= 1
    again = augmented(image, fractions, 1, Augmentation(float(0), 0, 0.3))[0]
    assert torch.equal(other, again)


def cube(n: int = 9) -> torch.Tensor:
    return torch.from_numpy(np.random.default_rng(0).random((1, n, n, n), dtype=np.float32))


def test_turning_by_right_angles_is_an_exchange_of_axes(monkeypatch):
    image = cube()
    monkeypatch.setattr("meshot.pipeline.segmentation.Rotation", _QuarterTurn)
    turned, truth = augmented(image, torch.cat([image, image]), 0, Augmentation(**STILL, turn=90.0))
    torch.testing.assert_close(turned, image.rot90(1, (1, 2)), rtol=0, atol=1e-5)
    assert torch.equal(turned[0], truth[1])


class _QuarterTurn:
    """A quarter turn about the last axis, whatever was drawn."""

    @staticmethod
    def from_euler(axes, angles, degrees):
        assert (axes, degrees) == ("xyz", True)
        assert np.abs(angles).max() <= 90
        return _QuarterTurn()

    def as_matrix(self):
        return np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


def test_stretching_changes_volumes_within_its_bounds():
    lines = torch.linspace(-1, 1, 41)
    ball = (lines[:, None, None] ** 2 + lines[:, None] ** 2 + lines**2 < 0.3).float()[None]
    both = torch.cat([ball, 1 - ball])
    ratios = []
    for seed in range(8):
        image, truth = augmented(ball, both, seed, Augmentation(**STILL, stretch=0.2))
        torch.testing.assert_close(image[0], truth[0])
        ratios.append(float(image.sum() / ball.sum()))
    assert 1.2**-3 < min(ratios) < 0.95 < 1.05 < max(ratios) < 0.8**-3


def test_shrinking_makes_half_of_the_images_smaller_along_all_axes():
    lines = torch.linspace(-1, 1, 41)
    ball = (lines[:, None, None] ** 2 + lines[:, None] ** 2 + lines**2 < 0.5).float()[None]
    both = torch.cat([ball, 1 - ball])
    sizes = []
    for seed in range(24):
        image, truth = augmented(ball, both, seed, Augmentation(**STILL, shrink=0.3))
        torch.testing.assert_close(image[0], truth[0])
        lengths = [float((image[0] > 0.5).any(dim=d).any(dim=0).sum()) for d in (1, 2)]
        assert abs(lengths[0] - lengths[1]) <= 1
        sizes.append(float((image.sum() / ball.sum()) ** (1 / 3)))
    assert 0.69 < min(sizes) < 0.8
    assert max(sizes) == pytest.approx(1, abs=0.01)
    assert 6 <= sum(size > 0.99 for size in sizes) <= 18


def test_bending_moves_by_about_what_is_asked_and_smoothly():
    ramp = torch.arange(40.0)[:, None, None].expand(40, 40, 40)[None] / 100 + 0.3
    image, _ = augmented(ramp, torch.cat([ramp, ramp]), 3, Augmentation(**STILL, bend=2.0))
    inside = (image - ramp)[0, 8:-8, 8:-8, 8:-8] * 100  # displacement along the first axis, in voxels
    assert 0.5 < float(inside.std()) < 2.0
    assert float(inside.diff(dim=1).abs().max()) < 2.0
    again = augmented(ramp, torch.cat([ramp, ramp]), 3, Augmentation(**STILL, bend=2.0))[0]
    assert torch.equal(image, again)


def test_the_raw_contrast_comes_back_in_half_of_the_images_and_leaves_the_truth():
    image, fractions = phantom_examples(1)[0].tensors()
    changed = []
    for seed in range(24):
        other, truth = augmented(image, fractions, seed, Augmentation(**STILL, contrast=0.5))
        assert torch.equal(truth, fractions)
        assert 0 <= float(other.min()) <= float(other.max()) <= 1
        changed.append(not torch.allclose(other, image))
    assert 6 <= sum(changed) <= 18


def test_a_first_placement_has_both_its_size_and_its_contrast():
    lines = torch.linspace(-1, 1, 41)
    ball = 0.5 * (lines[:, None, None] ** 2 + lines[:, None] ** 2 + lines**2 < 0.5).float()[None]
    both = torch.cat([ball, ball])
    for seed in range(12):
        image, _ = augmented(ball, both, seed, Augmentation(**STILL, shrink=0.3, contrast=0.5))
        level, size = float(image[0, 20, 20, 20]), float((image[0] > 0.1).sum() / (ball > 0.1).sum())
        assert (abs(level - 0.5) > 0.003) == (size < 0.995)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"flip": 1.5}, "flip is 1.5"),
        ({"intensity": 1.0}, "intensity is 1.0"),
        ({"stretch": 1.0}, "stretch is 1.0"),
        ({"shrink": 1.0}, "shrink is 1.0"),
        ({"contrast": -1.0}, "contrast is -1.0"),
        ({"shift": -1}, "shift is -1"),
        ({"turn": float("nan")}, "turn is nan"),
        ({"bend": -2.0}, "bend is -2.0"),
    ],
)
def test_doors(arguments, words):
    refuses(words, Augmentation, **arguments)
