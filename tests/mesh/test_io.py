"""Meshes through files: the same places, whatever the format; damaged files are refused, and soon."""

import base64
import gzip
import re
import sys
import warnings
import zlib

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

NAMES = ("a.ply", "a.obj", "a.off", "a.stl", "a.gii", "a.gii.gz", "lh.white", "a.pial", "a.ply.gz", "lh.white.gz")


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
    refuses("pass c_ras", read_mesh, tmp_path / "lh.x")
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
    refuses(r"cannot be read as a|is no mesh", read_mesh, tmp_path / name)


def test_a_truncated_gzip_is_refused(tmp_path, mesh):
    write_mesh(tmp_path / "a.gii.gz", mesh)
    whole = (tmp_path / "a.gii.gz").read_bytes()
    assert gzip.decompress(whole).startswith(b"<?xml")
    (tmp_path / "a.gii.gz").write_bytes(whole[:-200])
    refuses("cut short or damaged", read_mesh, tmp_path / "a.gii.gz")


@pytest.mark.parametrize("name", [*NAMES, "unknown"])
@pytest.mark.parametrize("content", [b"", b"\x00\x01garbage\n" * 30, b"v 1 2\n"])
def test_garbage_is_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    refuses(r"cannot be read as a|is no mesh", read_mesh, tmp_path / name)


def test_what_cannot_be_written_is_said(tmp_path, mesh, unchecked):
    refuses("names no format", write_mesh, tmp_path / "a.docx", mesh)
    refuses("c_ras", write_mesh, tmp_path / "lh.white", mesh, c_ras=(0.0, float("nan"), 0.0))
    refuses("does not exist", read_mesh, tmp_path / "missing.ply")
    assert not list(tmp_path.iterdir())


def test_a_gifti_without_a_surface_is_refused(tmp_path):
    array = nibabel.gifti.GiftiDataArray(np.zeros((4, 1), np.float32), intent="NIFTI_INTENT_SHAPE")
    nibabel.save(nibabel.GiftiImage(darrays=[array]), tmp_path / "a.gii")
    refuses("0 point sets", read_mesh, tmp_path / "a.gii")


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
        refuses("structure is", write_mesh, tmp_path / "b.surf.gii", mesh, structure=wrong)
    assert not (tmp_path / "b.surf.gii").exists()


PLY = """ply
format ascii 1.0
comment by hand
element vertex 4
property float x
property float y
property float z
property uchar red
element face 2
property list uchar int vertex_indices
property float quality
end_header
0 0 0 9
1 0 0 9
0 1 0 9
0 0 1 9
3 0 1 2 0.5
3 0 2 3 0.5
"""
OFF = "OFF\n# by hand\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n\n3 0 1 2\n4 0 1 2 3\n"
STL = "solid a\n" + 3 * (
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
) + "endsolid a\n"  # fmt: skip


def read(path, text):
    path.write_text(text)
    return read_mesh(path)


# An element may have no lines.
PLY_WITHOUT_EDGES = PLY.replace("end_header", "element edge 0\nproperty int vertex1\nend_header")


@pytest.mark.parametrize(
    ("name", "text", "n_faces"),
    [("a.ply", PLY, 2), ("a.ply", PLY_WITHOUT_EDGES, 2), ("a.off", OFF, 3), ("a.stl", STL, 3)],
)
def test_whole_text_is_read(tmp_path, name, text, n_faces):
    assert len(read(tmp_path / name, text).faces) == n_faces
    assert len(read(tmp_path / name, text.replace("\n", "\r\n")).faces) == n_faces
    assert len(read(tmp_path / name, text.rstrip("\n")).faces) == n_faces


def test_the_line_that_is_cut_short_is_shown(tmp_path):
    refuses("a face is '4 0 1 2', of which 5 numbers are needed", read, tmp_path / "a.off", OFF[: -len(" 3\n")])


@pytest.mark.parametrize(("name", "text"), [("a.ply", PLY), ("a.off", OFF), ("a.stl", STL)])
def test_text_that_is_cut_short_is_refused_wherever_the_cut_is(tmp_path, name, text):
    """Up to the last two characters, the newline and a digit: without them a number may still be whole."""
    for end in range(1, len(text) - (len("sdsolid a\n") if name == "a.stl" else 4)):
        refuses(r"cannot be read as a|is no mesh", read, tmp_path / name, text[:end])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.off", "OFF\n3 1000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.ply", PLY.replace("element face 2", "element face 1000000000")),
        ("a.ply", PLY.replace("element vertex 4", "element vertex 1000000000")),
    ],
)
def test_a_header_that_promises_more_faces_than_there_are(tmp_path, name, text):
    refuses("it declares .* and has", read, tmp_path / name, text)


def test_a_binary_ply_may_hold_any_bytes(tmp_path):
    write_mesh(tmp_path / "a.ply", icosphere(2))
    assert b"binary" in (tmp_path / "a.ply").read_bytes()[:100]
    assert len(read_mesh(tmp_path / "a.ply").faces) == 320


@pytest.mark.parametrize("counts", [(2**31 - 1, 2**31 - 1), (162, 2**30), (-5, 10), (0, 0)])
def test_freesurfer_counts_must_fit_the_file(tmp_path, counts):
    write_mesh(tmp_path / "lh.white", icosphere(2))
    content = bytearray((tmp_path / "lh.white").read_bytes())
    start = content.index(b"\n\n") + 2
    assert [int.from_bytes(content[start + k : start + k + 4], "big") for k in (0, 4)] == [162, 320]
    content[start : start + 8] = np.array(counts, ">i4").tobytes()
    (tmp_path / "lh.white").write_bytes(content)
    refuses(r"vertices and .* faces, but has", read_mesh, tmp_path / "lh.white")


def test_a_freesurfer_surface_of_quadrangles(tmp_path):
    """The oldest format: 24-bit counts, 16-bit hundredths of mm; two corners of a square are shared."""
    corners = np.array([[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]], ">i2")
    quads = b"".join(k.to_bytes(3, "big") for k in (0, 1, 2, 3))
    whole = b"\xff\xff\xff" + (4).to_bytes(3, "big") + (1).to_bytes(3, "big") + corners.tobytes() + quads
    (tmp_path / "lh.white").write_bytes(whole)
    assert len(read_mesh(tmp_path / "lh.white", c_ras=(0.0, 0.0, 0.0)).faces) == 2
    (tmp_path / "lh.white").write_bytes(whole[:-1])
    refuses("4 vertices and 1 faces, but has", read_mesh, tmp_path / "lh.white", c_ras=(0.0, 0.0, 0.0))


def gifti(tmp_path) -> str:
    write_mesh(tmp_path / "a.gii", icosphere(1))
    return (tmp_path / "a.gii").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('Dimensionality="2"', 'Dimensionality="1000000000"', "Dimensionality is 1000000000"),
        ('Dimensionality="2"', 'Dimensionality="-1"', "Dimensionality is -1"),
        ('Dim0="42"', 'Dim0="1000000000"', "declares 3000000000 values"),
        ('Dim0="42"', 'Dim0="-42"', "sizes must be >= 0"),
        ("</GIFTI>", "", "no whole XML"),
    ],
)
def test_gifti_sizes_must_fit(tmp_path, old, new, message):
    text = gifti(tmp_path)
    assert old in text
    with pytest.raises(ValueError, match=message):
        read(tmp_path / "a.gii", text.replace(old, new))


def test_a_bomb_in_a_gifti_array_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(brain_files, "LARGEST_BYTES", 1 << 20)
    bomb = base64.b64encode(zlib.compress(bytes(1 << 22), 9)).decode()
    text = re.sub(r"<Data>.*?</Data>", f"<Data>{bomb}</Data>", gifti(tmp_path), count=1)
    refuses("more than 1 MiB unpacked", read, tmp_path / "a.gii", text)


def test_a_bomb_around_a_gifti_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("meshot.mesh.io.LARGEST_BYTES", 1 << 20)
    (tmp_path / "a.gii.gz").write_bytes(gzip.compress(bytes(1 << 22)))
    refuses("more than 1 MiB unpacked", read_mesh, tmp_path / "a.gii.gz")


def test_a_gifti_in_plain_numbers(tmp_path):
    mesh = icosphere(1)
    image = nibabel.GiftiImage(
        darrays=[
            nibabel.gifti.GiftiDataArray(array, intent=f"NIFTI_INTENT_{intent}", encoding="ASCII", datatype=kind)
            for array, intent, kind in (
                (mesh.vertices.float().numpy(), "POINTSET", "NIFTI_TYPE_FLOAT32"),
                (mesh.faces.int().numpy(), "TRIANGLE", "NIFTI_TYPE_INT32"),
            )
        ]
    )
    nibabel.save(image, tmp_path / "a.gii")
    assert torch.equal(read_mesh(tmp_path / "a.gii").faces, mesh.faces)


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
