"""Shapes and contours against their closed forms."""

import math

import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import (
    edge_lengths,
    edge_midpoints,
    edge_normals,
    face_areas,
    face_barycentres,
    face_normals,
    signed_volume,
)
from meshot.mesh.shapes import (
    circle,
    cube,
    ellipsoid,
    folded_sphere,
    icosphere,
    letter_e,
    near_regular_polygon,
    regular_polygon,
    split_in_four,
    star,
    tetrahedron,
)
from refusals import refuses

SHAPES = {
    "icosphere": lambda: icosphere(2, 3.0),
    "ellipsoid": lambda: ellipsoid(2, (1.0, 2.0, 3.0)),
    "folded": lambda: folded_sphere(3),
    "cube": lambda: cube(2.0),
    "tetrahedron": tetrahedron,
}


@pytest.mark.parametrize("name", SHAPES)
def test_closed_outward_of_genus_zero(name):
    mesh = SHAPES[name]()
    assert topology(mesh) == SPHERE
    assert signed_volume(mesh) > 0


def test_icosphere_tends_to_the_sphere_at_second_order():
    errors = []
    for subdivisions in (3, 4):
        mesh = icosphere(subdivisions, 2.0, centre=(5.0, -1.0, 3.0))
        assert len(mesh.faces) == 20 * 4**subdivisions
        assert len(mesh.vertices) == 10 * 4**subdivisions + 2
        errors.append((16 * math.pi - float(face_areas(mesh).sum()), 32 / 3 * math.pi - float(signed_volume(mesh))))
    for coarse, fine in zip(*errors, strict=True):
        assert 0 < fine < coarse
        assert math.log2(coarse / fine) == pytest.approx(2, abs=0.02)


def test_icosphere_lies_on_its_sphere():
    mesh = icosphere(3, 2.0, centre=(5.0, -1.0, 3.0), dtype=torch.float32)
    assert mesh.vertices.dtype == torch.float32
    distance = torch.linalg.vector_norm(mesh.vertices - torch.tensor([5.0, -1.0, 3.0]), dim=1)
    torch.testing.assert_close(distance, torch.full_like(distance, 2.0))


def test_ellipsoid_volume():
    assert float(signed_volume(ellipsoid(5, (1.0, 2.0, 3.0)))) == pytest.approx(8 * math.pi, rel=2e-3)


def test_folded_sphere_is_a_radial_graph():
    mesh = folded_sphere(4, radius=40.0, depth=6.0)
    outward = (face_normals(mesh) * face_barycentres(mesh)).sum(dim=1)
    assert float(outward.min()) > 0
    lengths = torch.linalg.vector_norm(mesh.vertices, dim=1)
    torch.testing.assert_close(mesh.vertices / lengths[:, None], icosphere(4).vertices)
    assert 34 <= float(lengths.min()) < 36
    assert 44 < float(lengths.max()) <= 46
    torch.testing.assert_close(folded_sphere(2, 3.0, 0.0).vertices, icosphere(2, 3.0).vertices)


def test_cube_and_tetrahedron_measures():
    assert float(signed_volume(cube(2.0))) == pytest.approx(8)
    assert float(face_areas(cube(2.0)).sum()) == pytest.approx(24)
    assert float(signed_volume(tetrahedron())) == pytest.approx(8 / 3)
    corners = torch.tensor([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=torch.float64)
    for order in ([0, 1, 2, 3], [1, 0, 2, 3]):
        assert float(signed_volume(tetrahedron(corners[order]))) == pytest.approx(1 / 6)


def test_splitting_keeps_area_and_orientation():
    mesh = tetrahedron()
    points, faces = split_in_four(mesh.vertices, mesh.faces)
    split = type(mesh)(points, faces)
    assert len(points) == 4 + 6
    assert float(face_areas(split).sum()) == pytest.approx(float(face_areas(mesh).sum()))
    assert float(signed_volume(split)) == pytest.approx(8 / 3)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: icosphere(-1), "subdivisions is -1"),
        (lambda: icosphere(10), "subdivisions is 10"),
        (lambda: icosphere(True), "subdivisions is True"),
        (lambda: icosphere(1, 0.0), "radius is 0.0"),
        (lambda: icosphere(1, float("nan")), "radius is nan"),
        (lambda: ellipsoid(1, (1.0, -1.0, 1.0)), "the radius along y is -1.0"),
        (lambda: folded_sphere(1, 3.0, 3.0), "depth is 3.0"),
        (lambda: folded_sphere(1, -3.0, 1.0), "radius is -3.0"),
        (lambda: cube(math.inf), "side is inf"),
        (lambda: tetrahedron(torch.eye(4, 3)[[0, 1, 2, 2]]), "in one plane"),
        (lambda: tetrahedron(torch.full((4, 3), math.nan)), "NaN"),
        (lambda: tetrahedron(torch.ones(3, 3)), "has 3 rows"),
        (lambda: tetrahedron(torch.ones(4, 2)), "shape"),
        (lambda: regular_polygon(2), "at least 3"),
        (lambda: regular_polygon(3, 0.0), "radius is .*; a finite number > 0 is needed, in"),
        (lambda: star(1), "at least 2"),
        (lambda: star(5, 1.0, 1.0), "inner_radius"),
        (lambda: star(5, 1.0, -0.1), "inner_radius"),
        (lambda: near_regular_polygon(2, 0.1, 0), "at least 3"),
        (lambda: near_regular_polygon(5, 1.0, 0), "jitter"),
        (lambda: near_regular_polygon(5, 0.1, 0, radius=math.inf), "radius is inf; a finite number > 0 is needed"),
        (lambda: letter_e(stroke=0.7), "room between the bars"),
        (lambda: letter_e(width=0.2), "room between the bars"),
    ],
)
def test_doors(unchecked, make, words):
    refuses(words, make)


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


def test_star():
    """By default its corners lie at two fifths of its tips."""
    assert signed_area(star(5)) == pytest.approx(5 * 1.0 * 0.4 * math.sin(math.pi / 5))
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
