"""Triangle meshes, and contours as their 2D counterpart."""

import dataclasses
import io
import tempfile
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from meshot.errors import as_indices, as_points, require_shape
from meshot.extras import needing
from meshot.mesh.polygon_files import NORMALS, Stored, merged
from meshot.types import Array, Float, Int64, Tensor

if TYPE_CHECKING:
    import pyvista
    import trimesh


def _validated(vertices: object, cells: object, dimension: int, corners: int, kind: str) -> tuple[Tensor, Tensor]:
    vertices = as_points(vertices, "vertices", dimension)
    cells = as_indices(cells, kind, vertices.shape[0]).to(vertices.device)
    require_shape(cells, kind, corners)
    repeated = (cells == cells.roll(1, dims=1)).any(dim=1)
    if bool(repeated.any()):
        raise ValueError(
            f"{kind} has {int(repeated.sum())} rows that name a vertex twice, the first is row "
            f"{int(repeated.nonzero()[0])}: remove them"
        )
    return vertices, cells


class _Shape:
    """Common methods of meshes and contours."""

    def with_vertices(self, vertices: Tensor):
        """The same connectivity with other vertices. Only the array's shape is checked."""
        if vertices.shape != self.vertices.shape:
            raise ValueError(
                f"vertices has shape {tuple(vertices.shape)}; {tuple(self.vertices.shape)} is needed, one row for each "
                "vertex that the cells name"
            )
        other = object.__new__(type(self))
        for field in dataclasses.fields(self):
            object.__setattr__(other, field.name, getattr(self, field.name))
        object.__setattr__(other, "vertices", vertices)
        return other

    def to(self, *args, **kwargs):
        """The same shape with vertices of another dtype or on another device (arguments as ``torch.Tensor.to``)."""
        vertices = self.vertices.to(*args, **kwargs)
        cells = {
            field.name: getattr(self, field.name).to(vertices.device)
            for field in dataclasses.fields(self)
            if field.name != "vertices"
        }
        return type(self)(vertices, **cells)


@dataclasses.dataclass(frozen=True, eq=False)
class Mesh(_Shape):
    """A triangle mesh in R³. It is immutable and is validated when it is created.

    Parameters
    ----------
    vertices : tensor or array
        Floating point, one row per vertex. In mm if the mesh comes from a scan.
    faces : tensor or array
        Integers, one row per triangle, counter-clockwise seen from outside, so that normals point outwards.

    Raises
    ------
    ValueError
        If an array is empty, has the wrong shape or dtype, or contains NaN; if a face has the index of a vertex that
        does not exist, or the same index twice.

    Examples
    --------
    >>> import torch, meshot
    >>> mesh = meshot.Mesh(torch.eye(3), torch.tensor([[0, 1, 2]]))
    >>> mesh
    Mesh(3 vertices, 1 faces, torch.float32)
    >>> meshot.Mesh.from_trimesh(mesh.to_trimesh())
    Mesh(3 vertices, 1 faces, torch.float64)
    """

    vertices: Float[Tensor, "V 3"]
    faces: Int64[Tensor, "F 3"]

    def __post_init__(self):
        vertices, faces = _validated(self.vertices, self.faces, 3, 3, "faces")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @classmethod
    def from_trimesh(cls, other: "trimesh.Trimesh | trimesh.Scene") -> "Mesh":
        """The mesh of a ``trimesh.Trimesh``, in float64. The meshes of a scene are transformed and joined.

        Raises
        ------
        ValueError
            If ``other`` is of another class, or has no triangles.
        """
        return cls(*map(torch.from_numpy, trimesh_arrays(other)))

    @classmethod
    def from_pyvista(cls, other: "pyvista.PolyData") -> "Mesh":
        """The mesh of a ``pyvista.PolyData``, in float64. Faces with more than three corners are triangulated.

        Raises
        ------
        ValueError
            If ``other`` is of another class, or has no triangles.
        """
        return cls(*map(torch.from_numpy, pyvista_arrays(other)))

    def to_trimesh(self) -> "trimesh.Trimesh":
        """A ``trimesh.Trimesh`` with the same vertices and faces, in the same order, without gradient."""
        import trimesh

        return trimesh.Trimesh(self.vertices.detach().double().cpu().numpy(), self.faces.cpu().numpy(), process=False)

    def to_pyvista(self) -> "pyvista.PolyData":
        """A ``pyvista.PolyData`` with the same vertices and faces, in the same order, without gradient."""
        pyvista = _pyvista()
        vertices = self.vertices.detach().double().cpu().numpy()
        return pyvista.PolyData.from_regular_faces(vertices, self.faces.cpu().numpy())

    def __repr__(self) -> str:
        return f"Mesh({self.vertices.shape[0]} vertices, {self.faces.shape[0]} faces, {self.vertices.dtype})"


@dataclasses.dataclass(frozen=True, eq=False)
class Contour(_Shape):
    """A polygonal line in R², open or closed: the 2D counterpart of :class:`Mesh`. Immutable and validated.

    Parameters
    ----------
    vertices : tensor or array
        Floating point, one row per vertex.
    edges : tensor or array
        Integers, one row per edge, counter-clockwise around the interior, so that normals point outwards.

    Examples
    --------
    >>> import torch, meshot
    >>> corners = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    >>> meshot.Contour(corners, torch.tensor([[0, 1], [1, 2], [2, 0]]))
    Contour(3 vertices, 3 edges, torch.float32)
    """

    vertices: Float[Tensor, "V 2"]
    edges: Int64[Tensor, "E 2"]

    def __post_init__(self):
        vertices, edges = _validated(self.vertices, self.edges, 2, 2, "edges")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "edges", edges)

    def __repr__(self) -> str:
        return f"Contour({self.vertices.shape[0]} vertices, {self.edges.shape[0]} edges, {self.vertices.dtype})"


def closed_contour(vertices: Float[Tensor, "V 2"]) -> Contour:
    """The contour that connects consecutive vertices, and the last vertex with the first.

    Raises
    ------
    ValueError
        If there are fewer than three vertices.
    """
    n_vertices = len(vertices)
    if n_vertices < 3:
        raise ValueError(f"vertices has {n_vertices} rows; a closed contour needs at least three")
    first = torch.arange(n_vertices)
    return Contour(vertices, torch.stack([first, first.roll(-1)], dim=1))


# Conversion of meshes to and from trimesh and PyVista, which are imported only when needed.

#: Suffixes of the file formats that are read and written by PyVista (VTP, VTK) and trimesh (GLB).
EXCHANGED = ("vtp", "vtk", "glb")


def trimesh_arrays(other: Any) -> tuple[Array, Array]:
    """Vertices and faces of a ``trimesh.Trimesh``, or of all meshes in a ``trimesh.Scene`` after its transforms."""
    import trimesh

    if isinstance(other, trimesh.Scene):
        other = other.to_mesh()
    if not isinstance(other, trimesh.Trimesh):
        raise ValueError(f"a {_kind(other)} was given; a trimesh.Trimesh or a trimesh.Scene is needed")
    if len(other.faces) == 0:
        raise ValueError(f"the {_kind(other)} has no triangles; a triangle mesh is needed")
    return np.array(other.vertices, np.float64), np.array(other.faces, np.int64)


def pyvista_arrays(other: Any) -> tuple[Array, Array]:
    """Vertices and faces of a ``pyvista.PolyData``. Strips and faces with more than three corners are triangulated."""
    pyvista = _pyvista()
    if not isinstance(other, pyvista.PolyData):
        raise ValueError(
            f"a {_kind(other)} was given; a pyvista.PolyData is needed: other data sets have .extract_surface()"
        )
    surface = other if other.is_all_triangles and other.n_strips == 0 else other.triangulate()
    faces = np.array(surface.regular_faces, np.int64)
    if len(faces) == 0:
        raise ValueError(f"the {_kind(other)} has no triangles; a triangle mesh is needed")
    return np.array(surface.points, np.float64), faces


def read_exchanged(content: bytes, kind: str) -> Stored:
    """A file of one of the ``EXCHANGED`` formats. All meshes of a GLB scene are transformed as it says and joined."""
    if kind == "glb":
        import trimesh

        scene = trimesh.load_scene(io.BytesIO(content), file_type=kind, process=False)
        stored = Stored(*merged(*trimesh_arrays(scene)), "GLB")
        looks = [mesh.visual for mesh in scene.geometry.values()]
        if any(getattr(look, "uv", None) is not None for look in looks):
            stored.not_read.append("texture coordinates and materials")
        if any(look.kind in ("vertex", "face") for look in looks):
            stored.not_read.append("colours")
        if len(looks) > 1:
            stored.not_read.append(f"the division into {len(looks)} meshes")
        return stored
    pyvista = _pyvista()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"mesh.{kind}")
        path.write_bytes(content)
        data = pyvista.read(path)
    if isinstance(data, pyvista.PolyData) and data.n_strips == 0 and not data.is_all_triangles:
        flat, polygons, place = data.faces.tolist(), [], 0  # each face is its number of corners, and then these
        while place < len(flat):
            polygons.append(flat[place + 1 : place + 1 + flat[place]])
            place += 1 + flat[place]
        stored = Stored(np.array(data.points, np.float64), polygons, "")
    else:
        stored = Stored(*pyvista_arrays(data), "")
    stored.format = "VTK XML (VTP)" if kind == "vtp" else "VTK, legacy"
    for name, values in data.point_data.items():
        if name.lower() in NORMALS or values.dtype.kind not in "iufb" or values.ndim > 2:
            stored.not_read.append(f"data of points: {name}")
        else:
            stored.vertex_data[name] = np.array(values)
    stored.not_read += [f"data of cells: {', '.join(data.cell_data.keys())}"] * bool(data.cell_data.keys())
    stored.not_read += ["lines and single points"] * (data.n_lines > 0)
    said = str(data.field_data["SPACE"][0]).encode() if "SPACE" in data.field_data else b""
    title = content.split(b"\n", 2)[1] if kind == "vtk" and content.count(b"\n") > 1 else b""
    return stored.heed_space(b"SPACE=" + said if said else title)


def _pyvista() -> ModuleType:
    with needing("cortex"):
        import pyvista
    return pyvista


def _kind(value: object) -> str:
    return f"{type(value).__module__.split('.')[0]}.{type(value).__qualname__}".removeprefix("builtins.")
