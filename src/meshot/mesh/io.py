"""Reading and writing of mesh files. Vertices in memory are in scanner RAS, in mm."""

import io
import os
import warnings
from pathlib import Path

import nibabel
import nibabel.freesurfer
import numpy as np
import torch
import trimesh

from meshot.compressed import unpacked
from meshot.files import whole_file
from meshot.mesh.convert import EXCHANGED, read_exchanged, write_exchanged
from meshot.mesh.io_checks import (
    LARGEST_BYTES,
    require_all_read,
    require_room_in_freesurfer,
    require_room_in_gifti,
    require_whole_text,
)
from meshot.mesh.io_gifti import gifti_image
from meshot.mesh.mesh import Mesh
from meshot.types import Array

PLAIN_FORMATS = ("ply", "obj", "off", "stl")
FREESURFER_NAMES = ("white", "pial", "orig", "smoothwm", "inflated", "sphere", "surf")
_SCANNER, _UNKNOWN = 1, 0
_MARKS = (
    ("ply", b"ply"),
    ("off", b"off"),
    ("stl", b"solid"),
    ("vtk", b"# vtk"),
    ("glb", b"gltf"),
)
# Columns: the directions of the first, second and third voxel axis in FreeSurfer's surface RAS ("tkregister") space.
_SURFACE_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def read_mesh(path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None) -> Mesh:
    """Read a mesh from PLY, OBJ, OFF, STL, VTP, VTK, GLB, GIfTI or FreeSurfer: float64, in scanner RAS (mm).

    The format is recognised by the suffix, or else by the content. FreeSurfer files store surface RAS, which is
    converted to scanner RAS with the volume information at the end of the file. The matrix of a GIfTI file is applied
    if it maps an unknown space to the scanner. The other formats carry no information about space, and their
    coordinates are not changed. In STL files, corners at the same position are merged. In GLB files, all meshes are
    joined after the transforms of the scene, and vertices at the same position are merged.

    Parameters
    ----------
    path : path
    c_ras : three numbers, optional
        The scanner coordinates of the centre of a FreeSurfer surface's volume, if the file does not contain them.

    Raises
    ------
    ValueError
        If the file is missing, truncated, of unknown format, or not a triangle mesh; or if a FreeSurfer surface has no
        volume information and ``c_ras`` is not given.

    Examples
    --------
    >>> import pathlib, tempfile, meshot
    >>> from meshot.mesh.shapes import cube
    >>> path = pathlib.Path(tempfile.mkdtemp(), "cube.vtp")
    >>> meshot.write_mesh(path, cube())
    >>> meshot.read_mesh(path)
    Mesh(8 vertices, 12 faces, torch.float64)
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist or is no file")
    kind = _format_of_name(path) or _format_of_content(path)
    if kind is None:
        raise ValueError(
            f"{path} is no mesh: neither its suffix nor its content is PLY, OBJ, OFF, STL, VTP, VTK, GLB, "
            "GIfTI, FreeSurfer"
        )
    try:
        if kind == "freesurfer":
            vertices, faces = _read_freesurfer(path, c_ras)
        elif kind in EXCHANGED:
            vertices, faces = read_exchanged(path, kind)
        else:
            vertices, faces = _read_gifti(path) if kind == "gifti" else _read_plain(path, kind)
        return Mesh(torch.from_numpy(np.array(vertices, np.float64)), torch.from_numpy(np.array(faces, np.int64)))
    except Exception as error:  # the parsers of three libraries raise many types
        raise ValueError(f"{path} cannot be read as a {kind} mesh: {error}") from error


def write_mesh(
    path: str | os.PathLike,
    mesh: Mesh,
    c_ras: tuple[float, float, float] = (0.0, 0.0, 0.0),
    structure: tuple[str, str] | None = None,
) -> None:
    """Write a mesh in the format given by the suffix. Vertices are in scanner RAS (mm).

    GIfTI files (``.gii``, ``.gii.gz``) are written in scanner RAS and labelled so. FreeSurfer surfaces (``lh.…``,
    ``rh.…``, or a suffix such as ``.white``) are written in the surface RAS of FreeSurfer's conformed volume, a cube
    of 256 mm, with volume information. All formats but OBJ, OFF, VTP and VTK hold 32-bit numbers: the error is about
    1e-5 mm at 100 mm.

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
            f"{path.name} names no format; use .ply .obj .off .stl .vtp .vtk .glb .gii .gii.gz, lh.NAME or rh.NAME"
        )
    centre = np.asarray(c_ras, dtype=np.float64)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise ValueError(f"c_ras is {c_ras!r}; three finite numbers are needed, in mm")
    vertices = mesh.vertices.detach().double().cpu().numpy()
    faces = mesh.faces.cpu().numpy()
    with whole_file(path) as temporary:
        if kind == "gifti":
            nibabel.save(gifti_image(vertices, faces, structure), temporary)
        elif kind == "freesurfer":
            nibabel.freesurfer.write_geometry(
                temporary, vertices - centre, faces, create_stamp="created by meshot", volume_info=_volume_info(centre)
            )
        elif kind in EXCHANGED:
            write_exchanged(temporary, kind, vertices, faces)
        else:
            trimesh.Trimesh(vertices, faces, process=False).export(temporary, file_type=kind)


def _format_of_name(path: Path) -> str | None:
    name = path.name.lower().removesuffix(".gz")
    suffix = name.rsplit(".", 1)[-1]
    if suffix == "gii":
        return "gifti"
    if suffix in (*PLAIN_FORMATS, *EXCHANGED) and name == path.name.lower():
        return suffix
    return "freesurfer" if name.startswith(("lh.", "rh.")) or suffix in FREESURFER_NAMES else None


def _format_of_content(path: Path) -> str | None:
    with path.open("rb") as file:
        head = file.read(4096)
    if head[:3] in (b"\xff\xff\xfe", b"\xff\xff\xff", b"\xff\xff\xfd"):
        return "freesurfer"
    if b"<GIFTI" in head or b"gifti.dtd" in head:
        return "gifti"
    if b"<VTKFile" in head:
        return "vtp"
    start = head.lstrip().lower()
    for kind, mark in _MARKS:
        if start.startswith(mark):
            return kind
    if any(line.split()[:1] == [b"v"] for line in head.splitlines()):
        return "obj"
    n_triangles = int.from_bytes(head[80:84], "little")
    return "stl" if len(head) >= 84 and path.stat().st_size == 84 + 50 * n_triangles else None


def _read_plain(path: Path, kind: str) -> tuple[Array, Array]:
    content = path.read_bytes()
    declared = require_whole_text(content, kind)
    mesh = trimesh.load_mesh(io.BytesIO(content), file_type=kind, process=False)
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    require_all_read(declared, vertices, faces)
    if kind != "stl":
        return vertices, faces
    vertices, index = np.unique(vertices, axis=0, return_inverse=True)
    return vertices, index.reshape(-1)[faces]


def _read_gifti(path: Path) -> tuple[Array, Array]:
    content = unpacked(path, LARGEST_BYTES)
    require_room_in_gifti(content)
    image = nibabel.GiftiImage.from_bytes(content)
    points, triangles = (image.get_arrays_from_intent(f"NIFTI_INTENT_{name}") for name in ("POINTSET", "TRIANGLE"))
    if len(points) != 1 or len(triangles) != 1:
        raise ValueError(f"it holds {len(points)} point sets and {len(triangles)} triangle sets; one of each is needed")
    vertices, system = np.asarray(points[0].data, dtype=np.float64), points[0].coordsys
    if system is not None and system.dataspace == _UNKNOWN and system.xformspace == _SCANNER:
        vertices = vertices @ system.xform[:3, :3].T + system.xform[:3, 3]
    return vertices, triangles[0].data


def _read_freesurfer(path: Path, c_ras: tuple[float, float, float] | None) -> tuple[Array, Array]:
    require_room_in_freesurfer(path.read_bytes())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nibabel warns about missing volume information; here that is an error
        vertices, faces, info = nibabel.freesurfer.read_geometry(path, read_metadata=True)
    known = "cras" in info and str(info.get("valid", "1")).strip().startswith("1")
    if not known and c_ras is None:
        raise ValueError(
            "it does not specify its position in the scanner; pass c_ras, or (0, 0, 0) to keep surface RAS"
        )
    if not known:
        return vertices + np.asarray(c_ras, dtype=np.float64), faces
    # The identity for a volume in FreeSurfer's standard orientation; a reflection for one of opposite handedness.
    axes = np.column_stack([info[name] for name in ("xras", "yras", "zras")]) @ _SURFACE_AXES.T
    vertices = vertices @ axes.T + np.asarray(info["cras"], dtype=np.float64)
    return vertices, faces[:, ::-1] if np.linalg.det(axes) < 0 else faces


def _volume_info(centre: Array) -> dict:
    x_ras, y_ras, z_ras = _SURFACE_AXES.T
    return {
        "head": np.array([2, 0, 20]),
        "valid": "1  # volume info valid",
        "filename": "scan",
        "volume": np.array([256, 256, 256]),
        "voxelsize": np.ones(3),
        "xras": x_ras,
        "yras": y_ras,
        "zras": z_ras,
        "cras": centre,
    }
