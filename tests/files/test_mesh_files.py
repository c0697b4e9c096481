"""Every mesh file of the conformance set is read as it stands, or refused for its reason, and nothing else is said."""

import re
import warnings

import mesh_files
import nibabel
import nibabel.freesurfer
import numpy as np
import pytest
import pyvista
import trimesh
from mesh_files import MESHES, Case

from meshot.file_facts import FileWarning
from meshot.mesh import face_areas, mesh_facts, read_mesh, signed_volume


def placed(case: Case, folder):
    for name, content in ((case.name, case.content), *case.beside):
        (folder / name).write_bytes(content)
    return folder / case.name


@pytest.mark.parametrize("case", MESHES, ids=lambda case: case.name)
def test_a_mesh_file(case, tmp_path, capfd):
    path = placed(case, tmp_path)
    if case.refused:
        with pytest.raises(ValueError, match=re.escape(case.refused)) as refusal:
            read_mesh(path, case.c_ras)
        assert str(refusal.value).startswith(str(path))
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mesh = read_mesh(path, case.c_ras)
    np.testing.assert_array_equal(mesh.vertices.numpy(), case.vertices)
    if case.faces is None:
        assert float(face_areas(mesh).sum()) == pytest.approx(14)
        assert float(signed_volume(mesh)) == pytest.approx(3)
    else:
        np.testing.assert_array_equal(mesh.faces.numpy(), case.faces)
    assert [warning.category for warning in caught] == [FileWarning] * bool(case.fault)
    facts = mesh_facts(path, case.c_ras)
    assert (case.fault in facts.faults[0]) if case.fault else not facts.faults
    numbers = [f"{name}: {value}" for name, value in facts.numbers]
    assert case.about in "; ".join([facts.format, facts.space, facts.said_by, ", ".join(facts.not_read), *numbers])
    if case.fault:
        with pytest.raises(ValueError, match="read strictly"):
            read_mesh(path, case.c_ras, strict=True)
    else:
        read_mesh(path, case.c_ras, strict=True)
    assert capfd.readouterr() == ("", "")


def test_there_are_enough_and_none_twice():
    names = [case.name for case in MESHES]
    assert len(names) == len(set(names)) >= 120


def by_name(start: str) -> list[Case]:
    return [case for case in MESHES if case.name.startswith(start) and not case.refused]


@pytest.mark.parametrize("case", by_name("plain"), ids=lambda case: case.name)
def test_trimesh_and_vtk_find_the_same(case, tmp_path):
    """So that the files themselves are right: readers that others wrote find the same surface in the plain ones."""
    path = placed(case, tmp_path)
    if path.suffix in (".vtk", ".vtp"):
        found = pyvista.read(path)
        points, faces = found.points, found.regular_faces
    else:
        found = trimesh.load_mesh(path, process=False)
        points, faces = found.vertices, found.faces
    np.testing.assert_array_equal(points[faces], case.vertices[case.faces])


GIFTI = [case for case in by_name("") if case.name.startswith(("ASCII", "Base64", "GZip"))]


@pytest.mark.parametrize("case", [*GIFTI, *by_name("lh.white"), *by_name("lh.old_quads"), *by_name("lh.new_quads")])
def test_nibabel_finds_the_same(case, tmp_path):
    path = placed(case, tmp_path)
    if case in GIFTI:
        points, faces = nibabel.load(path).agg_data(("pointset", "triangle"))
    else:
        points, faces = nibabel.freesurfer.read_geometry(path)
        points = points + (np.array(mesh_files.C_RAS) if case.name == "lh.white" else 0)
    np.testing.assert_array_equal(points, case.vertices)
    np.testing.assert_array_equal(faces, case.faces)
