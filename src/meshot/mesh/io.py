"""Reading and writing of mesh files. Vertices in memory are in scanner RAS, in mm."""

import io
import math
import os
import warnings
import xml.parsers.expat
import zlib
from base64 import b64decode
from pathlib import Path

import nibabel
import nibabel.freesurfer
import numpy as np
import torch
import trimesh

from meshot.files import unpacked, whole_file
from meshot.mesh.mesh import EXCHANGED, Mesh, read_exchanged
from meshot.types import Array

PLAIN_FORMATS = ("ply", "obj", "off", "stl")
FREESURFER_NAMES = ("white", "pial", "orig", "smoothwm", "inflated", "sphere", "surf")
_SCANNER, _UNKNOWN = 1, 0
_MARKS = {"ply": b"ply", "off": b"off", "stl": b"solid", "vtk": b"# vtk", "glb": b"gltf"}
# Columns: the directions of the first, second and third voxel axis in FreeSurfer's surface RAS ("tkregister") space.
_SURFACE_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def read_mesh(path: str | os.PathLike, c_ras: tuple[float, float, float] | None = None) -> Mesh:
    """Read a mesh from PLY, OBJ, OFF, STL, VTP, VTK, GLB, GIfTI or FreeSurfer: float64, in scanner RAS (mm).

    The format is recognised by the suffix, or else by the content. FreeSurfer files store surface RAS, which is
    converted to scanner RAS with the volume information at the end of the file. The matrix of a GIfTI file is applied
    if it maps an unknown space to the scanner. The other formats carry no information about space, and their
    coordinates are not changed. In STL files, corners at the same position are merged. In GLB files, all meshes are
    joined after the transforms of the scene, and vertices at the same position are merged. ``c_ras`` are the scanner
    coordinates of the centre of a FreeSurfer surface's volume, if the file does not contain them.

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
            about = {"head": np.array([2, 0, 20]), "valid": "1  # volume info valid", "filename": "scan"}
            about |= {"volume": np.array([256, 256, 256]), "voxelsize": np.ones(3)}
            about |= dict(zip(("xras", "yras", "zras"), _SURFACE_AXES.T, strict=True)) | {"cras": centre}
            nibabel.freesurfer.write_geometry(
                temporary, vertices - centre, faces, create_stamp="created by meshot", volume_info=about
            )
        elif kind in ("vtp", "vtk"):
            mesh.to_pyvista().save(temporary)
        else:
            mesh.to_trimesh().export(temporary, file_type=kind)


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
    for kind, mark in _MARKS.items():
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
    if declared is not None and (len(vertices) != declared[0] or len(faces) < declared[1]):
        raise ValueError(
            f"it declares {declared[0]} vertices and {declared[1]} faces; {len(vertices)} and {len(faces)} are in it"
        )
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


# Checks of mesh files before their content is used: complete data, and sizes below a limit.

#: Maximum size of a compressed file, or of one compressed array in it, after decompression, in bytes.
LARGEST_BYTES = 1 << 27
_TRIANGLES, _QUADS = (b"\xff\xff\xfe",), (b"\xff\xff\xff", b"\xff\xff\xfd")
_Property = tuple[str, bool]  # name, and whether it is a list


def require_whole_text(content: bytes, kind: str) -> tuple[int, int] | None:
    """The numbers of vertices and faces that an ASCII PLY or OFF file declares; None for other files."""
    if kind == "stl" and content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:1024]:
        if b"endsolid" not in content[-1024:].lower():
            raise ValueError("it does not end with endsolid: it is cut short")
        return None
    if kind not in ("ply", "off") or (kind == "ply" and b"ascii" not in content[: content.find(b"end_header")]):
        return None
    lines = content.decode("utf-8", errors="replace").splitlines()
    return _ply_counts(lines) if kind == "ply" else _off_counts(lines)


def require_room_in_freesurfer(content: bytes) -> None:
    """Check that a FreeSurfer surface file is long enough for the vertices and faces it declares."""
    if content[:3] in _TRIANGLES:
        start = content.find(b"\n", content.find(b"\n") + 1) + 1  # after two lines of text
        n_vertices, n_faces = (int.from_bytes(content[start + k : start + k + 4], "big", signed=True) for k in (0, 4))
        needed = 12 * (n_vertices + n_faces)
    elif content[:3] in _QUADS:
        n_vertices, n_faces = (int.from_bytes(content[k : k + 3], "big") for k in (3, 6))
        needed = 9 + (6 if content[:3] == _QUADS[0] else 12) * n_vertices + 12 * n_faces
    else:
        return
    if min(n_vertices, n_faces) < 1 or needed > len(content):
        raise ValueError(f"it declares {n_vertices} vertices and {n_faces} faces, but has {len(content)} bytes")


def require_room_in_gifti(content: bytes) -> None:
    """Check that every array of a GIfTI file is as long as declared, and below the maximum size after decompression."""
    parser, check = xml.parsers.expat.ParserCreate(), _GiftiArrays()
    parser.buffer_text = True
    parser.StartElementHandler, parser.EndElementHandler = check.start, check.end
    parser.CharacterDataHandler = check.text
    try:
        parser.Parse(content, True)
    except xml.parsers.expat.ExpatError as error:
        raise ValueError(f"it is no whole XML: {error}") from error


class _GiftiArrays:
    """Handlers of the XML parser, called for one array after the other."""

    def __init__(self):
        self.n_values, self.packed, self.data = 0, False, None

    def start(self, name: str, given: dict[str, str]) -> None:
        if name == "DataArray":
            n_axes = int(given.get("Dimensionality", 0))
            if not 1 <= n_axes <= 6:
                raise ValueError(f"Dimensionality is {n_axes}; 1 to 6 is needed")
            sizes = [int(given.get(f"Dim{axis}", 0)) for axis in range(n_axes)]
            if min(sizes) < 0:
                raise ValueError(f"an array has the size {sizes}; sizes must be >= 0")
            self.n_values, self.packed = math.prod(sizes), given.get("Encoding") == "GZipBase64Binary"
        self.data = [] if name == "Data" else None

    def text(self, part: str) -> None:
        if self.data is not None:
            self.data.append(part)

    def end(self, name: str) -> None:
        if name != "Data" or self.data is None:
            return
        text, self.data = "".join(self.data), None
        held = len(text)
        if self.packed:
            stream = zlib.decompressobj()
            held = len(stream.decompress(b64decode(text), LARGEST_BYTES + 1))
            if held > LARGEST_BYTES:
                raise ValueError(
                    f"an array holds more than {LARGEST_BYTES >> 20} MiB unpacked; at most so much is read"
                )
            if not stream.eof:
                raise ValueError("a compressed array is cut short")
        if self.n_values > held:
            raise ValueError(f"an array declares {self.n_values} values, but holds {held} bytes")


def _ply_counts(lines: list[str]) -> tuple[int, int]:
    """The declared numbers. Elements are lines, in the order in which the header declares them."""
    end = next((k for k, line in enumerate(lines) if line.strip() == "end_header"), None)
    if end is None:
        raise ValueError("its header does not end")
    elements: list[tuple[str, int, list[_Property]]] = []
    for words in (line.split() for line in lines[1:end]):
        if words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1][2].append((words[-1], words[1] == "list"))
    _require_lines([line for line in lines[end + 1 :] if line.strip()], [(n, kinds) for _, n, kinds in elements])
    counts = {name: n for name, n, _ in elements}
    return counts.get("vertex", 0), counts.get("face", 0)


def _off_counts(lines: list[str]) -> tuple[int, int]:
    bare = [text for line in lines if (text := line.split("#")[0].strip())]
    if bare and bare[0].upper() in ("OFF", "COFF"):
        bare = bare[1:]
    elif bare:
        bare[0] = bare[0].upper().removeprefix("C").removeprefix("OFF")
    n_vertices, n_faces = (int(word) for word in bare[0].split()[:2])
    _require_lines(bare[1:], [(n_vertices, [(axis, False) for axis in "xyz"]), (n_faces, [("corners", True)])])
    return n_vertices, n_faces


def _require_lines(lines: list[str], elements: list[tuple[int, list[_Property]]]) -> None:
    declared = sum(n for n, _ in elements)
    if min((n for n, _ in elements), default=0) < 0 or len(lines) < declared:
        raise ValueError(f"it declares {declared} lines of data and has {len(lines)}: it is cut short")
    if not declared:
        return
    properties = [kinds for n, kinds in elements if n][-1]
    words, needed = lines[declared - 1].split(), 0
    for _, is_list in properties:
        needed += 1 + (int(float(words[needed])) if is_list and needed < len(words) else 0)
    if len(words) < needed:
        raise ValueError(
            f"its last line is {lines[declared - 1]!r}, of which {needed} numbers are needed: it is cut short"
        )
