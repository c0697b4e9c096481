"""Pictures of flows, velocities and deformed meshes: what is drawn is what was given."""

import numpy as np
import pytest
import torch
from matplotlib.quiver import Quiver

from meshot.flow.fields import VelocityField
from meshot.mesh.shapes import icosphere
from meshot.volume.volume import Volume
from meshot_book.figures.flows.deformation import arms_figure, histogram_figure, trade_off_figure
from meshot_book.figures.flows.flow import (
    bent_grid_figure,
    cell_areas,
    map_figure,
    velocities_on_slice,
    velocity_figure,
)
from meshot_book.figures.measures.slopes import step_errors_figure

ARMS = {"Chamfer, varifold": ([1, 2, 3], [4.0, 2.0, 1.0]), "sliced Wasserstein, samples": ([1, 2, 3], [4.0, 3.0, 2.0])}


def test_histograms_share_their_bins_and_hold_every_value():
    numbers = np.random.default_rng(0).exponential(size=(2, 500))
    figure = histogram_figure({"length (mm)": {"Chamfer": numbers[0], "target": numbers[1]}}, n_bins=10)
    (ax,) = figure.axes
    assert ax.get_xlabel() == "length (mm)"
    outlines = [patch.get_path().vertices for patch in ax.patches]
    assert len(outlines) == 2
    low, high = numbers.min(), np.quantile(numbers, 0.995)
    for vertices, values in zip(outlines, numbers, strict=True):
        assert (vertices[:, 0].min(), vertices[:, 0].max()) == pytest.approx((low, high))
        height = vertices[:, 1].max()
        assert height == pytest.approx(np.histogram(values.clip(low, high), 10, (low, high), density=True)[0].max())


def test_arms_are_drawn_over_every_clock():
    figure = arms_figure({"iteration": ARMS, "time (s)": ARMS}, "ASSD (mm)", {"floor": 1.5})
    assert [ax.get_xlabel() for ax in figure.axes] == ["iteration", "time (s)"]
    names = ["Chamfer, varifold", "sliced, samples", "floor"]  # a legend has room for short names
    for ax in figure.axes:
        assert [line.get_label() for line in ax.lines] == names
        np.testing.assert_array_equal(ax.lines[0].get_ydata(), [4, 2, 1])
        assert ax.get_yscale() == "log"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == names
    assert {1.0, 2.0} <= set(figure.axes[0].get_yticks())


def test_runs_are_drawn_one_by_one():
    figure = trade_off_figure({"evenness": ARMS, "angle (°)": ARMS}, "ASSD (mm)", {"evenness": 0.3})
    upper, lower = figure.axes
    np.testing.assert_array_equal(upper.collections[0].get_offsets(), [[1, 4], [2, 2], [3, 1]])
    assert len(upper.lines) == 1
    assert len(lower.lines) == 0
    assert lower.get_xlabel() == "ASSD (mm)"


AXIS = torch.linspace(-1, 1, 5, dtype=torch.float64)


LATTICE = torch.stack(torch.meshgrid(AXIS, AXIS, indexing="ij"), dim=-1)


def test_areas_of_cells():
    torch.testing.assert_close(cell_areas(LATTICE), torch.full((4, 4), 0.25).double())
    torch.testing.assert_close(cell_areas(2 * LATTICE), torch.full((4, 4), 1.0).double())
    assert bool((cell_areas(LATTICE.flip(0)) < 0).all())


def test_cells_that_are_turned_over_are_filled():
    bent = LATTICE.clone()
    bent[2, 2] = torch.tensor([1.4, 0.1])
    paths = {"bent": LATTICE[0][None]}
    figure = bent_grid_figure({"plain": LATTICE, "bent": bent}, paths)
    filled = [ax.collections[1].get_paths() for ax in figure.axes]
    assert len(filled[0]) == 0
    assert len(filled[1]) == int((cell_areas(bent) < 0).sum()) > 0
    assert [len(ax.collections[0].get_segments()) for ax in figure.axes] == [10, 10]
    assert [len(ax.lines) for ax in figure.axes] == [0, 2 * 5]


def test_maps_have_x_to_the_right():
    values = torch.zeros(3, 2)
    values[2, 0] = 5.0  # large x, small y
    figure = map_figure({"a": values}, 1.5, "value (units)")
    shown = figure.axes[0].images[0].get_array()
    assert shown.shape == (2, 3)
    assert float(shown[0, 2]) == 5


VOLUME = Volume(np.arange(1000.0).reshape(10, 10, 10), np.diag([2.0, 1.0, 1.0, 1.0]))


class Spin(VelocityField):
    """Around the z axis, and up."""

    def __call__(self, time, points):
        return torch.stack([-points[:, 1], points[:, 0], torch.full_like(points[:, 0], 3.0)], dim=1)

    def lipschitz_bound(self):
        return torch.tensor(1.0)


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
