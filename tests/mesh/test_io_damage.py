"""Mesh files that are cut short, damaged, or promise more than they hold: always a ValueError, and soon."""

import base64
import gzip
import re
import zlib

import nibabel
import numpy as np
import pytest
import torch

from meshot.mesh import io as io_checks
from meshot.mesh.io import read_mesh, write_mesh
from meshot.mesh.mesh import Mesh
from meshot.mesh.shapes import icosphere

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
    with pytest.raises(ValueError, match="its last line is '4 0 1 2', of which 5 numbers are needed"):
        read(tmp_path / "a.off", OFF[: -len(" 3\n")])


@pytest.mark.parametrize(("name", "text"), [("a.ply", PLY), ("a.off", OFF), ("a.stl", STL)])
def test_text_that_is_cut_short_is_refused_wherever_the_cut_is(tmp_path, name, text):
    """Up to the last two characters, the newline and a digit: without them a number may still be whole."""
    for end in range(1, len(text) - (len("sdsolid a\n") if name == "a.stl" else 4)):
        with pytest.raises(ValueError, match=r"cannot be read as a|is no mesh"):
            read(tmp_path / name, text[:end])


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.off", "OFF\n3 1000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.off", "OFF\n3 -1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"),
        ("a.off", "OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n2 0 1\n"),
        ("a.ply", PLY.replace("element face 2", "element face 1000000000")),
        ("a.ply", PLY.replace("element vertex 4", "element vertex 1000000000")),
    ],
)
def test_a_header_that_promises_more_faces_than_there_are(tmp_path, name, text):
    with pytest.raises(ValueError, match=r"it declares .* (and has|are in it)"):
        read(tmp_path / name, text)


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
    with pytest.raises(ValueError, match=r"vertices and .* faces, but has"):
        read_mesh(tmp_path / "lh.white")


def test_a_freesurfer_surface_of_quadrangles(tmp_path):
    """The oldest format: 24-bit counts, 16-bit hundredths of mm; two corners of a square are shared."""
    corners = np.array([[0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]], ">i2")
    quads = b"".join(k.to_bytes(3, "big") for k in (0, 1, 2, 3))
    whole = b"\xff\xff\xff" + (4).to_bytes(3, "big") + (1).to_bytes(3, "big") + corners.tobytes() + quads
    (tmp_path / "lh.white").write_bytes(whole)
    assert len(read_mesh(tmp_path / "lh.white", c_ras=(0.0, 0.0, 0.0)).faces) == 2
    (tmp_path / "lh.white").write_bytes(whole[:-1])
    with pytest.raises(ValueError, match="4 vertices and 1 faces, but has"):
        read_mesh(tmp_path / "lh.white", c_ras=(0.0, 0.0, 0.0))


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
    monkeypatch.setattr(io_checks, "LARGEST_BYTES", 1 << 20)
    bomb = base64.b64encode(zlib.compress(bytes(1 << 22), 9)).decode()
    text = re.sub(r"<Data>.*?</Data>", f"<Data>{bomb}</Data>", gifti(tmp_path), count=1)
    with pytest.raises(ValueError, match="more than 1 MiB unpacked"):
        read(tmp_path / "a.gii", text)


def test_a_bomb_around_a_gifti_is_not_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("meshot.mesh.io.LARGEST_BYTES", 1 << 20)
    (tmp_path / "a.gii.gz").write_bytes(gzip.compress(bytes(1 << 22)))
    with pytest.raises(ValueError, match="more than 1 MiB unpacked"):
        read_mesh(tmp_path / "a.gii.gz")


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
