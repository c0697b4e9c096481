"""Meshes through files: the same places, whatever the format; broken files are said to be broken."""

import gzip
import warnings

import nibabel
import nibabel.freesurfer
import numpy as np
import pytest
import torch

from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import signed_volume
from meshot.mesh.io import read_mesh, write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere

NAMES = ("a.ply", "a.obj", "a.off", "a.stl", "a.gii", "a.gii.gz", "lh.white", "a.pial")


@pytest.fixture
def mesh() -> Mesh:
    return icosphere(2, radius=30.0, centre=(12.5, -40.0, 71.0))


@pytest.mark.parametrize("name", NAMES)
def test_there_and_back(tmp_path, mesh, name):
    write_mesh(tmp_path / name, mesh, c_ras=(3.0, -7.0, 11.0))
    again = read_mesh(tmp_path / name)
    assert again.vertices.dtype == torch.float64
    assert topology(again) == SPHERE
    assert float(signed_volume(again)) == pytest.approx(float(signed_volume(mesh)), rel=1e-5)
    if name != "a.stl":
        assert torch.equal(again.faces, mesh.faces)
        torch.testing.assert_close(again.vertices, mesh.vertices, atol=1e-5, rtol=0)


@pytest.mark.parametrize("name", ["a.ply", "a.obj", "a.off", "a.stl", "a.gii", "lh.white"])
def test_the_content_tells_the_format_where_the_name_does_not(tmp_path, mesh, name):
    write_mesh(tmp_path / name, mesh)
    (tmp_path / name).rename(tmp_path / "surface")
    torch.testing.assert_close(
        read_mesh(tmp_path / "surface").vertices.mean(dim=0), mesh.vertices.mean(dim=0), atol=1e-4, rtol=0
    )


def test_gifti_says_scanner(tmp_path, mesh):
    write_mesh(tmp_path / "a.gii", mesh)
    points, triangles = nibabel.load(tmp_path / "a.gii").darrays
    assert (points.coordsys.dataspace, points.coordsys.xformspace) == (1, 1)
    assert np.array_equal(points.coordsys.xform, np.eye(4))
    assert (points.data.dtype, triangles.data.dtype) == (np.float32, np.int32)


@pytest.mark.parametrize(("spaces", "applied"), [((0, 1), True), ((0, 4), False), ((0, 0), False), ((1, 1), False)])
def test_a_gifti_in_unknown_space_is_taken_through_its_matrix_to_the_scanner(tmp_path, mesh, spaces, applied):
    """Spaces are coded as in NIfTI: 0 unknown, 1 scanner, 4 MNI152. A matrix to MNI152 would leave scanner space."""
    xform = np.array([[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1.0]])
    system = nibabel.gifti.GiftiCoordSystem(*spaces, xform)
    arrays = [
        nibabel.gifti.GiftiDataArray(
            mesh.vertices.numpy().astype(np.float32), intent="NIFTI_INTENT_POINTSET", coordsys=system
        ),
        nibabel.gifti.GiftiDataArray(mesh.faces.numpy().astype(np.int32), intent="NIFTI_INTENT_TRIANGLE"),
    ]
    nibabel.save(nibabel.GiftiImage(darrays=arrays), tmp_path / "a.gii")
    x, y, z = mesh.vertices.unbind(dim=1)
    expected = torch.stack([5 - y, x + 6, z + 7], dim=1) if applied else mesh.vertices
    torch.testing.assert_close(read_mesh(tmp_path / "a.gii").vertices, expected, atol=1e-4, rtol=0)


def test_freesurfer_stores_surface_ras(tmp_path, mesh):
    write_mesh(tmp_path / "lh.white", mesh, c_ras=(3.0, -7.0, 11.0))
    stored, _, info = nibabel.freesurfer.read_geometry(tmp_path / "lh.white", read_metadata=True)
    np.testing.assert_allclose(stored, mesh.vertices.numpy() - [3, -7, 11], atol=1e-5)
    np.testing.assert_array_equal(info["cras"], [3, -7, 11])
    assert list(info["volume"]) == [256, 256, 256]


def test_freesurfer_volume_information_agrees_with_nibabels_mgh_header(tmp_path, mesh):
    """The same point through our reader, and through nibabel's vox2ras of a conformed volume."""
    info = {
        "head": np.array([2, 0, 20]), "valid": "1  # volume info valid", "filename": "x",
        "volume": np.array([20, 30, 40]), "voxelsize": np.array([1.0, 1.5, 2.0]),
        "xras": np.array([0.6, 0.8, 0]), "yras": np.array([0, 0, -1.0]), "zras": np.array([-0.8, 0.6, 0]),
        "cras": np.array([4.0, -5.0, 6.0]),
    }  # fmt: skip
    vertices, faces = mesh.vertices.numpy(), mesh.faces.numpy()
    nibabel.freesurfer.write_geometry(tmp_path / "lh.x", vertices, faces, create_stamp="x", volume_info=info)
    header = nibabel.freesurfer.mghformat.MGHHeader()
    header.set_data_shape(info["volume"])
    header["delta"], header["Pxyz_c"] = info["voxelsize"], info["cras"]
    header["Mdc"] = np.array([info["xras"], info["yras"], info["zras"]])
    to_scanner = header.get_affine() @ np.linalg.inv(header.get_vox2ras_tkr())
    again = read_mesh(tmp_path / "lh.x")
    np.testing.assert_allclose(again.vertices.numpy(), vertices @ to_scanner[:3, :3].T + to_scanner[:3, 3], atol=1e-4)
    assert float(signed_volume(again)) > 0


def test_freesurfer_without_volume_information_asks_for_c_ras(tmp_path, mesh):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        nibabel.freesurfer.write_geometry(tmp_path / "lh.x", mesh.vertices.numpy(), mesh.faces.numpy(), "x")
    with pytest.raises(ValueError, match="pass c_ras"):
        read_mesh(tmp_path / "lh.x")
    moved = read_mesh(tmp_path / "lh.x", c_ras=(1.0, 2.0, 3.0)).vertices - mesh.vertices
    torch.testing.assert_close(moved, moved.new_tensor([1.0, 2.0, 3.0]).expand_as(moved), atol=1e-4, rtol=0)


def test_a_mirrored_freesurfer_volume_keeps_normals_outward(tmp_path, mesh):
    info = {
        "head": np.array([2, 0, 20]), "valid": "1  # volume info valid", "filename": "x",
        "volume": np.array([20, 30, 40]), "voxelsize": np.ones(3), "xras": np.array([1.0, 0, 0]),
        "yras": np.array([0, 1.0, 0]), "zras": np.array([0, 0, 1.0]), "cras": np.zeros(3),
    }  # fmt: skip
    nibabel.freesurfer.write_geometry(
        tmp_path / "lh.x", mesh.vertices.numpy(), mesh.faces.numpy(), create_stamp="x", volume_info=info
    )
    assert float(signed_volume(read_mesh(tmp_path / "lh.x"))) > 0


@pytest.mark.parametrize("name", ["a.ply", "a.off", "a.stl", "a.gii", "lh.white"])
@pytest.mark.parametrize("part", [0.1, 0.6])
def test_truncated_files_are_refused(tmp_path, mesh, name, part):
    write_mesh(tmp_path / name, mesh)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: int(part * len(whole))])
    with pytest.raises(ValueError, match=r"cannot be read as a|is no mesh"):
        read_mesh(tmp_path / name)


def test_a_truncated_gzip_is_refused(tmp_path, mesh):
    write_mesh(tmp_path / "a.gii.gz", mesh)
    whole = (tmp_path / "a.gii.gz").read_bytes()
    assert gzip.decompress(whole).startswith(b"<?xml")
    (tmp_path / "a.gii.gz").write_bytes(whole[:-200])
    with pytest.raises(ValueError, match="cannot be read"):
        read_mesh(tmp_path / "a.gii.gz")


@pytest.mark.parametrize("name", [*NAMES, "unknown"])
@pytest.mark.parametrize("content", [b"", b"\x00\x01garbage\n" * 30, b"v 1 2\n"])
def test_garbage_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"cannot be read as a|is no mesh"):
        read_mesh(tmp_path / name)


def test_what_cannot_be_written_is_said(tmp_path, mesh, unchecked):
    with pytest.raises(ValueError, match="names no format"):
        write_mesh(tmp_path / "a.docx", mesh)
    with pytest.raises(ValueError, match="c_ras"):
        write_mesh(tmp_path / "lh.white", mesh, c_ras=(0.0, float("nan"), 0.0))
    with pytest.raises(ValueError, match="does not exist"):
        read_mesh(tmp_path / "missing.ply")
    assert not list(tmp_path.iterdir())


def test_a_gifti_without_a_surface_is_refused(tmp_path):
    array = nibabel.gifti.GiftiDataArray(np.zeros((4, 1), np.float32), intent="NIFTI_INTENT_SHAPE")
    nibabel.save(nibabel.GiftiImage(darrays=[array]), tmp_path / "a.gii")
    with pytest.raises(ValueError, match="0 point sets"):
        read_mesh(tmp_path / "a.gii")


def test_gifti_names_the_part_of_the_brain(tmp_path, mesh, unchecked):
    write_mesh(tmp_path / "a.surf.gii", mesh, structure=("CortexLeft", "GrayWhite"))
    points, triangles = nibabel.load(tmp_path / "a.surf.gii").darrays
    assert dict(points.meta) == {
        "AnatomicalStructurePrimary": "CortexLeft",
        "AnatomicalStructureSecondary": "GrayWhite",
        "GeometricType": "Anatomical",
    }
    assert dict(triangles.meta) == {"TopologicalType": "Closed"}
    assert points.coordsys.dataspace == points.coordsys.xformspace == 1
    for wrong in (("Left", "GrayWhite"), ("CortexLeft", "white"), ("CortexLeft",)):
        with pytest.raises(ValueError, match="structure is"):
            write_mesh(tmp_path / "b.surf.gii", mesh, structure=wrong)
    assert not (tmp_path / "b.surf.gii").exists()
