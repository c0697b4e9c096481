"""Force panels draw what they are given, at its true length."""

import numpy as np
import pytest
import torch
from matplotlib.quiver import Quiver

from meshot.view.style import VERMILLION
from meshot_book.figures.points.force import ForceField, force_panels

LIMITS = (-50.0, 50.0, -50.0, 50.0)


@pytest.fixture
def field():
    points = torch.tensor([[0.0, 0], [10, 0], [20, 0]], dtype=torch.float64)
    forces = torch.tensor([[0.0, 3], [0, 0], [0, -40]], dtype=torch.float64)
    return ForceField(points, forces, points + 5)


def arrows(ax):
    (quiver,) = [item for item in ax.collections if isinstance(item, Quiver)]
    return np.stack([quiver.U, quiver.V], axis=1)


def test_arrows_have_their_length_and_points_at_rest_none(field):
    figure = force_panels({"Chamfer": field, "other\ntwo lines": field, "third": field}, LIMITS)
    assert len(figure.axes) == 4
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -40]])
    assert figure.axes[0].get_title() == "Chamfer"
    (quiver,) = [item for item in figure.axes[0].collections if isinstance(item, Quiver)]
    assert np.allclose(quiver.get_facecolor()[0, :3], [int(VERMILLION[i : i + 2], 16) / 255 for i in (1, 3, 5)])


def test_long_arrows_are_cut_and_marked(field):
    figure = force_panels({"Chamfer": field}, LIMITS, longest=10.0, columns=1)
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -10]])
    marked = [item.get_offsets() for item in figure.axes[0].collections if 70 in getattr(item, "get_sizes", tuple)()]
    np.testing.assert_allclose(marked[0], [[20, 0]])


def test_every_second_arrow(field):
    figure = force_panels({"Chamfer": field}, LIMITS, every=2)
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3], [0, -40]])
    figure = force_panels({"Chamfer": field}, LIMITS, every=3)
    np.testing.assert_allclose(arrows(figure.axes[0]), [[0, 3]])


@pytest.mark.parametrize(("typical", "factor"), [(8.0, 0.2), (400.0, 10.0)])
def test_scaled_arrows_state_their_factor(field, typical, factor):
    figure = force_panels({"Chamfer": field}, LIMITS, typical=typical)
    np.testing.assert_allclose(arrows(figure.axes[0]), factor * np.array([[0, 3], [0, -40]]))
    assert figure.axes[0].get_title() == f"Chamfer\narrows × {factor:g}"


def test_doors(field):
    with pytest.raises(ValueError, match="fields is empty"):
        force_panels({}, LIMITS)
    with pytest.raises(ValueError, match="longest is 0"):
        force_panels({"a": field}, LIMITS, longest=0.0)
    with pytest.raises(ValueError, match="typical is 0"):
        force_panels({"a": field}, LIMITS, typical=0.0)
    with pytest.raises(ValueError, match="columns is 0"):
        force_panels({"a": field}, LIMITS, columns=0)
