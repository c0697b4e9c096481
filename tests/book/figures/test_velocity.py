"""Pictures of velocities: places in the plane, arrows of the velocity there, at their length."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.quiver import Quiver

from meshot.flow.fields import VelocityField
from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot_book.figures.flows.velocity import velocities_on_slice, velocity_figure
from meshot_book.figures.measures.stepping import step_errors_figure

VOLUME = Volume(np.arange(1000.0).reshape(10, 10, 10), np.diag([2.0, 1.0, 1.0, 1.0]))


class Spin(VelocityField):
    """Around the z axis, and up."""

    def __call__(self, time, points):
        return torch.stack([-points[:, 1], points[:, 0], torch.full_like(points[:, 0], 3.0)], dim=1)

    def lipschitz_bound(self):
        return torch.tensor(1.0)


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


@pytest.mark.parametrize(("plane", "axis"), [("axial", 2), ("coronal", 1), ("sagittal", 0)])
def test_arrows_start_in_the_plane_and_are_the_velocity(plane, axis):
    places, moves = velocities_on_slice(Spin(), VOLUME, plane, 4.5, 5, torch.zeros(0).double())
    np.testing.assert_array_equal(places[:, axis], 4.5)
    np.testing.assert_allclose(moves, np.stack([-places[:, 1], places[:, 0], np.full(len(places), 3.0)], axis=1))
    steps = np.diff(np.unique(places[:, (axis + 1) % 3]))
    np.testing.assert_allclose(steps, steps[0])


def test_the_picture_shows_them_magnified():
    meshes = {"ball": icosphere(2, 3.0, (8.0, 4.0, 4.0))}
    figure = velocity_figure(Spin(), VOLUME, "coronal", 4.5, meshes, n_arrows=6, magnification=2.0, longest=7.0)
    ax, bar = figure.axes
    (quiver,) = [item for item in ax.collections if isinstance(item, Quiver)]
    _, moves = velocities_on_slice(Spin(), VOLUME, "coronal", 4.5, 6, torch.zeros(0).double())
    np.testing.assert_allclose(np.stack([quiver.U, quiver.V], axis=1), 2 * moves[:, [0, 2]])
    np.testing.assert_allclose(quiver.get_array(), np.linalg.norm(moves, axis=1))
    assert quiver.get_clim() == (0, 7)
    assert "× 2" in bar.get_xlabel()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x (mm)", "z (mm)")


def test_a_field_at_rest_can_be_drawn():
    still = Spin()
    still.__class__ = type("Still", (Spin,), {"__call__": lambda self, time, points: torch.zeros_like(points)})
    assert velocity_figure(still, VOLUME, "axial", 4.0).axes


def test_doors():
    with pytest.raises(ValueError, match="plane is 'top'"):
        velocity_figure(Spin(), VOLUME, "top", 4.0)
    with pytest.raises(ValueError, match="n_arrows is 0"):
        velocity_figure(Spin(), VOLUME, "axial", 4.0, n_arrows=0)
    with pytest.raises(ValueError, match="magnification is 0"):
        velocity_figure(Spin(), VOLUME, "axial", 4.0, magnification=0.0)
    with pytest.raises(ValueError, match="from_target has 1 values"):
        step_errors_figure([1, 2], {"euler": [1.0, 0.5]}, [1.0])


def test_steps_are_drawn_as_given():
    figure = step_errors_figure([1, 5, 10], {"mean": [1.0, 0.2, 0.1]}, [0.5, 0.4, 0.4], {"initial": 0.9})
    upper, lower = figure.axes
    np.testing.assert_array_equal(upper.lines[0].get_ydata(), [1.0, 0.2, 0.1])
    assert upper.get_yscale() == "log"
    np.testing.assert_array_equal(lower.lines[0].get_ydata(), [0.5, 0.4, 0.4])
    assert lower.lines[1].get_label() == "initial"
    assert [text.get_text() for text in lower.get_xticklabels()] == ["1", "5", "10"]
