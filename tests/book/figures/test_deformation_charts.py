"""Charts of deformed meshes: every arm keeps its colour, dashes and marker, and what is drawn is what was given."""

import matplotlib

matplotlib.use("agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot.view.style import BLACK, LOSS_COLOURS
from meshot_book.figures.flows.deformation_charts import arm_line, arms_figure, histogram_figure, trade_off_figure

ARMS = {"Chamfer, varifold": ([1, 2, 3], [4.0, 2.0, 1.0]), "sliced Wasserstein, samples": ([1, 2, 3], [4.0, 3.0, 2.0])}


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_an_arm_has_the_colour_of_its_loss_and_the_marker_of_its_encoding():
    assert arm_line("Chamfer, varifold")["color"] == LOSS_COLOURS["Chamfer"]
    assert arm_line("Sinkhorn, samples")["marker"] == arm_line("Chamfer, samples")["marker"]
    assert arm_line("Chamfer, samples")["marker"] != arm_line("Chamfer, varifold")["marker"]
    assert arm_line("something else")["color"] == BLACK


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


def test_wide_ranges_keep_their_powers_of_ten():
    figure = arms_figure({"iteration": {"a": ([1, 2], [1e-3, 10.0])}}, "ASSD (mm)")
    assert set(figure.axes[0].get_yticks()) >= {0.01, 0.1, 1.0}
    assert arms_figure({"iteration": ARMS}, "mm", y_scale="linear").axes[0].get_yscale() == "linear"


def test_runs_are_drawn_one_by_one():
    figure = trade_off_figure({"evenness": ARMS, "angle (°)": ARMS}, "ASSD (mm)", {"evenness": 0.3})
    upper, lower = figure.axes
    np.testing.assert_array_equal(upper.collections[0].get_offsets(), [[1, 4], [2, 2], [3, 1]])
    assert len(upper.lines) == 1
    assert len(lower.lines) == 0
    assert lower.get_xlabel() == "ASSD (mm)"
