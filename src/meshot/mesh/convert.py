"""Conversion of meshes to and from trimesh and PyVista, which are imported only when needed."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from meshot.types import Array

if TYPE_CHECKING:
    import pyvista
    import trimesh

#: Suffixes of the file formats that are read and written by PyVista (VTP, VTK) and trimesh (GLB).
EXCHANGED = ("vtp", "vtk", "glb")


def trimesh_arrays(other: Any) -> tuple[Array, Array]:
    """Vertices and faces of a ``trimesh.Trimesh``, or of all meshes in a ``trimesh.Scene`` after its transforms.

    Raises
    ------
    ValueError
        If ``other`` is of another class, or has no triangles.
    """
    import trimesh

    if isinstance(other, trimesh.Scene):
        other = other.to_mesh()
    if not isinstance(other, trimesh.Trimesh):
        raise ValueError(f"a {_kind(other)} was given; a trimesh.Trimesh or a trimesh.Scene is needed")
    if len(other.faces) == 0:
        raise ValueError(f"the {_kind(other)} has no triangles; a triangle mesh is needed")
    return np.array(other.vertices, np.float64), np.array(other.faces, np.int64)


def as_trimesh(vertices: Array, faces: Array) -> "trimesh.Trimesh":
    """A ``trimesh.Trimesh`` with the same vertices and faces, in the same order. Vertices are not merged."""
    import trimesh

    return trimesh.Trimesh(vertices, faces, process=False)


def pyvista_arrays(other: Any) -> tuple[Array, Array]:
    """Vertices and faces of a ``pyvista.PolyData``. Strips and faces with more than three corners are triangulated.

    Raises
    ------
    ValueError
        If ``other`` is of another class, or has no triangles.
    """
    import pyvista

    if not isinstance(other, pyvista.PolyData):
        raise ValueError(
            f"a {_kind(other)} was given; a pyvista.PolyData is needed: other data sets have .extract_surface()"
        )
    surface = other if other.is_all_triangles and other.n_strips == 0 else other.triangulate()
    faces = np.array(surface.regular_faces, np.int64)
    if len(faces) == 0:
        raise ValueError(f"the {_kind(other)} has no triangles; a triangle mesh is needed")
    return np.array(surface.points, np.float64), faces


def as_pyvista(vertices: Array, faces: Array) -> "pyvista.PolyData":
    """A ``pyvista.PolyData`` with the same vertices and faces, in double precision."""
    import pyvista

    return pyvista.PolyData.from_regular_faces(np.asarray(vertices), np.asarray(faces))


def read_exchanged(path: Path, kind: str) -> tuple[Array, Array]:
    """Vertices and faces from a file of one of the ``EXCHANGED`` formats.

    A GLB file contains a scene. All its meshes are transformed as the scene says and joined, whatever their materials.
    Vertices at the same position, such as those along seams of materials or normals, are merged.

    Raises
    ------
    ValueError
        If the file has no triangles.
    """
    if kind != "glb":
        import pyvista

        return pyvista_arrays(pyvista.read(path, force_ext=f".{kind}"))
    import trimesh

    with path.open("rb") as file:
        vertices, faces = trimesh_arrays(trimesh.load_scene(file, file_type=kind, process=False))
    _, first, places = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    kept = np.sort(first)
    return vertices[kept], np.searchsorted(kept, first)[places.reshape(-1)][faces]


def write_exchanged(path: Path, kind: str, vertices: Array, faces: Array) -> None:
    """Write a file of one of the ``EXCHANGED`` formats. The path must have the suffix of the format."""
    if kind == "glb":
        as_trimesh(vertices, faces).export(path, file_type=kind)
    else:
        as_pyvista(vertices, faces).save(path)


def _kind(value: object) -> str:
    return f"{type(value).__module__.split('.')[0]}.{type(value).__qualname__}".removeprefix("builtins.")
