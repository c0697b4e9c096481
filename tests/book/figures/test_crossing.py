"""Two triangles that a flow drives into each other."""

import itertools

import pytest
import torch

from meshot_book.examples.counterexample import crossing_time
from meshot_book.figures.flows.flow import FIELDS, crossing_figure, outlines, two_triangles


def turn(a, b, c):
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return (area > 0) - (area < 0)


def crossing_pairs(shapes):
    """Slow twin: every side of every outline against every other."""
    sides = [(p, q) for shape in shapes.tolist() for p, q in zip(shape, shape[1:] + shape[:1], strict=True)]
    return sum(
        turn(*s, t[0]) * turn(*s, t[1]) < 0 and turn(*t, s[0]) * turn(*t, s[1]) < 0
        for s, t in itertools.combinations(sides, 2)
    )


def test_the_push_crosses_at_the_moment_of_the_formula():
    corners, moment = two_triangles(0.3), crossing_time(0.3, FIELDS["push"])
    for time, pairs in ((moment - 1e-6, 0), (moment + 1e-6, 2)):
        assert crossing_pairs(outlines(FIELDS["push"], corners, time, 5, 1)) == pairs


def test_outlines_start_as_they_are():
    shapes = outlines(FIELDS["whirl"], two_triangles(), 0.0, 3, 4)
    assert shapes.shape == (2, 12, 2)
    assert torch.equal(shapes[:, ::4], two_triangles())
    torch.testing.assert_close(shapes[0, 1], torch.tensor([-0.75, -0.25]).double())


def test_still_picture_shows_both_outlines():
    figure = crossing_figure(FIELDS["push"], 0.3, 0.6, 8, (1, 16))
    assert [ax.get_title() for ax in figure.axes] == ["corners only", "sides in 16 pieces"]
    assert all(len(ax.patches) == len(ax.lines) == 2 for ax in figure.axes)


@pytest.mark.parametrize("gap", [0.0, 1.0])
def test_doors(gap):
    with pytest.raises(ValueError, match=f"gap is {gap}"):
        two_triangles(gap)
