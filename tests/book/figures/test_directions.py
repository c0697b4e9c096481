"""The disc of directions: opposite directions are one place, equal areas stay equal."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("agg")

import matplotlib.pyplot as plt

from meshot.loss.directions import random_directions
from meshot_book.figures.points.directions import directions_figure, disc_places


def test_a_line_has_one_place_in_the_disc():
    directions = random_directions(50, 3, 0).numpy()
    places = disc_places(directions)
    assert np.linalg.norm(places, axis=1).max() <= 1
    assert disc_places(-directions) == pytest.approx(places)
    assert disc_places(np.array([[0.0, 0, -1]])) == pytest.approx(np.zeros((1, 2)))
    assert np.linalg.norm(disc_places(np.array([[0.6, 0.8, 0]]))) == pytest.approx(1)


def test_equal_areas():
    """Uniform directions fill the disc uniformly: the share within radius r is r²."""
    radius = np.linalg.norm(disc_places(random_directions(20_000, 3, 0).numpy()), axis=1)
    for r in (0.3, 0.6, 0.9):
        assert np.mean(radius < r) == pytest.approx(r * r, abs=0.015)


def test_a_disc_for_each_set():
    sets = {name: random_directions(n, 3, 0) for name, n in (("few", 5), ("many", 40), ("one", 1))}
    figure = directions_figure(sets)
    assert [ax.get_title() for ax in figure.axes] == ["few", "many", "one", ""]
    np.testing.assert_allclose(figure.axes[1].collections[0].get_offsets(), disc_places(sets["many"].numpy()))
    plt.close(figure)
