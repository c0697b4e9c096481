"""The pictures of systems beside each other: every interval is where it belongs, and names and groups have keys."""

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot_book.figures.measures import intervals_figure, printed_figure

NAMES, GROUPS = ("A", "B", "C"), ("left", "right")


def gap(value):
    return {"gap": value, "low": value - 0.1, "high": value + 0.3}


ROWS = [
    {"name": name, "group": group, "x": gap(i - 0.5 * j), "y": gap(0.0)}
    for i, name in enumerate(NAMES) for j, group in enumerate(GROUPS)
]  # fmt: skip


def test_intervals_are_where_they_belong():
    figure = intervals_figure(ROWS, {"x": "x (mm)", "y": "y"})
    upper, lower = figure.axes
    assert (upper.get_xlabel(), lower.get_xlabel()) == ("x (mm)", "y")
    assert [text.get_text() for text in upper.get_yticklabels()] == list(NAMES)
    assert upper.get_ylim()[0] > upper.get_ylim()[1]  # the first name is above
    for j, drawn in enumerate(upper.containers):
        line, _, (bars,) = drawn
        np.testing.assert_allclose(line.get_xdata(), [-0.5 * j, 1 - 0.5 * j, 2 - 0.5 * j])
        np.testing.assert_allclose(line.get_ydata(), [0, 1, 2], atol=0.4)
        ends = np.array(bars.get_segments())[:, :, 0]
        np.testing.assert_allclose(ends - line.get_xdata()[:, None], [[-0.1, 0.3]] * 3)
    heights = [drawn[0].get_ydata()[0] for drawn in upper.containers]
    assert heights[0] < heights[1]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(GROUPS)
    plt.close(figure)


def test_a_single_group_has_no_legend_and_its_numbers_do_not_touch():
    rows = [row | {"x": gap(row["x"]["gap"] / 40)} for row in ROWS if row["group"] == GROUPS[0]]
    figure = intervals_figure(rows, {"x": "x (mm)"})
    assert not figure.legends
    figure.canvas.draw()
    places = [text.get_window_extent() for text in figure.axes[0].get_xticklabels()]
    assert len(places) > 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(places))
    plt.close(figure)


def test_found_stands_over_printed():
    rows = [{"name": n, "group": g, "printed": i + 1.0, "found": 2.0} for i, n in enumerate(NAMES) for g in GROUPS]
    figure = printed_figure(rows)
    (ax,) = figure.axes
    drawn = {(line.get_color(), line.get_marker()) for line in ax.lines[: len(rows)]}
    assert len(drawn) == len(rows)
    assert [float(line.get_xdata()[0]) for line in ax.lines[:6:2]] == [1.0, 2.0, 3.0]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*NAMES, *GROUPS]
    plt.close(figure)


def test_nothing_to_draw_is_named():
    with pytest.raises(ValueError, match="there is no row to draw"):
        intervals_figure([], {"x": "x"})
    with pytest.raises(ValueError, match="positive numbers are needed"):
        printed_figure([{"name": "a", "group": "b", "printed": 0.0, "found": 1.0}])
    with pytest.raises(ValueError, match="0 rows"):
        printed_figure([])
