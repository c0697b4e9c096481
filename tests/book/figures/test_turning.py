"""The still of the turning line: its costs are those of the library."""

import numpy as np
import pytest
import torch

from meshot.loss import slice_costs, sliced_wasserstein
from meshot.measure.discrete import DiscreteMeasure
from meshot_book.figures.lines.line import line_costs, turning_figure

GENERATOR = np.random.default_rng(3)
SOURCE, TARGET = (torch.from_numpy(GENERATOR.normal(size=(9, 2)) + shift) for shift in ([0.5, 0], [-1, 0.3]))


def directions(degrees):
    radians = torch.deg2rad(torch.as_tensor(degrees, dtype=torch.float64))
    return torch.stack([radians.cos(), radians.sin()], dim=1)


def costs(degrees):
    return slice_costs(DiscreteMeasure(SOURCE), DiscreteMeasure(TARGET), directions(degrees)).numpy()


def test_costs_that_are_drawn_are_ours():
    degrees = np.array([0, 17, 90, 179.5])
    assert line_costs(SOURCE.numpy(), TARGET.numpy(), degrees) == pytest.approx(costs(degrees), rel=1e-12)


def test_picture_shows_points_curve_and_mean():
    plane, curve = turning_figure(SOURCE, TARGET, 40).axes
    np.testing.assert_allclose(plane.collections[0].get_offsets(), SOURCE.numpy())
    np.testing.assert_allclose(plane.collections[2].get_offsets(), TARGET.numpy())
    mean = float(sliced_wasserstein(DiscreteMeasure(SOURCE), DiscreteMeasure(TARGET), directions(np.arange(180))))
    assert curve.lines[0].get_ydata() == pytest.approx(costs(np.arange(180)), rel=1e-12)
    assert curve.lines[1].get_ydata()[0] == pytest.approx(mean, rel=1e-12)
    assert curve.lines[2].get_ydata()[0] == pytest.approx(costs([40])[0], rel=1e-12)
