"""The picture of slopes draws what it is given, and its lines have the slopes that it writes."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from meshot_book.figures.measures.slopes import draw_slopes


def test_lines_have_the_slopes_that_are_written():
    x = np.array([1.0, 10, 100])
    figure, ax = plt.subplots()
    draw_slopes(ax, {"a": (x, 3 / x, (-1.0, -1.1, -0.9)), "bound": (x, 9 / x, None), "b": (x, x, (1.0, 0.996, 1.004))})
    fitted, points, bound, other, _ = ax.lines
    assert fitted.get_ydata() == pytest.approx(3 / x)
    assert points.get_ydata() == pytest.approx(3 / x)
    assert bound.get_ydata() == pytest.approx(9 / x)
    assert fitted.get_color() != other.get_color()
    assert (ax.get_xscale(), ax.get_yscale()) == ("log", "log")
    names = [text.get_text() for text in ax.legend().get_texts()]
    assert names == ["a: −1.00 [−1.10, −0.90]", "bound", "b: 1.000 [0.996, 1.004]"]
    plt.close(figure)


@pytest.mark.parametrize(("top", "seen"), [(4.0, True), (1e4, False)])
def test_short_axes_are_labelled_between_decades(top, seen):
    figure, ax = plt.subplots()
    draw_slopes(ax, {"a": ([1, 10], [1.2, top], (1.0, 0.9, 1.1))})
    figure.canvas.draw()
    assert ("2" in [label.get_text() for label in ax.get_yticklabels()]) == seen
    plt.close(figure)
