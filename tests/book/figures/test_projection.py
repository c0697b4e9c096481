"""Pictures of projected laws show what the laws say."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import torch

from meshot import empirical, surface
from meshot.loss.exact import projected_law
from meshot.mesh.shapes import cube, letter_e, tetrahedron
from meshot_book.figures.measures.projection import draw_density, law_figure, turned_densities_figure

X = torch.tensor([1.0, 0, 0], dtype=torch.float64)


@pytest.fixture
def ax():
    figure, axes = plt.subplots()
    yield axes
    plt.close(figure)


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
    plt.close(figure)


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
    plt.close(figure)
