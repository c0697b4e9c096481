"""Meshes through files: the same places, whatever the format; damaged files are refused, and soon."""

import base64
import gzip
import re
import sys
import zlib

import mesh_files
import nibabel
import nibabel.freesurfer
import numpy as np
import pytest
import pyvista
import torch
import trimesh

from meshot.mesh import brain_files
from meshot.mesh.connectivity import SPHERE, topology
from meshot.mesh.geometry import signed_volume
from meshot.mesh.io import (
    gifti_image,
    mesh_facts,
    read_mesh,
    read_vertex_data,
    write_mesh,
    write_vertex_labels,
    write_vertex_values,
)
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import cube, icosphere
from refusals import refuses

NAMES = (
    "a.ply", "a.obj", "a.off", "a.stl", "a.gii", "a.vtp", "a.vtk", "a.glb", "lh.white", "a.pial",
    "a.ply.gz", "a.gii.gz", "lh.white.gz",
)  # fmt: skip


@pytest.fixture
def mesh() -> Mesh:
    return icosphere(2, radius=30.0, centre=(12.5, -40.0, 71.0))


@pytest.mark.parametrize("name", NAMES)
def test_there_and_back_whether_name_or_content_tells_the_format(tmp_path, mesh, name):
    write_mesh(tmp_path / name, mesh, c_ras=(3.0, -7.0, 11.0))
    again = read_mesh(tmp_path / name)
    assert again.vertices.dtype == torch.float64
    assert topology(again) == SPHERE
    assert float(signed_volume(again)) == pytest.approx(float(signed_volume(mesh)), rel=1e-5)
    if name != "a.stl":
        assert torch.equal(again.faces, mesh.faces)
        # OBJ, OFF and VTK hold 64-bit numbers.
        precision = 1e-8 if name in ("a.obj", "a.off", "a.vtp", "a.vtk") else 1e-5
        torch.testing.assert_close(again.vertices, mesh.vertices, atol=precision, rtol=0)
    unnamed = read_mesh((tmp_path / name).rename(tmp_path / "surface"))
    assert torch.equal(unnamed.vertices[unnamed.faces], again.vertices[again.faces])


def test_gifti_says_scanner_and_the_part_of_the_brain(tmp_path, mesh):
    write_mesh(tmp_path / "a.gii", mesh)
    points, triangles = nibabel.load(tmp_path / "a.gii").darrays
    assert (points.coordsys.dataspace, points.coordsys.xformspace) == (1, 1)
    assert np.array_equal(points.coordsys.xform, np.eye(4))
    assert (points.data.dtype, triangles.data.dtype) == (np.float32, np.int32)
    write_mesh(tmp_path / "a.surf.gii", mesh, structure=("CortexLeft", "GrayWhite"))
    points, triangles = nibabel.load(tmp_path / "a.surf.gii").darrays
    assert dict(points.meta) == {
        "AnatomicalStructurePrimary": "CortexLeft",
        "AnatomicalStructureSecondary": "GrayWhite",
        "GeometricType": "Anatomical",
    }
    assert dict(triangles.meta) == {"TopologicalType": "Closed"}


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


@pytest.mark.parametrize("name", [*NAMES, "unknown"])
@pytest.mark.parametrize("content", [b"", b"\x00\x01garbage\n" * 30, b"v 1 2\n"])
def test_garbage_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    refuses(r"cannot be read as a|is no mesh", read_mesh, tmp_path / name)


def test_what_cannot_be_written_is_said(tmp_path, mesh, unchecked):
    refuses("names no format", write_mesh, tmp_path / "a.docx", mesh)
    refuses("c_ras", write_mesh, tmp_path / "lh.white", mesh, c_ras=(0.0, float("nan"), 0.0))
    refuses("does not exist", read_mesh, tmp_path / "missing.ply")
    for wrong in (("Left", "GrayWhite"), ("CortexLeft", "white"), ("CortexLeft",)):
        refuses("structure is", write_mesh, tmp_path / "b.surf.gii", mesh, structure=wrong)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.ply", mesh_files.ply()), ("a.off", mesh_files.off().encode()), ("a.stl", mesh_files.stl_text().encode())],
)
def test_text_that_is_cut_short_is_refused_wherever_the_cut_is(tmp_path, name, content):
    """Up to the last two characters, the newline and a digit: without them a number may still be whole."""
    path, last = tmp_path / name, content.rstrip(b"\n")
    path.write_bytes(last)
    assert len(read_mesh(path).faces) == 8
    for end in range(1, len(last) - (len("dsolid a") if name == "a.stl" else 1)):
        path.write_bytes(content[:end])
        refuses(r"cannot be read as a|is no mesh", read_mesh, path)


def test_bombs_are_not_unpacked(tmp_path, monkeypatch):
    """In an array of a GIfTI file, and around it."""
    monkeypatch.setattr(brain_files, "LARGEST_BYTES", 1 << 20)
    bomb = b"<Data>%s</Data>" % base64.b64encode(zlib.compress(bytes(1 << 22), 9))
    (tmp_path / "a.gii").write_bytes(re.sub(b"<Data>.*?</Data>", bomb, mesh_files.gifti_of(), count=1))
    refuses("more than 1 MiB unpacked", read_mesh, tmp_path / "a.gii")
    monkeypatch.setattr("meshot.mesh.io.LARGEST_BYTES", 1 << 20)
    (tmp_path / "a.gii.gz").write_bytes(gzip.compress(bytes(1 << 22)))
    refuses("more than 1 MiB unpacked", read_mesh, tmp_path / "a.gii.gz")


def test_every_flipped_bit_of_a_compressed_surface_is_seen(tmp_path):
    mesh = icosphere(1)
    write_mesh(tmp_path / "a.gii.gz", mesh)
    whole, random = (tmp_path / "a.gii.gz").read_bytes(), np.random.default_rng(0)
    for place in random.integers(10, len(whole), 60):
        flipped = bytearray(whole)
        flipped[place] ^= 1 << random.integers(8)
        (tmp_path / "a.gii.gz").write_bytes(flipped)
        try:
            found = read_mesh(tmp_path / "a.gii.gz")
        except ValueError:
            continue
        assert isinstance(found, Mesh)
        torch.testing.assert_close(found.vertices, mesh.vertices, atol=1e-6, rtol=0)


# Data of vertices.


def some_data(n: int) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(0)
    return {
        "thickness": draw.normal(size=n),
        "label": np.arange(n, dtype=np.int32) - 3,
        "red": np.arange(n, dtype=np.uint8),
        "uv": draw.random((n, 2), np.float32),
        "mask": np.arange(n) > 3,
        "many": np.arange(n),
    }


@pytest.mark.parametrize("name", ["a.ply", "a.ply.gz", "a.vtp", "a.vtk", "a.surf.gii"])
def test_data_of_vertices_come_back(tmp_path, name):
    mesh, path = icosphere(1, 10.0), tmp_path / name
    given = some_data(len(mesh.vertices))
    write_mesh(path, mesh, vertex_data=given | {"label": torch.from_numpy(given["label"])})
    found = {key: values.numpy() for key, values in read_vertex_data(path).items()}
    if "ply" in name:
        found["uv"] = np.stack([found.pop("uv_0"), found.pop("uv_1")], axis=1)
    assert found.keys() == given.keys()
    for key, values in given.items():
        rounded = name.endswith("gii") and key == "thickness"
        np.testing.assert_array_equal(found[key], values.astype(np.float32) if rounded else values)
        if key in ("label", "red", "uv"):
            assert found[key].dtype == values.dtype
    assert read_mesh(path).faces.equal(mesh.faces)
    assert dict(mesh_facts(path).numbers)["data of vertices"].count("(") == len(given) + ("ply" in name)
    assert mesh_facts(path).not_read == ()


def test_other_readers_find_the_data(tmp_path):
    """trimesh, VTK and nibabel."""
    mesh, given = icosphere(1, 10.0), some_data(42)
    for name in ("a.ply", "a.vtp", "a.gii"):
        write_mesh(tmp_path / name, mesh, vertex_data=given)
    raw = trimesh.load_mesh(tmp_path / "a.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    grid = pyvista.read(tmp_path / "a.vtp").point_data
    arrays = {a.meta.get("Name"): a.data for a in nibabel.load(tmp_path / "a.gii").darrays}
    for key in ("thickness", "label", "red", "many"):
        np.testing.assert_array_equal(np.asarray(raw[key]).reshape(-1), given[key])
        np.testing.assert_array_equal(grid[key], given[key])
        np.testing.assert_array_equal(arrays[key], given[key].astype(np.float32 if key == "thickness" else int))
    np.testing.assert_array_equal(arrays["uv"], given["uv"])


def test_data_that_others_wrote_are_read(tmp_path):
    """Normals are left out. A text may exceed the type that it declares. Strange arrays do no harm."""
    mesh = icosphere(0)
    ball = mesh.to_trimesh()
    ball.visual.vertex_colors = np.arange(48).reshape(12, 4)
    ball.export(tmp_path / "a.ply", vertex_normal=True)
    found = read_vertex_data(tmp_path / "a.ply")
    assert {key: values.tolist() for key, values in found.items()} == {
        key: list(range(k, 48, 4)) for k, key in enumerate(("red", "green", "blue", "alpha"))
    }
    assert mesh_facts(tmp_path / "a.ply").not_read == ("properties of each vertex: nx, ny, nz",)
    text = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    text += "property uchar a\nproperty float b\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "b.ply").write_text(text + "0 0 0 300 nan\n1 0 0 2 .5\n0 1 0 3 1\n3 0 1 2\n")
    found = read_vertex_data(tmp_path / "b.ply")
    assert found["a"].tolist() == [300, 2, 3]
    assert found["b"].dtype == torch.float32
    np.testing.assert_array_equal(found["b"], [np.nan, 0.5, 1])
    image = gifti_image(mesh.vertices.numpy(), mesh.faces.numpy())
    for values, meta in ((np.ones(12), {}), (np.zeros(12), {}), (np.ones(3), {"Name": "three"})):
        array = nibabel.gifti.GiftiDataArray(values.astype(np.float32), intent="NIFTI_INTENT_SHAPE", meta=meta)
        image.add_gifti_data_array(array)
    nibabel.save(image, tmp_path / "c.gii")
    found = read_vertex_data(tmp_path / "c.gii")
    assert {key: values.sum().item() for key, values in found.items()} == {"shape": 12, "shape_2": 0}
    assert mesh_facts(tmp_path / "c.gii").not_read == ("an array of shape",)
    write_mesh(tmp_path / "d.obj", mesh)
    assert read_vertex_data(tmp_path / "d.obj") == {}


def test_data_that_cannot_be_written(tmp_path, unchecked):
    mesh = icosphere(0)
    for name, given, words in (
        ("a.obj", {"a": np.ones(12)}, "a.obj cannot hold a of its vertices; use .ply"),
        ("a.ply", {"a": np.ones(11)}, r"a has the shape \(11,\) .* in 12 rows"),
        ("a.ply", {"a": np.array(["x"] * 12)}, "numbers are needed"),
        ("a.ply", {"x": np.ones(12)}, "the name 'x', which is empty or taken"),
        ("a.ply", {"a b": np.ones(12), "a_b": np.ones(12)}, "the name 'a_b', which is empty or taken"),
        ("a.gii", {"a": np.full(12, 2**40)}, "a holds numbers up to 1099511627776, beyond the integers of a.gii"),
    ):
        refuses(words, write_mesh, tmp_path / name, mesh, vertex_data=given)
    assert list(tmp_path.iterdir()) == []


def test_vtk_files_need_an_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    for task in (lambda: write_mesh(tmp_path / "a.vtp", cube()), lambda: Mesh.from_pyvista(None)):
        with pytest.raises(ImportError, match=r"pyvista is not installed.*pip install 'meshot\[cortex\]'"):
            task()


@pytest.mark.parametrize("name", ["lh.thickness", "sub-01_hemi-L_thickness.shape.gii"])
def test_values_of_vertices_come_back_from_nibabel(tmp_path, name):
    values = np.random.default_rng(0).normal(size=1000)
    write_vertex_values(tmp_path / name, values)
    if name.endswith("gii"):
        (array,) = nibabel.load(tmp_path / name).darrays
        assert array.intent == nibabel.nifti1.intent_codes["NIFTI_INTENT_SHAPE"]
        found = array.data
    else:
        found = nibabel.freesurfer.read_morph_data(tmp_path / name)
    np.testing.assert_allclose(found, values, rtol=1e-6)


REGIONS = (["unknown", "front", "back"], [(25, 5, 25), (60, 20, 220), (220, 20, 20)])


@pytest.mark.parametrize("name", ["lh.aparc.annot", "sub-01_hemi-L_dseg.label.gii"])
def test_labels_of_vertices_come_back_from_nibabel(tmp_path, name):
    labels = np.random.default_rng(0).integers(0, 3, 1000)
    write_vertex_labels(tmp_path / name, labels, *REGIONS)
    if name.endswith("gii"):
        image = nibabel.load(tmp_path / name)
        found, table = image.darrays[0].data, image.labeltable.labels
        names = [each.label for each in table]
        colours = [tuple(round(255 * part) for part in each.rgba[:3]) for each in table]
    else:
        found, table, names = nibabel.freesurfer.read_annot(tmp_path / name)
        names, colours = [each.decode() for each in names], [tuple(row[:3]) for row in table.tolist()]
    np.testing.assert_array_equal(found, labels)
    assert (names, colours) == REGIONS


def test_values_and_labels_that_cannot_be_written(tmp_path, unchecked):
    names, colours = REGIONS
    write_labels, write_values = write_vertex_labels, write_vertex_values
    path = tmp_path / "lh.aparc.annot"
    refuses("labels run from 0 to 3, and there are 3 names", write_labels, path, np.array([0, 3]), names, colours)
    refuses("labels run from -1", write_labels, path, np.array([-1, 2]), names, colours)
    refuses("integers are needed", write_labels, path, np.array([0.0, 1.0]), names, colours)
    refuses("3 names and 2 different colours", write_labels, path, np.array([0]), names, [colours[0], *colours[:2]])
    refuses("or are not finite", write_values, tmp_path / "lh.thickness", np.array([1.0, np.nan]))
    refuses(r"values have the shape \(1, 2\)", write_values, tmp_path / "lh.thickness", np.ones((1, 2)))
    assert list(tmp_path.iterdir()) == []
