"""To and from trimesh and PyVista, and the formats that they read and write for us."""

import numpy as np
import pytest
import pyvista
import torch
import trimesh

from meshot import Mesh, read_mesh, write_mesh
from meshot.mesh.geometry import face_areas, signed_volume
from meshot.mesh.shapes import cube, folded_sphere


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


@pytest.mark.parametrize("suffix", ["vtp", "vtk", "glb"])
def test_round_trips(tmp_path, suffix):
    mesh = folded_sphere(2, 40.0, 8.0)
    path = tmp_path / f"mesh.{suffix}"
    write_mesh(path, mesh)
    back = read_mesh(path)
    assert torch.equal(back.faces, mesh.faces)
    precision = 0 if suffix != "glb" else 48 * 6e-8  # GLB holds 32-bit numbers
    torch.testing.assert_close(back.vertices, mesh.vertices, rtol=0, atol=precision)
    unnamed = path.rename(tmp_path / "mesh.data")
    assert same(read_mesh(unnamed), back)


@pytest.mark.parametrize("suffix", ["vtp", "vtk"])
def test_pyvista_reads_and_writes_the_same_files(tmp_path, suffix):
    mesh = folded_sphere(1, 40.0, 8.0)
    write_mesh(tmp_path / f"ours.{suffix}", mesh)
    np.testing.assert_array_equal(pyvista.read(tmp_path / f"ours.{suffix}").points, mesh.vertices.numpy())
    mesh.to_pyvista().save(tmp_path / f"theirs.{suffix}", binary=False)
    # ASCII files of VTK keep ten or more digits.
    torch.testing.assert_close(read_mesh(tmp_path / f"theirs.{suffix}").vertices, mesh.vertices, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (np.zeros((3, 3)), "a numpy.ndarray was given; a trimesh.Trimesh or a trimesh.Scene is needed"),
        (trimesh.PointCloud(np.zeros((3, 3))), "a trimesh.PointCloud was given"),
        (trimesh.Trimesh(np.zeros((3, 3)), np.zeros((0, 3), int)), "has no triangles"),
        (trimesh.Scene(), "has no triangles"),
    ],
)
def test_what_is_no_mesh_of_trimesh_is_refused(unchecked, value, words):
    with pytest.raises(ValueError, match=words):
        Mesh.from_trimesh(value)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "a NoneType was given; a pyvista.PolyData is needed"),
        (pyvista.ImageData(dimensions=(3, 3, 3)), r"a pyvista.ImageData was given; .*have \.extract_surface"),
        (pyvista.PolyData(np.zeros((3, 3))), "has no triangles"),
    ],
)
def test_what_is_no_mesh_of_pyvista_is_refused(unchecked, value, words):
    with pytest.raises(ValueError, match=words):
        Mesh.from_pyvista(value)


def test_a_file_without_triangles_is_refused(tmp_path):
    pyvista.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "image.vtk")
    with pytest.raises(ValueError, match=r"image.vtk cannot be read as a vtk mesh: a pyvista.ImageData was given"):
        read_mesh(tmp_path / "image.vtk")
    (tmp_path / "no.glb").write_bytes(b"glTF, but not really")
    with pytest.raises(ValueError, match=r"no.glb cannot be read as a glb mesh"):
        read_mesh(tmp_path / "no.glb")
