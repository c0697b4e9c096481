"""To and from trimesh and PyVista, and polygons cut into triangles."""

import math

import numpy as np
import pytest
import pyvista
import torch
import trimesh

from meshot import Mesh, random_directions, read_mesh, sliced_wasserstein, surface, triangulate, write_mesh
from meshot.mesh.geometry import face_area_vectors, face_areas, signed_volume
from meshot.mesh.shapes import cube, folded_sphere
from refusals import refuses

IMAGE = pyvista.ImageData(dimensions=(3, 3, 3))


def same(mesh: Mesh, other: Mesh) -> bool:
    return torch.equal(mesh.vertices, other.vertices) and torch.equal(mesh.faces, other.faces)


def test_trimesh_sees_the_same_mesh():
    mesh = folded_sphere(2, 1.0, 0.2)
    theirs = mesh.to_trimesh()
    assert isinstance(theirs, trimesh.Trimesh)
    np.testing.assert_array_equal(theirs.vertices, mesh.vertices.numpy())
    np.testing.assert_array_equal(theirs.faces, mesh.faces.numpy())
    assert theirs.is_watertight
    assert theirs.volume == pytest.approx(float(signed_volume(mesh)), rel=1e-12)
    assert same(Mesh.from_trimesh(theirs), mesh)


def test_pyvista_sees_the_same_mesh():
    mesh = folded_sphere(2, 1.0, 0.2)
    theirs = mesh.to_pyvista()
    assert isinstance(theirs, pyvista.PolyData)
    assert theirs.volume == pytest.approx(float(signed_volume(mesh)), rel=1e-12)
    assert theirs.area == pytest.approx(float(face_areas(mesh).sum()), rel=1e-12)
    assert same(Mesh.from_pyvista(theirs), mesh)


def test_a_gradient_and_single_precision_do_not_stand_in_the_way():
    vertices = cube().vertices.float().requires_grad_()
    moving = cube().to(torch.float32).with_vertices(vertices)
    for back in (Mesh.from_trimesh(moving.to_trimesh()), Mesh.from_pyvista(moving.to_pyvista())):
        assert torch.equal(back.vertices, vertices.detach().double())


def test_what_comes_is_a_copy():
    box = trimesh.creation.box()
    mesh = Mesh.from_trimesh(box)
    box.vertices += 1
    assert float(mesh.vertices.max()) == 0.5


def test_faces_with_four_corners_and_strips_are_cut():
    assert float(face_areas(Mesh.from_pyvista(pyvista.Cube())).sum()) == pytest.approx(6, rel=1e-6)
    strips = pyvista.Sphere().strip()
    assert strips.n_strips > 0
    assert float(signed_volume(Mesh.from_pyvista(strips))) == pytest.approx(pyvista.Sphere().volume, rel=1e-6)


def scene() -> trimesh.Scene:
    """A red box five to the right, and a blue one turned by 90 degrees, twice as large, in the middle."""
    red, blue = trimesh.creation.box(extents=(1, 2, 3)), trimesh.creation.box(extents=(1, 2, 3))
    for box, colour in ((red, [255, 0, 0, 255]), (blue, [0, 0, 255, 255])):
        box.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(baseColorFactor=colour))
    made = trimesh.Scene()
    made.add_geometry(red, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    turn = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 0, 1])
    turn[:3, :3] *= 2
    made.add_geometry(blue, transform=turn)
    return made


def check_scene(mesh: Mesh) -> None:
    assert (len(mesh.vertices), len(mesh.faces)) == (16, 24)
    low, high = mesh.vertices.amin(dim=0), mesh.vertices.amax(dim=0)
    # Single precision in the file: 6e-8 of coordinates up to 5.5.
    torch.testing.assert_close(low, torch.tensor([-2.0, -1, -3]).double(), rtol=0, atol=1e-6)
    torch.testing.assert_close(high, torch.tensor([5.5, 1, 3]).double(), rtol=0, atol=1e-6)
    assert float(signed_volume(mesh)) == pytest.approx(6 + 8 * 6, rel=1e-6)


def test_a_scene_is_joined_where_its_transforms_put_its_parts(tmp_path):
    check_scene(Mesh.from_trimesh(scene()))
    scene().export(tmp_path / "scene.glb")
    check_scene(read_mesh(tmp_path / "scene.glb"))


def test_seams_of_a_glb_file_are_closed(tmp_path):
    """Flat shading gives every face corners of its own; the surface is closed all the same."""
    box = trimesh.creation.box()
    loose = trimesh.Trimesh(box.vertices[box.faces.reshape(-1)], np.arange(36).reshape(-1, 3), process=False)
    loose.export(tmp_path / "loose.glb")
    mesh = read_mesh(tmp_path / "loose.glb")
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)
    assert mesh.to_trimesh().is_watertight


@pytest.mark.parametrize("suffix", ["vtp", "vtk"])
def test_pyvista_reads_and_writes_the_same_files(tmp_path, suffix):
    mesh = folded_sphere(1, 40.0, 8.0)
    write_mesh(tmp_path / f"ours.{suffix}", mesh)
    np.testing.assert_array_equal(pyvista.read(tmp_path / f"ours.{suffix}").points, mesh.vertices.numpy())
    mesh.to_pyvista().save(tmp_path / f"theirs.{suffix}", binary=False)
    # ASCII files of VTK keep ten or more digits.
    torch.testing.assert_close(read_mesh(tmp_path / f"theirs.{suffix}").vertices, mesh.vertices, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("read", "value", "words"),
    [
        (
            Mesh.from_trimesh,
            np.zeros((3, 3)),
            "a numpy.ndarray was given; a trimesh.Trimesh or a trimesh.Sce",
        ),
        (Mesh.from_trimesh, trimesh.PointCloud(np.zeros((3, 3))), "a trimesh.PointCloud was given"),
        (Mesh.from_trimesh, trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), int)), "has no triangles"),
        (Mesh.from_trimesh, trimesh.Scene(), "has no triangles"),
        (Mesh.from_pyvista, None, "a NoneType was given; a pyvista.PolyData is needed"),
        (Mesh.from_pyvista, IMAGE, r"a pyvista.ImageData was given; .*have \.extract_surface"),
        (Mesh.from_pyvista, pyvista.PolyData(np.zeros((3, 3))), "has no triangles"),
    ],
)
def test_what_is_no_mesh_is_refused(unchecked, read, value, words):
    refuses(words, read, value)


def test_a_file_without_triangles_is_refused(tmp_path):
    IMAGE.save(tmp_path / "image.vtk")
    refuses(r"image.vtk cannot be read as a vtk mesh: a pyvista.ImageData was given", read_mesh, tmp_path / "image.vtk")


STAR = [(math.cos(a) * r, math.sin(a) * r) for a, r in zip(np.arange(10) * math.pi / 5, [3, 1] * 5, strict=True)]
COMB = [(0, 0), (6, 0), (6, 3), (5, 3), (5, 1), (4, 1), (4, 3), (3, 3), (3, 1), (1, 1), (1, 3), (0, 3)]
SPIRAL = [(0, 0), (5, 0), (5, 5), (1, 5), (1, 2), (3, 2), (3, 3), (2, 3), (2, 4), (4, 4), (4, 1), (0, 1)]


def lifted(polygon) -> torch.Tensor:
    """Points of the plane on a tilted one in space."""
    frame = np.linalg.qr(np.random.default_rng(0).standard_normal((3, 3)))[0]
    return torch.from_numpy(np.array(polygon, dtype=float) @ frame[:2])


@pytest.mark.parametrize("shift", range(10))
@pytest.mark.parametrize("polygon", [STAR, COMB, SPIRAL], ids=["star", "comb", "spiral"])
def test_areas_add_up_with_one_orientation(polygon, shift):
    """The shoelace formula; every triangle turns as the polygon does, so that none is covered twice."""
    order = [(i + shift) % len(polygon) for i in range(len(polygon))]
    x, y = np.array(polygon, dtype=float).T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    vectors = face_area_vectors(triangulate(lifted(polygon), [order]))
    assert len(vectors) == len(polygon) - 2
    assert float(vectors.sum(dim=0).norm()) == pytest.approx(area, rel=1e-12)
    assert float(vectors.norm(dim=1).sum()) == pytest.approx(area, rel=1e-12)


def test_squares_of_a_cube_make_the_measure_of_its_triangles():
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    turned = [square[k % 4 :] + square[: k % 4] for k, square in enumerate(squares)]
    mesh = triangulate(cube().vertices, turned)
    assert float(signed_volume(mesh)) == pytest.approx(1)
    directions = random_directions(6, 3, 0)
    assert float(sliced_wasserstein(surface(mesh), surface(cube()), directions)) < 1e-28


def test_faces_of_several_sizes_in_their_order():
    vertices = lifted([(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1), (1, 2)]).requires_grad_()
    mesh = triangulate(vertices, [[0, 1, 4, 5], [5, 4, 6], torch.tensor([1, 2, 3, 4])])
    assert mesh.faces.tolist() == [[0, 1, 4], [0, 4, 5], [5, 4, 6], [1, 2, 3], [1, 3, 4]]
    assert mesh.vertices.requires_grad


UNIT = [(0, 0), (1, 0), (1, 1), (0, 1)]


@pytest.mark.parametrize(
    ("places", "polygons", "words"),
    [
        (UNIT, [[0, 1]], r"polygon 0 is \[0, 1\]; at least three"),
        (UNIT, [[0, 1, 2], [0, 1, 2, 1]], "polygon 1 is .* each a vertex of its own"),
        (UNIT, [[0, 1, 4, 2]], "there are 4 vertices"),
        (UNIT, [], "faces is empty"),
        ([(0, 0), (3, 2), (3, 0), (0, 1)], [[0, 1, 2, 3]], "crosses itself"),
        ([(0, 0), (4, 0), (1, 3), (2, -1), (3, 3)], [[0, 1, 2, 3, 4]], "crosses itself"),
    ],
)
def test_polygons_that_cannot_be_divided_are_refused(unchecked, places, polygons, words):
    refuses(words, triangulate, lifted(places), polygons)
