"""Reading and writing of mesh files. Vertices in memory are in scanner RAS, in mm."""

import gzip
import os
from pathlib import Path

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
from meshot.types import Array

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
    mesh, facts = read_mesh_and_facts(path, c_ras)
    heed(path, facts, strict)
    return mesh


def mesh_facts(path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None) -> FileFacts:
    """What a mesh file says about itself: format, space and the field that states it, contradictions, what is not read.

    The facts are those that :func:`meshot.read_mesh` follows. Arguments and errors are the same.
    """
    return read_mesh_and_facts(path, c_ras)[1]


def read_mesh_and_facts(
    path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None
) -> tuple[Mesh, FileFacts]:
    """The mesh of a file, and what the file says about itself, without warnings."""
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
    return mesh, FileFacts(stored.format, stored.space, stored.said_by, tuple(stored.faults), tuple(stored.not_read))


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

    Raises
    ------
    ValueError
        If the suffix or the structure is unknown, or ``c_ras`` is not three finite numbers.

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
    with whole_file(path) as temporary:
        packed, temporary = temporary, temporary.with_name(temporary.name.removesuffix(".gz"))
        if kind == "gifti":
            nibabel.save(gifti_image(vertices, faces, structure), temporary)
        elif kind == "freesurfer":
            about = {"head": np.array([2, 0, 20]), "valid": "1  # volume info valid", "filename": "scan"}
            about |= {"volume": np.array([256, 256, 256]), "voxelsize": np.ones(3)}
            about |= dict(zip(("xras", "yras", "zras"), SURFACE_AXES.T, strict=True)) | {"cras": centre}
            nibabel.freesurfer.write_geometry(
                temporary, vertices - centre, faces, create_stamp="created by meshot", volume_info=about
            )
        elif kind in ("vtp", "vtk"):
            mesh.to_pyvista().save(temporary)
        else:
            mesh.to_trimesh().export(temporary, file_type=kind)
        if packed != temporary:
            packed.write_bytes(gzip.compress(temporary.read_bytes(), mtime=0))


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


def gifti_image(vertices: Array, faces: Array, structure: tuple[str, str] | None = None) -> nibabel.GiftiImage:
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
    return nibabel.GiftiImage(darrays=arrays)
