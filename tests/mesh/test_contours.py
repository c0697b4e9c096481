"""Contours against their closed forms."""

import math

import pytest
import torch

from meshot.mesh.geometry import edge_lengths, edge_midpoints, edge_normals
from meshot.mesh.shapes import circle, letter_e, near_regular_polygon, regular_polygon, star


def signed_area(contour):
    start, end = contour.vertices[contour.edges].unbind(dim=1)
    return float((start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]).sum() / 2)


def perimeter(contour):
    return float(edge_lengths(contour).sum())


@pytest.mark.parametrize(("n_corners", "radius"), [(3, 1.0), (4, 2.0), (10, 0.5)])
def test_regular_polygon(n_corners, radius):
    contour = regular_polygon(n_corners, radius)
    assert perimeter(contour) == pytest.approx(2 * n_corners * radius * math.sin(math.pi / n_corners))
    assert signed_area(contour) == pytest.approx(n_corners * radius**2 * math.sin(2 * math.pi / n_corners) / 2)
    assert contour.vertices[0].tolist() == pytest.approx([0, radius], abs=1e-12)


def test_circle():
    assert perimeter(circle(2.0)) == pytest.approx(4 * math.pi, rel=4e-6)
    assert perimeter(circle(2.0)) < 4 * math.pi


def test_the_corners_of_a_star_lie_at_two_fifths_of_its_tips():
    assert signed_area(star(5)) == pytest.approx(5 * 1.0 * 0.4 * math.sin(math.pi / 5))


def test_star():
    contour = star(5, 1.5, 0.35)
    edge = math.dist((0, 1.5), (0.35 * math.sin(math.pi / 5), 0.35 * math.cos(math.pi / 5)))
    assert perimeter(contour) == pytest.approx(10 * edge)
    assert signed_area(contour) == pytest.approx(5 * 1.5 * 0.35 * math.sin(math.pi / 5))


def test_letter():
    width, height, stroke = 1.4, 2.0, 0.3
    contour = letter_e(width, height, stroke)
    assert len(contour.vertices) == 12
    assert perimeter(contour) == pytest.approx(2 * height + 6 * width - 4 * stroke)
    assert signed_area(contour) == pytest.approx(stroke * height + 3 * stroke * (width - stroke))
    assert contour.vertices.mean(dim=0)[1].item() == pytest.approx(0)
    low, high = contour.vertices.min(dim=0).values, contour.vertices.max(dim=0).values
    assert (high - low).tolist() == pytest.approx([width, height])


def test_a_letter_as_it_comes():
    """1.4 wide, 2 high, strokes of .3: the corners of the box, and the foot of the upper bar."""
    contour = letter_e()
    assert contour.vertices.abs().max(dim=0).values.tolist() == pytest.approx([0.7, 1.0])
    assert signed_area(contour) == pytest.approx(0.3 * 2 + 3 * 0.3 * 1.1)


def test_near_regular_polygon():
    contour = near_regular_polygon(10, 0.1, generator=3, radius=2.0)
    radii = contour.vertices.norm(dim=1)
    assert float(radii.min()) >= 1.8
    assert float(radii.max()) <= 2.2
    assert float(radii.std()) > 0.05
    assert torch.equal(contour.vertices, near_regular_polygon(10, 0.1, generator=3, radius=2.0).vertices)
    assert torch.equal(near_regular_polygon(7, 0.0, generator=1).vertices, regular_polygon(7).vertices)


@pytest.mark.parametrize("contour", [regular_polygon(5), star(3, 1.0, 0.4), near_regular_polygon(9, 0.2, 0)])
def test_normals_point_outward(contour):
    assert bool(((edge_midpoints(contour) * edge_normals(contour)).sum(dim=1) > 0).all())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: regular_polygon(2), "at least 3"),
        (lambda: regular_polygon(3, 0.0), "radius is .*; a finite number > 0 is needed, in"),
        (lambda: star(1), "at least 2"),
        (lambda: star(5, 1.0, 1.0), "inner_radius"),
        (lambda: star(5, 1.0, -0.1), "inner_radius"),
        (lambda: near_regular_polygon(2, 0.1, 0), "at least 3"),
        (lambda: near_regular_polygon(5, 1.0, 0), "jitter"),
        (
            lambda: near_regular_polygon(5, 0.1, 0, radius=math.inf),
            "radius is .*; a finite number > 0 is needed, in",
        ),
        (lambda: letter_e(stroke=0.7), "room between the bars"),
        (lambda: letter_e(width=0.2), "room between the bars"),
    ],
)
def test_doors(make, message):
    with pytest.raises(ValueError, match=message):
        make()
