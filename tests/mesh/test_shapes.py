import math

import pytest
import torch

from meshot.mesh.geometry import face_areas, face_barycentres, face_normals, mesh_edges, signed_volume
from meshot.mesh.shapes import cube, ellipsoid, folded_sphere, icosphere, split_in_four, tetrahedron

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
    halves = torch.cat([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]])
    forward = {tuple(edge) for edge in halves.tolist()}
    assert len(forward) == len(halves)
    assert all((b, a) in forward for a, b in forward)
    assert len(mesh.vertices) - len(mesh_edges(mesh)) + len(mesh.faces) == 2
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
    ],
)
def test_doors(make, words):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize(("shape", "words"), [((3, 3), "has 3 rows"), ((4, 2), "shape")])
def test_doors_behind_the_annotations(unchecked, shape, words):
    with pytest.raises(ValueError, match=words):
        tetrahedron(torch.ones(shape))
