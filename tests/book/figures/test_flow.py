"""Pictures of flows: what is drawn is what was given."""

import matplotlib
import numpy as np
import pytest
import torch

matplotlib.use("agg")

import matplotlib.pyplot as plt

from meshot_book.figures.flows.flow import (
    bent_grid_figure,
    cell_areas,
    map_figure,
    share_figure,
    steps_figure,
    trajectory_figure,
)

AXIS = torch.linspace(-1, 1, 5, dtype=torch.float64)
LATTICE = torch.stack(torch.meshgrid(AXIS, AXIS, indexing="ij"), dim=-1)


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


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


def test_trajectories():
    times, positions = torch.linspace(0, 1, 4), torch.arange(8.0).reshape(4, 2)
    figure = trajectory_figure({"a": (times, positions), "b": (times, positions)}, columns=2)
    np.testing.assert_array_equal(figure.axes[1].lines[1].get_ydata(), [1, 3, 5, 7])


def test_lines_over_steps():
    lines = {"euler": ([1, 2], [1.0, 0.5]), "rk4": ([1, 2], [1.0, 0.06])}
    figure = steps_figure({"error (units)": lines}, {"euler": 1})
    assert [line.get_label() for line in figure.axes[0].lines] == ["euler, order 1", "rk4"]
    assert figure.axes[0].get_xscale() == figure.axes[0].get_yscale() == "log"


def test_shares_are_written_in_their_fields():
    figure = share_figure({"one": np.array([[0.0, 12.5], [3.0, 100.0]])}, ["a", "b"], ["c", "d"], "x", "y")
    assert [text.get_text() for text in figure.axes[0].texts] == ["0", "12", "3", "1e+02"]


def test_maps_have_x_to_the_right():
    values = torch.zeros(3, 2)
    values[2, 0] = 5.0  # large x, small y
    figure = map_figure({"a": values}, 1.5, "value (units)")
    shown = figure.axes[0].images[0].get_array()
    assert shown.shape == (2, 3)
    assert float(shown[0, 2]) == 5
