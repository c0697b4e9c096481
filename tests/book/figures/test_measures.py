"""Pictures of measures, their losses and their costs: what is drawn is what was given."""

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch
from matplotlib.collections import PathCollection

from meshot import empirical, surface
from meshot.loss.exact import projected_law
from meshot.mesh.shapes import circle, cube, letter_e, tetrahedron
from meshot_book.figures.lines.line import cells_figure, distribution_figure, pairing_figure, pairs_of, step_heights
from meshot_book.figures.measures import intervals_figure, printed_figure
from meshot_book.figures.measures.projection import draw_density, law_figure, turned_densities_figure
from meshot_book.figures.measures.schematics import _leaves, banks_figure, encodings_figure, tree_figure
from meshot_book.figures.measures.slopes import FAMILY_COLOURS, cost_figure, draw_slopes
from meshot_book.lines import monotone_plan

ROWS = [
    {"peer": peer, "d": d, "m": m, "seconds": factor * m}
    for peer, factor in (
        ("sliced, fused", 1e-6),
        ("sliced, POT", 1.02e-6),
        ("Chamfer, k-d tree", 1.01e-6),
        ("Sinkhorn, OTT lazy", 1e-3),
        ("np.argsort, both sides", 0.99e-6),
    )
    for d in (3, 6)
    for m in (1000, 10_000)
]


def test_lines_and_names():
    figure = cost_figure(ROWS, "seconds", "time (ms)", 1e3)
    figure.canvas.draw()
    assert len(figure.axes) == 2
    for ax in figure.axes:
        assert ax.get_xscale() == ax.get_yscale() == "log"
        lines = {line.get_color() for line in ax.lines}
        assert lines == {FAMILY_COLOURS[family] for family in ("sliced", "Chamfer", "Sinkhorn", "np.argsort")}
        assert ax.lines[0].get_ydata().tolist() == pytest.approx([1.0, 10.0])
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == list(dict.fromkeys(row["peer"] for row in ROWS))
    assert legend.get_window_extent().y0 >= figure.axes[0].get_window_extent().y1  # above the panels, over no data
    members = {(line.get_marker(), str(line.get_linestyle())) for line in figure.axes[0].lines[:2]}
    assert len(members) == 2


def test_door():
    with pytest.raises(ValueError, match="no row has 'bytes'"):
        cost_figure(ROWS, "bytes", "memory (MB)")


NAMES, GROUPS = ("A", "B", "C"), ("left", "right")


def gap(value):
    return {"gap": value, "low": value - 0.1, "high": value + 0.3}


INTERVALS_ROWS = [
    {"name": name, "group": group, "x": gap(i - 0.5 * j), "y": gap(0.0)}
    for i, name in enumerate(NAMES) for j, group in enumerate(GROUPS)
]  # fmt: skip


def test_intervals_are_where_they_belong():
    figure = intervals_figure(INTERVALS_ROWS, {"x": "x (mm)", "y": "y"})
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


def test_a_single_group_has_no_legend_and_its_numbers_do_not_touch():
    rows = [row | {"x": gap(row["x"]["gap"] / 40)} for row in INTERVALS_ROWS if row["group"] == GROUPS[0]]
    figure = intervals_figure(rows, {"x": "x (mm)"})
    assert not figure.legends
    figure.canvas.draw()
    places = [text.get_window_extent() for text in figure.axes[0].get_xticklabels()]
    assert len(places) > 2
    assert all(left.x1 < right.x0 for left, right in itertools.pairwise(places))


def test_found_stands_over_printed():
    rows = [{"name": n, "group": g, "printed": i + 1.0, "found": 2.0} for i, n in enumerate(NAMES) for g in GROUPS]
    figure = printed_figure(rows)
    (ax,) = figure.axes
    drawn = {(line.get_color(), line.get_marker()) for line in ax.lines[: len(rows)]}
    assert len(drawn) == len(rows)
    assert [float(line.get_xdata()[0]) for line in ax.lines[:6:2]] == [1.0, 2.0, 3.0]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == [*NAMES, *GROUPS]


def test_nothing_to_draw_is_named():
    with pytest.raises(ValueError, match="there is no row to draw"):
        intervals_figure([], {"x": "x"})
    with pytest.raises(ValueError, match="positive numbers are needed"):
        printed_figure([{"name": "a", "group": "b", "printed": 0.0, "found": 1.0}])
    with pytest.raises(ValueError, match="0 rows"):
        printed_figure([])


X = torch.tensor([1.0, 0, 0], dtype=torch.float64)


@pytest.fixture
def ax():
    return plt.subplots()[1]


def test_a_density_is_drawn_down_to_zero(ax):
    law = projected_law(surface(tetrahedron()), X)
    draw_density(ax, law)
    x, y = ax.lines[0].get_data()
    assert y[0] == y[-1] == 0
    assert np.trapezoid(y, x) == pytest.approx(1)
    assert len(ax.lines) == 1


def test_atoms_are_pins_with_their_mass(ax):
    draw_density(ax, projected_law(surface(cube(2.0)), X))
    assert [text.get_text() for text in ax.texts] == ["0.17", "0.17"]
    assert sorted(float(line.get_xdata()[0]) for line in ax.lines[1::2]) == [-1, 1]
    ax.figure.canvas.draw()
    frame = ax.get_window_extent()
    for text in ax.texts:  # within the frame
        box = text.get_window_extent()
        assert frame.x0 < box.x0 < box.x1 < frame.x1
        assert box.y1 < frame.y1


def test_points_are_a_histogram_behind(ax):
    points = (empirical(cube(), 500, 0).points @ X).numpy()
    draw_density(ax, projected_law(surface(cube()), X), points=points)
    assert sum(patch.get_height() * patch.get_width() for patch in ax.patches) == pytest.approx(1)


def test_a_row_for_each_law_with_its_distribution_function():
    laws = {name: projected_law(surface(shape), X) for name, shape in (("a", tetrahedron()), ("b", cube()))}
    figure = law_figure(laws, unit="mm")
    assert [ax.get_title() for ax in figure.axes[::2]] == ["a", "b"]
    x, y = figure.axes[1].lines[0].get_data()
    assert np.array_equal(y, laws["a"].distribution(x))
    assert figure.axes[0].get_ylabel() == "density (1/mm)"


@pytest.mark.parametrize("shape", [cube(2.0), letter_e()], ids=repr)
def test_a_film_strip_turns_the_direction(shape):
    figure = turned_densities_figure(surface(shape), (45, 0))
    above, below = figure.axes[:2], figure.axes[2:]
    assert [ax.get_title() for ax in above] == ["45°", "0°"]
    tips = [annotation.xy for ax in above for annotation in ax.texts]
    assert tips[0][0] == pytest.approx(tips[0][1])
    assert tips[1][1] == pytest.approx(0)
    widths = [np.ptp(ax.lines[0].get_xdata()) for ax in below]
    assert widths[0] > widths[1]


@pytest.mark.parametrize("contour", [letter_e(), circle()], ids=repr)
def test_normals_of_the_varifold_point_outwards_and_points_lie_on_the_contour(contour):
    figure = encodings_figure(contour, 30, 1)
    assert [ax.get_title() for ax in figure.axes] == ["continuous", "empirical", "varifold"]
    drawn = figure.axes[1].collections[0].get_offsets()
    assert len(drawn) == 30
    arrows = np.array([[text.xyann, text.xy] for text in figure.axes[2].texts])
    assert len(arrows) == len(contour.edges)
    # The flux of the position through a closed contour is twice the area inside: positive for outward normals.
    ends = contour.vertices[contour.edges].numpy()
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    flux = (lengths * (ends.mean(axis=1) * (arrows[:, 1] - arrows[:, 0])).sum(axis=1)).sum()
    assert flux > 0


def test_arrows_of_a_blade_point_outwards_and_of_a_slit_inwards():
    for ax, sign in zip(banks_figure().axes, (1, -1)):
        arrows = [text for text in ax.texts if text.get_text() == "" and text.xy[1] > 0]
        assert len(arrows) == 6
        assert all((a.xy[0] - a.xyann[0]) * (a.xyann[0] - 1) * sign > 0 for a in arrows)


def test_leaves_cover_all_points_and_the_nearest_neighbour_lies_in_an_opened_one():
    points = np.random.default_rng(0).random((50, 2))
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    leaves = _leaves(points, low, high, 4)
    inside = [((points >= corner) & (points < far)).all(axis=1) for corner, far in leaves]
    assert np.array_equal(np.sum(inside, axis=0), np.ones(50))
    assert max(map(np.sum, inside)) <= 4
    query = np.array([0.4, 0.6])
    figure = tree_figure(points, query)
    opened = [patch for patch in figure.axes[0].patches if patch.get_hatch()]
    nearest = points[np.hypot(*(points - query).T).argmin()]
    assert 1 <= len(opened) < len(leaves) / 2
    assert any(patch.get_bbox().contains(*nearest) for patch in opened)


def test_lines_have_the_slopes_that_are_written():
    x = np.array([1.0, 10, 100])
    _, ax = plt.subplots()
    draw_slopes(ax, {"a": (x, 3 / x, (-1.0, -1.1, -0.9)), "bound": (x, 9 / x, None), "b": (x, x, (1.0, 0.996, 1.004))})
    fitted, points, bound, other, _ = ax.lines
    assert fitted.get_ydata() == pytest.approx(3 / x)
    assert points.get_ydata() == pytest.approx(3 / x)
    assert bound.get_ydata() == pytest.approx(9 / x)
    assert fitted.get_color() != other.get_color()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    names = [text.get_text() for text in ax.legend().get_texts()]
    assert names == ["a: −1.00 [−1.10, −0.90]", "bound", "b: 1.000 [0.996, 1.004]"]


SOURCE = (torch.tensor([3.0, 1.0]).double(), torch.tensor([0.25, 0.75]).double())


TARGET = (torch.tensor([0.0, 9.0, 5.0]).double(), torch.tensor([0.5, 0.125, 0.375]).double())


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
