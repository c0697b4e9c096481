"""Pictures of measures on a line: what is drawn is what was given."""

import matplotlib
import numpy as np
import pytest
import torch

matplotlib.use("agg")

import matplotlib.pyplot as plt
from matplotlib.collections import PathCollection

from meshot_book.figures.lines.line import cells_figure, distribution_figure, pairing_figure, pairs_of, step_heights
from meshot_book.lines import monotone_plan

SOURCE = (torch.tensor([3.0, 1.0]).double(), torch.tensor([0.25, 0.75]).double())
TARGET = (torch.tensor([0.0, 9.0, 5.0]).double(), torch.tensor([0.5, 0.125, 0.375]).double())


@pytest.fixture(autouse=True)
def close_figures():
    yield
    plt.close("all")


@pytest.fixture
def plan():
    return monotone_plan(*SOURCE, *TARGET)


def test_pairs_are_drawn_and_crossings_dashed(plan):
    crossed = [(0, 0, 0.5), (1, 1, 0.5)]
    figure = pairing_figure(SOURCE, TARGET, {"best": pairs_of(plan), "crossed": crossed})
    best, other = figure.axes
    ends = [line.get_xdata().tolist() for line in best.lines]
    assert ends == [[1, 0], [1, 5], [3, 5], [3, 9]]
    assert {line.get_linestyle() for line in best.lines} == {"-"}
    assert {line.get_linestyle() for line in other.lines} == {"--"}
    points = [c for c in best.collections if isinstance(c, PathCollection)]
    np.testing.assert_allclose(points[0].get_sizes(), 1500 * SOURCE[1].numpy())


def test_steps_are_sorted_and_end_at_one():
    places, jumps = step_heights(*TARGET)
    assert places.tolist() == [0, 5, 9]
    assert jumps.tolist() == [0, 0.5, 0.875, 1]


def test_distribution_and_quantile_functions_are_each_others_mirror():
    left, right = distribution_figure(SOURCE, TARGET).axes
    x, f = left.lines[1].get_data()
    for place, height in ((-0.1, 0), (0.5, 0.5), (4.9, 0.5), (5.1, 0.875), (9.1, 1)):
        assert f[np.searchsorted(x, place, side="right") - 1] == height
    z, q = right.lines[0].get_data()
    for share, place in ((0.2, 1), (0.74, 1), (0.76, 3), (0.99, 3)):
        assert q[np.searchsorted(z, share, side="right") - 1] == place


def test_cells_name_who_goes_where(plan):
    (ax,) = cells_figure(SOURCE, TARGET, plan).axes
    texts = [text.get_text() for text in ax.texts]
    assert texts == ["1", "3", "0", "5", "9", "1→0", "1→5", "3→5", "3→9"]
    widths = [patch.get_width() for patch in ax.patches]
    assert widths[-4:] == [0.5, 0.25, 0.125, 0.125]
