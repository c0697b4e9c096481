"""``meshot inspect`` prints what files say about themselves, and converts them."""

import nibabel
import numpy as np
import pytest
import volume_files
from mesh_files import MESHES

from meshot import read_mesh, write_mesh
from meshot.cli import main
from meshot.mesh import read_vertex_data
from meshot.mesh.shapes import cube, icosphere
from meshot.volume import Volume, read_volume, write_volume

CASES = {case.name: case.content for case in MESHES} | {scan.name: scan.content for scan in volume_files.SCANS}


def said(capsys, *words) -> str:
    assert main(["inspect", *map(str, words)]) == 0
    return capsys.readouterr().out


def placed(folder, name):
    (folder / name).write_bytes(CASES[name])
    return folder / name


def test_each_file_has_its_lines(tmp_path, capsys):
    write_mesh(tmp_path / "lh.white", icosphere(3, 50.0), c_ras=(4.0, 5.0, 6.0))
    write_volume(tmp_path / "a.nii.gz", Volume(np.zeros((4, 5, 6)) + 2, np.diag([-2.0, 2, 2, 1])))
    text = said(capsys, tmp_path / "lh.white", placed(tmp_path, "seams.obj"), tmp_path / "a.nii.gz")
    for words in (
        f"{tmp_path / 'lh.white'}\n  format     FreeSurfer, triangles\n  space      scanner RAS, in mm\n",
        "its volume information: surface RAS was moved by cras = (4, 5, 6)",
        "  topology   1 components, χ = 2; closed\n",
        "519.1 cm³, normals outwards",
        "1280, 0 of them cross others",
        "7, 1 of them in no face",
        "not said by the file; taken as scanner RAS",
        "  not read   texture coordinates\n",
        "NIfTI-1, little endian, compressed",
        "to left, anterior, superior",
        "4 × 5 × 6 of float32",
    ):
        assert words in text


def test_an_oblique_axis_says_how_much(tmp_path, capsys):
    turn = np.radians(20)
    affine = np.eye(4)
    affine[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    write_volume(tmp_path / "a.nii", Volume(np.ones((4, 5, 6)), affine))
    assert "to right (20° off), anterior (20° off), superior\n" in said(capsys, tmp_path / "a.nii")


def test_contradictions_are_shown_or_refused(tmp_path, capsys):
    for name in ("flipped_sform.nii", "matrix_against_volgeom.surf.gii"):
        path = placed(tmp_path, name)
        assert "  look at this  " in said(capsys, path)
        assert main(["inspect", str(path), "--strict"]) == 3
        assert "is read strictly" in capsys.readouterr().err


def test_an_open_mesh_and_one_turned_inside_out(tmp_path, capsys):
    mesh = cube()
    write_mesh(tmp_path / "open.ply", type(mesh)(mesh.vertices, mesh.faces[1:]))
    assert "3 edges of one face, 0 of more than two" in said(capsys, tmp_path / "open.ply")
    write_mesh(tmp_path / "inside.ply", type(mesh)(mesh.vertices, mesh.faces.flip(1)))
    assert "normals inwards" in said(capsys, tmp_path / "inside.ply")


@pytest.mark.parametrize(("name", "order"), [("b.ply", "in their order"), ("b.stl", "numbered anew, 6 of them")])
def test_a_mesh_is_converted_and_what_is_lost_is_said(tmp_path, capsys, name, order):
    path = placed(tmp_path, "slicer_lps.obj")
    assert order in said(capsys, path, "--to", tmp_path / name)
    again = read_mesh(tmp_path / name)
    assert np.allclose(again.vertices[again.faces], read_mesh(path).vertices[read_mesh(path).faces])


def test_data_of_vertices_are_converted_or_named(tmp_path, capsys):
    mesh = icosphere(1)
    write_mesh(tmp_path / "a.ply", mesh, vertex_data={"thickness": mesh.vertices[:, 0]})
    assert "  data of vertices  thickness (float64)\n" in said(capsys, tmp_path / "a.ply", "--to", tmp_path / "b.vtp")
    assert read_vertex_data(tmp_path / "b.vtp")["thickness"].equal(mesh.vertices[:, 0])
    text = said(capsys, tmp_path / "b.vtp", "--to", tmp_path / "c.off")
    assert "data of vertices: thickness" in text.split("  lost ")[1]


def test_c_ras_is_that_of_the_file_that_lacks_it_and_of_the_one_that_is_written(tmp_path, capsys):
    path = placed(tmp_path, "lh.no_information")
    said(capsys, path, "--c-ras", 4.5, -17.25, 31, "--to", tmp_path / "rh.white")
    assert nibabel.freesurfer.read_geometry(tmp_path / "rh.white", read_metadata=True)[2]["cras"][2] == 31
    assert read_mesh(tmp_path / "rh.white").vertices[0].tolist() == [12.5, 0, 1]


def test_a_scan_is_converted(tmp_path, capsys):
    said(capsys, placed(tmp_path, "qform_only.nii"), "--to", tmp_path / "b.mgz")
    np.testing.assert_allclose(read_volume(tmp_path / "b.mgz").affine, volume_files.AFFINE, atol=1e-5)


def test_one_file_is_converted_at_a_time(tmp_path, capsys):
    path = placed(tmp_path, "plain_text.ply")
    assert main(["inspect", str(path), str(path), "--to", str(tmp_path / "b.ply")]) == 2
    assert "takes one file, and 2 are given" in capsys.readouterr().err
    assert main(["inspect", str(tmp_path / "nix.ply")]) == 2
    assert capsys.readouterr().err == f"meshot: {tmp_path / 'nix.ply'} does not exist or is no file\n"
