"""Pulls against the arrows written down by hand."""

import numpy as np
import pytest
import torch

from meshot.loss.directions import quasi_directions
from meshot.loss.sliced import sliced_wasserstein
from meshot.loss.transport import chamfer
from meshot.measure.discrete import DiscreteMeasure
from meshot_book.flows import forces, probe_forces


@pytest.fixture
def clouds():
    generator = np.random.default_rng(0)
    return [torch.from_numpy(generator.normal(size=(n, 2))) for n in (6, 9)]


def chamfer_arrows(points, target):
    """Slow twin: to the nearest target, and to every target that calls."""
    distances = torch.cdist(points, target)
    arrows = []
    for i in range(len(points)):
        arrow = target[distances[i].argmin()] - points[i]
        for j in range(len(target)):
            if int(distances[:, j].argmin()) == i:
                arrow = arrow + len(points) / len(target) * (target[j] - points[i])
        arrows.append(arrow)
    return torch.stack(arrows)


def test_chamfer_forces_are_the_two_sums(clouds):
    points, target = clouds
    found = forces(lambda x: chamfer(DiscreteMeasure(x), DiscreteMeasure(target)), points)
    torch.testing.assert_close(found, chamfer_arrows(points, target), rtol=1e-12, atol=1e-12)


def test_sliced_force_towards_a_translated_copy_is_half_the_way(clouds):
    points, shift = clouds[0], torch.tensor([0.3, -0.7], dtype=torch.float64)
    target = DiscreteMeasure(points + shift)
    found = forces(lambda x: sliced_wasserstein(DiscreteMeasure(x), target, quasi_directions(8, 2)), points)
    # The mean of θθᵀ over equal angles is exactly I/2.
    torch.testing.assert_close(found, (shift / 2).expand(6, 2), rtol=1e-12, atol=1e-12)


def test_probe_feels_what_a_further_point_would(clouds):
    points, target = clouds
    probes = torch.tensor([[0.1, 0.2], [3.0, 0.0]], dtype=torch.float64)
    found = probe_forces(lambda x: chamfer(DiscreteMeasure(x), DiscreteMeasure(target)), points, probes)
    wanted = [chamfer_arrows(torch.cat([points, probe[None]]), target)[-1] for probe in probes]
    torch.testing.assert_close(found, torch.stack(wanted), rtol=1e-12, atol=1e-12)


def test_bad_points(unchecked):
    with pytest.raises(ValueError, match="floating point"):
        forces(torch.sum, torch.ones(2, 2, dtype=torch.int64))
    with pytest.raises(ValueError, match="shape"):
        forces(torch.sum, torch.ones(2))
