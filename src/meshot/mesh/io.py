"""Reading and writing of mesh files. Vertices in memory are in scanner RAS, in mm."""

import gzip
import os
import re
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import nibabel
import nibabel.freesurfer
import numpy as np
import torch

from meshot.file_facts import FileFacts, heed
from meshot.files import unpacked, whole_file
from meshot.mesh.brain_files import LARGEST_BYTES, SURFACE_AXES, read_freesurfer, read_gifti
from meshot.mesh.geometry import triangulate
from meshot.mesh.mesh import EXCHANGED, Mesh, read_exchanged
from meshot.mesh.polygon_files import OFF_HEAD, Stored, read_obj, read_off, read_ply, read_stl, without_repeats
from meshot.types import Array, Float, Shaped, Tensor

if TYPE_CHECKING:
    import trimesh

#: Readers that take the content of a file. FreeSurfer and GIfTI need more, and VTK reads files of its own.
_READERS = {"ply": read_ply, "obj": read_obj, "off": read_off, "stl": read_stl}
FREESURFER_NAMES = ("white", "pial", "orig", "smoothwm", "inflated", "sphere", "surf")
_SCANNER = 1
_MARKS = {"ply": b"ply", "stl": b"solid", "vtk": b"# vtk", "glb": b"gltf"}
_BOM = b"\xef\xbb\xbf"
_KNOWN = "PLY, OBJ, OFF, STL, VTP, VTK, GLB, GIfTI, FreeSurfer"


def read_mesh(
    path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None, *, strict: bool = False
) -> Mesh:
    """Read a mesh from PLY, OBJ, OFF, STL, VTP, VTK, GLB, GIfTI or FreeSurfer: float64, in scanner RAS (mm).

    The format is recognised by the content, or else by the suffix. A file may be compressed with gzip.

    The vertices are those of the file, in its order, with those that no face uses. Seams of texture coordinates,
    normals or materials do not divide them. STL and GLB repeat a position for every triangle or seam; there, vertices
    at the same position are merged, in the order in which positions first appear. Faces stay in their order, and those
    with more than three corners are divided by :func:`meshot.triangulate`. A face that names a vertex twice has no
    area and is left out, with a warning.

    FreeSurfer files store surface RAS, which is converted to scanner RAS with the volume information at the end of the
    file, or with ``c_ras``. The matrix of a GIfTI file is applied if it maps to the scanner; files of FreeSurfer up to
    7.3, which have none, are moved by their fields VolGeomC. Where a comment or title says ``SPACE=LPS``, as in files
    of 3D Slicer, x and y are negated. All other coordinates are not changed. A reflection turns the faces around.
    :func:`meshot.mesh.mesh_facts` says which of this was done.

    Parameters
    ----------
    path : path
    c_ras : three numbers, optional
        The scanner coordinates of the centre of a FreeSurfer surface's volume, if the file does not contain them.
    strict : bool
        Whether a file that contradicts itself is refused. Otherwise there is a warning for each contradiction.

    Raises
    ------
    ValueError
        If the file is missing, truncated, of unknown format, or not a mesh; or if a FreeSurfer surface has no volume
        information and ``c_ras`` is not given.

    Examples
    --------
    >>> import pathlib, tempfile, meshot
    >>> from meshot.mesh.shapes import cube
    >>> path = pathlib.Path(tempfile.mkdtemp(), "cube.vtp")
    >>> meshot.write_mesh(path, cube())
    >>> meshot.read_mesh(path)
    Mesh(8 vertices, 12 faces, torch.float64)
    """
    mesh, facts, _ = read_whole_mesh(path, c_ras)
    heed(path, facts, strict)
    return mesh


def mesh_facts(path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None) -> FileFacts:
    """What a mesh file says about itself: format, space and the field that states it, contradictions, what is not read.

    The facts are those that :func:`meshot.read_mesh` follows. Arguments and errors are the same.
    """
    return read_whole_mesh(path, c_ras)[1]


def read_vertex_data(
    path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None
) -> dict[str, Shaped[Tensor, "V ..."]]:
    """The numbers that a mesh file holds for every vertex, by name, such as thickness, labels or colours.

    There is a row for each vertex of :func:`meshot.read_mesh`, in its order; arguments and errors are the same. The
    dtype is that of the file. The data are the properties of vertices of a PLY file (colours are ``red``, ``green`` and
    ``blue``), the point data of VTP and VTK, and further arrays of a GIfTI surface. Other formats hold none. Normals
    are left out, since they follow from the surface: :func:`meshot.mesh.vertex_normals`.

    Examples
    --------
    >>> import pathlib, tempfile, torch, meshot
    >>> from meshot.mesh import read_vertex_data
    >>> from meshot.mesh.shapes import cube
    >>> path = pathlib.Path(tempfile.mkdtemp(), "cube.ply")
    >>> meshot.write_mesh(path, cube(), vertex_data={"height": cube().vertices[:, 2].float()})
    >>> read_vertex_data(path)["height"].shape
    torch.Size([8])
    """
    return read_whole_mesh(path, c_ras)[2]


def read_whole_mesh(
    path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None
) -> tuple[Mesh, FileFacts, dict[str, Tensor]]:
    """The mesh of a file, what the file says about itself, and the data of its vertices, without warnings."""
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist or is no file")
    content = unpacked(path, LARGEST_BYTES)
    named, kind = _format_of_name(path), _format_of_content(content)
    kind = kind or named or _likely_format(content)
    if kind is None:
        raise ValueError(f"{path} is no mesh: neither its suffix nor its content is {_KNOWN}")
    try:
        if kind == "freesurfer":
            stored = read_freesurfer(content, c_ras)
        elif kind == "gifti":
            stored = read_gifti(content, path.parent)
        else:
            stored = read_exchanged(content, kind) if kind in EXCHANGED else _READERS[kind](content.removeprefix(_BOM))
        if named not in (None, kind):
            stored.faults.append(f"its name is that of a {named} file, and its content is {kind}")
        mesh = _mesh(stored)
    except ValueError as error:
        raise ValueError(f"{path} cannot be read as a {kind} mesh: {error}") from error
    except ImportError:
        raise
    except Exception as error:  # the parsers of other libraries raise many types, with words of their own
        raise ValueError(
            f"{path} cannot be read as a {kind} mesh: it is cut short, damaged, or of another kind; get the file again"
        ) from error
    data = {n: torch.from_numpy(v.astype(v.dtype.newbyteorder("="), order="C")) for n, v in stored.vertex_data.items()}
    said = ", ".join(f"{name} ({values.numpy().dtype})" for name, values in data.items())
    numbers = (("data of vertices", said),) if data else ()
    faults, not_read = tuple(stored.faults), tuple(stored.not_read)
    return mesh, FileFacts(stored.format, stored.space, stored.said_by, faults, not_read, numbers), data


def _mesh(stored: Stored) -> Mesh:
    """The mesh in scanner RAS. Faces are divided before the coordinates change, and then turned if that reflects."""
    vertices, polygons = np.ascontiguousarray(stored.vertices, np.float64), stored.polygons
    if len(polygons) == 0:
        raise ValueError(f"it holds {len(vertices)} vertices and no faces; a surface is needed")
    if not isinstance(polygons, np.ndarray) and all(len(polygon) == 3 for polygon in polygons):
        polygons = np.array(polygons)
    if isinstance(polygons, np.ndarray) and polygons.dtype.kind not in "iu":
        raise ValueError("its faces name vertices by numbers that are not whole")
    if isinstance(polygons, np.ndarray) and polygons.shape[1] == 3:
        repeated = (polygons == np.roll(polygons, 1, axis=1)).any(axis=1)
        n_left_out, faces = int(repeated.sum()), polygons[~repeated]
    else:
        corners = without_repeats(polygons.tolist() if isinstance(polygons, np.ndarray) else polygons)
        kept = [polygon for polygon in corners if len(polygon) > 2]
        n_left_out = len(corners) - len(kept)
        n_larger = sum(len(polygon) > 3 for polygon in kept)
        if n_larger:
            stored.not_read.append(f"{n_larger} faces with more than three corners, which are divided into triangles")
            faces = triangulate(torch.from_numpy(vertices), kept).faces.numpy() if kept else []
        else:
            faces = np.array(kept, np.int64)
    if n_left_out:
        stored.faults.append(
            f"{n_left_out} faces name a vertex twice or have fewer than three corners, and are left out"
        )
    if not len(faces):
        raise ValueError("none of its faces has three different corners; a surface is needed")
    mesh = Mesh(torch.from_numpy(vertices), torch.from_numpy(np.ascontiguousarray(faces, np.int64)))
    if stored.to_scanner is None:
        return mesh
    matrix = torch.from_numpy(stored.to_scanner)
    faces = mesh.faces.flip(1) if torch.linalg.det(matrix[:3, :3]) < 0 else mesh.faces
    return Mesh(mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3], faces)


def write_mesh(
    path: str | os.PathLike,
    mesh: Mesh,
    c_ras: tuple[float, float, float] = (0.0, 0.0, 0.0),
    structure: tuple[str, str] | None = None,
    vertex_data: Mapping[str, Shaped[Tensor, "V ..."] | Shaped[Array, "V ..."]] | None = None,
) -> None:
    """Write a mesh in the format given by the suffix. Vertices are in scanner RAS (mm).

    GIfTI files (``.gii``, ``.gii.gz``) are written in scanner RAS and labelled so. FreeSurfer surfaces (``lh.…``,
    ``rh.…``, or a suffix such as ``.white``) are written in the surface RAS of FreeSurfer's conformed volume, a cube
    of 256 mm, with volume information. With a further ``.gz``, the file is compressed. All formats
    but OBJ, OFF, VTP and VTK hold 32-bit numbers: the error is about 1e-5 mm at 100 mm.

    Parameters
    ----------
    path : path
    mesh : Mesh
    c_ras : three numbers
        For FreeSurfer surfaces only: the centre of the scan in scanner RAS, see :func:`meshot.volume.centre_ras`.
    structure : two str, optional
        For GIfTI only: the names of the part of the brain, ``("CortexLeft", "GrayWhite")`` for the left white surface.
    vertex_data : mapping, optional
        For PLY, VTP, VTK and GIfTI: numbers for every vertex by name, with a row for each.
        :func:`meshot.mesh.read_vertex_data` returns them.
        The k columns of a (V, k) array are k properties of a PLY file, ``name_0`` to ``name_k-1``. GIfTI
        stores uint8, int32 and float32: others are converted, floats with rounding. Names in PLY have letters, digits
        and ``_`` only; others become ``_``.

    Raises
    ------
    ValueError
        If the suffix or the structure is unknown, ``c_ras`` is not three finite numbers, or the format does not hold
        these data of vertices.
    ImportError
        If a VTP or VTK file is written or read without PyVista, which is part of ``meshot[cortex]``.

    Examples
    --------
    >>> import pathlib, tempfile, meshot
    >>> from meshot.mesh.shapes import cube
    >>> path = pathlib.Path(tempfile.mkdtemp(), "cube.ply")
    >>> meshot.write_mesh(path, cube())
    >>> path.exists()
    True
    """
    path, kind = Path(path), _format_of_name(Path(path))
    if kind is None:
        raise ValueError(
            f"{path.name} names no format; use .ply .obj .off .stl .vtp .vtk .glb .gii, lh.NAME or rh.NAME, and .gz "
            "behind them for a compressed file"
        )
    centre = np.asarray(c_ras, dtype=np.float64)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise ValueError(f"c_ras is {c_ras!r}; three finite numbers are needed, in mm")
    vertices = mesh.vertices.detach().double().cpu().numpy()
    faces = mesh.faces.cpu().numpy()
    data = _checked_data(vertex_data or {}, len(vertices), path, kind)
    with whole_file(path) as temporary:
        packed, temporary = temporary, temporary.with_name(temporary.name.removesuffix(".gz"))
        if kind == "gifti":
            nibabel.save(gifti_image(vertices, faces, structure, data), temporary)
        elif kind == "freesurfer":
            about = {"head": np.array([2, 0, 20]), "valid": "1  # volume info valid", "filename": "scan"}
            about |= {"volume": np.array([256, 256, 256]), "voxelsize": np.ones(3)}
            about |= dict(zip(("xras", "yras", "zras"), SURFACE_AXES.T, strict=True)) | {"cras": centre}
            nibabel.freesurfer.write_geometry(
                temporary, vertices - centre, faces, create_stamp="created by meshot", volume_info=about
            )
        elif kind in ("vtp", "vtk"):
            polygons = mesh.to_pyvista()
            for name, values in data.items():
                polygons.point_data[name] = values
            polygons.save(temporary)
        else:
            shape = mesh.to_trimesh()
            shape.vertex_attributes.update(data)
            shape.export(temporary, file_type=kind)
        if packed != temporary:
            packed.write_bytes(gzip.compress(temporary.read_bytes(), mtime=0))


def write_vertex_values(path: str | os.PathLike, values: Shaped[Array, " V"]) -> None:
    """Write a number for every vertex, such as its thickness.

    Parameters
    ----------
    path : path
        ``.shape.gii`` or another ``.gii``, else a file of FreeSurfer such as ``lh.thickness``.
    values : array
        Finite; written as 32-bit floats.

    Raises
    ------
    ValueError
        If a value is not finite, or the array has not one axis.
    """
    path, values = Path(path), np.asarray(values, dtype=np.float32)
    if values.ndim != 1 or not np.isfinite(values).all():
        raise ValueError(f"values have the shape {values.shape}, or are not finite; a finite number a vertex is needed")
    with whole_file(path) as temporary:
        if path.suffix == ".gii":
            array = nibabel.gifti.GiftiDataArray(values, intent="NIFTI_INTENT_SHAPE")
            nibabel.save(nibabel.GiftiImage(darrays=[array]), temporary)
        else:
            nibabel.freesurfer.write_morph_data(temporary, values)


def write_vertex_labels(
    path: str | os.PathLike,
    labels: Shaped[Array, " V"],
    names: Sequence[str],
    colours: Sequence[tuple[int, int, int]],
) -> None:
    """Write the region of every vertex, with names and colours.

    Parameters
    ----------
    path : path
        ``.label.gii`` or another ``.gii``, else an annotation of FreeSurfer such as ``lh.aparc.annot``.
    labels : array of int
        Indices of ``names``.
    names : sequence of str
    colours : sequence of three int
        Red, green and blue from 0 to 255 of each name; no two alike.

    Raises
    ------
    ValueError
        If a label has no name, or names and colours are not equally many, or two colours are alike.
    """
    path, labels = Path(path), np.asarray(labels)
    if labels.ndim != 1 or labels.dtype.kind not in "iu":
        raise ValueError(f"labels have the shape {labels.shape} and the type {labels.dtype}; integers are needed")
    if len(labels) and not (labels.min() >= 0 and labels.max() < len(names)):
        raise ValueError(f"labels run from {labels.min()} to {labels.max()}, and there are {len(names)} names")
    if len(set(colours)) != len(colours) or len(colours) != len(names):
        raise ValueError(f"{len(names)} names and {len(set(colours))} different colours came; one a name is needed")
    with whole_file(path) as temporary:
        if path.suffix == ".gii":
            array = nibabel.gifti.GiftiDataArray(labels.astype(np.int32), intent="NIFTI_INTENT_LABEL")
            table = nibabel.gifti.GiftiLabelTable()
            for key, (name, colour) in enumerate(zip(names, colours, strict=True)):
                each = nibabel.gifti.GiftiLabel(key, *(value / 255 for value in colour), float(key > 0))
                each.label = name
                table.labels.append(each)
            nibabel.save(nibabel.GiftiImage(darrays=[array], labeltable=table), temporary)
        else:
            table = np.array([[*colour, 0] for colour in colours], dtype=np.int32)
            nibabel.freesurfer.write_annot(temporary, labels.astype(np.int32), table, list(names), fill_ctab=True)


#: The types in which formats hold data of vertices; of VTP and VTK all.
_DATA_TYPES = {
    "ply": ("i4", "u4", "i2", "u2", "i1", "u1", "f4", "f8"),
    "gifti": ("i4", "u1", "f4"),
    "vtp": ("i8", "u8", "i4", "u4", "i2", "u2", "i1", "u1", "f4", "f8"),
}
_DATA_TYPES["vtk"] = _DATA_TYPES["vtp"]


def holds_vertex_data(path: str | os.PathLike) -> bool:
    """Whether :func:`meshot.write_mesh` can write data of vertices into a file of this name."""
    return _format_of_name(Path(path)) in _DATA_TYPES


def _checked_data(given: Mapping[str, object], n_vertices: int, path: Path, kind: str) -> dict[str, Array]:
    """Data of vertices in types that the format holds."""
    if given and kind not in _DATA_TYPES:
        raise ValueError(f"{path.name} cannot hold {', '.join(given)} of its vertices; use .ply, .vtp, .vtk or .gii")
    columns: dict[str, Array] = {}
    for name, values in given.items():
        values = values.detach().cpu().numpy() if isinstance(values, Tensor) else np.asarray(values)
        if values.ndim not in (1, 2) or len(values) != n_vertices or values.dtype.kind not in "iufb":
            raise ValueError(
                f"{name} has the shape {values.shape} and the type {values.dtype}; numbers are needed, in {n_vertices} "
                "rows, one for each vertex"
            )
        values = _in_type_of(values, name, _DATA_TYPES[kind], path)
        own = {name: values}
        if kind == "ply":
            many = {f"{name}_{k}": column for k, column in enumerate(values.T)} if values.ndim == 2 else own
            own = {re.sub(r"\W", "_", key, flags=re.ASCII): column for key, column in many.items()}
        twice = [key for key in own if key in columns or key in ("", "x", "y", "z", "vertex")]
        if twice or len(own) < (values.shape[1] if kind == "ply" and values.ndim == 2 else 1):
            raise ValueError(f"{path.name} cannot hold data of the name {name!r}, which is empty or taken: rename them")
        columns |= own
    return columns


def _in_type_of(values: Array, name: str, types: tuple[str, ...], path: Path) -> Array:
    """The values in their own type if the format has it, or in the first one that holds them; floats are rounded."""
    values = values.astype(np.uint8) if values.dtype.kind == "b" else values
    if values.dtype.str[1:] in types:
        return values
    if values.dtype.kind == "f":
        return values.astype(np.float32)  # from float16, or for a format without float64
    for kind in types:
        if kind[0] != "f" and np.array_equal(values.astype(kind), values):
            return values.astype(kind)
    raise ValueError(
        f"{name} holds numbers up to {values.max()}, beyond the integers of {path.name}; write them as VTP"
    )


def _format_of_name(path: Path) -> str | None:
    name = path.name.lower().removesuffix(".gz")
    suffix = name.rsplit(".", 1)[-1]
    if suffix == "gii":
        return "gifti"
    if suffix in (*_READERS, *EXCHANGED):
        return suffix
    return "freesurfer" if name.startswith(("lh.", "rh.")) or suffix in FREESURFER_NAMES else None


def _format_of_content(content: bytes) -> str | None:
    """The format, where the first bytes are sure to be of it."""
    head = content[:4096].removeprefix(_BOM)
    if head[:3] in (b"\xff\xff\xfe", b"\xff\xff\xff", b"\xff\xff\xfd"):
        return "freesurfer"
    if b"<GIFTI" in head or b"gifti.dtd" in head:
        return "gifti"
    if b"<VTKFile" in head:
        return "vtp"
    start = head.lstrip().lower()
    marked = next((kind for kind, mark in _MARKS.items() if start.startswith(mark)), None)
    return marked or ("off" if OFF_HEAD.match(start.decode("latin-1")) else None)


def _likely_format(content: bytes) -> str | None:
    """The format, where the name says nothing."""
    if any(line.split()[:1] == [b"v"] for line in content[:4096].splitlines()):
        return "obj"
    return "stl" if len(content) == 84 + 50 * int.from_bytes(content[80:84], "little") else None


# Surfaces as GIfTI images: coordinates in scanner RAS, with the names by which Connectome Workbench knows a cortex.

#: What Connectome Workbench reads: https://www.humanconnectome.org/software/connectome-workbench
PRIMARY = ("CortexLeft", "CortexRight", "Cortex", "CortexRightAndLeft", "Cerebellum")
SECONDARY = ("GrayWhite", "MidThickness", "Pial")


def gifti_image(
    vertices: Array,
    faces: Array,
    structure: tuple[str, str] | None = None,
    vertex_data: Mapping[str, Array] = types.MappingProxyType({}),
) -> nibabel.GiftiImage:
    """A closed surface in scanner RAS as a GIfTI image."""
    points, triangles = {}, {}
    if structure is not None:
        if len(structure) != 2 or structure[0] not in PRIMARY or structure[1] not in SECONDARY:
            raise ValueError(
                f"structure is {structure!r}; one of {', '.join(PRIMARY)} and one of {', '.join(SECONDARY)} are needed"
            )
        points = {
            "AnatomicalStructurePrimary": structure[0],
            "AnatomicalStructureSecondary": structure[1],
            "GeometricType": "Anatomical",
        }
        triangles = {"TopologicalType": "Closed"}
    system = nibabel.gifti.GiftiCoordSystem(_SCANNER, _SCANNER, np.eye(4))
    arrays = [
        nibabel.gifti.GiftiDataArray(
            vertices.astype(np.float32), intent="NIFTI_INTENT_POINTSET", coordsys=system, meta=points
        ),
        nibabel.gifti.GiftiDataArray(faces.astype(np.int32), intent="NIFTI_INTENT_TRIANGLE", meta=triangles),
    ]
    for name, values in vertex_data.items():
        intent = f"NIFTI_INTENT_{'SHAPE' if values.dtype.kind == 'f' and values.ndim == 1 else 'NONE'}"
        arrays.append(nibabel.gifti.GiftiDataArray(values, intent=intent, meta={"Name": name}))
    return nibabel.GiftiImage(darrays=arrays)


# Files whose vertices are moved and whose other contents stay: colours, texture coordinates, materials.

#: Formats that hold more than positions and faces, and that are read and written without a change of the order.
DECORATED = (".ply", ".obj", ".glb")


def write_carried(
    path: str | os.PathLike,
    source: str | os.PathLike,
    mesh: Mesh,
    carry: Callable[[Float[Tensor, "n 3"]], Float[Tensor, "n 3"]],
) -> bool:
    """Write a mesh file with the contents of another and moved vertices.

    ``mesh`` is what was read from the source. Nothing is written, and False is returned, if one of the formats holds
    no more than positions and faces, if the source has no more, or if its coordinates were changed when it was read.

    Vertices that a file repeats along a seam of its texture move together, since the motion depends on the position
    alone. The parts of a scene stay parts.
    """
    path, source = Path(path), Path(source)
    if not {path.suffix.lower(), source.suffix.lower()} <= set(DECORATED):
        return False
    import trimesh

    loaded = trimesh.load_scene(source, process=False, maintain_order=True)
    parts = loaded.dump(concatenate=False)  # with the transforms of the scene applied
    if all(_is_plain(part) for part in parts):
        return False
    # trimesh knows nothing of SPACE=LPS, and its reader of OBJ is wrong in places.
    ours = mesh.vertices[mesh.faces.unique()].numpy()
    theirs = np.concatenate([part.vertices[np.unique(part.faces)] for part in parts])
    ours, theirs = (np.unique(points + 0.0, axis=0) for points in (ours, theirs))
    if ours.shape != theirs.shape or not np.allclose(ours, theirs):
        return False
    for part in parts:
        part.vertices = carry(torch.from_numpy(part.vertices.copy())).detach().numpy()
    result = parts[0] if len(parts) == 1 and path.suffix.lower() != ".glb" else trimesh.Scene(parts)
    result.export(path)
    return True


def _is_plain(part: "trimesh.Trimesh") -> bool:
    """Whether a part has positions and faces only."""
    texture = getattr(part.visual, "uv", None) is not None
    return not (texture or part.visual.defined or part.vertex_attributes or part.face_attributes)
