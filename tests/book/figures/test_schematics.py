"""Schematic pictures show what they say."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot.mesh.shapes import circle, letter_e
from meshot_book.figures.measures.schematics import _leaves, banks_figure, encodings_figure, tree_figure


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


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
