"""Readers of the files of cortical surfaces, GIfTI and FreeSurfer's own, which state the space of their coordinates.

Both state it in more than one place. The readers look at all of them, and say which one they followed.
"""

import binascii
import itertools
import math
import re
import xml.parsers.expat
import zlib
from base64 import b64decode
from pathlib import Path

import numpy as np

from meshot.mesh.polygon_files import NORMALS, Stored, numbers
from meshot.types import Array, Float

#: Maximum size of a compressed file, or of one compressed array in it, after decompression, in bytes.
LARGEST_BYTES = 1 << 27
# Columns: the directions of the first, second and third voxel axis in FreeSurfer's surface RAS ("tkregister") space.
SURFACE_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
_SCANNER = "scanner RAS, in mm"
_APART_MM = 1e-2


def _to_scanner(axes: Float[Array, "3 3"], c_ras: Float[Array, " 3"]) -> Float[Array, "4 4"]:
    """From FreeSurfer's surface RAS to scanner RAS. The columns of ``axes`` are the directions of the voxel axes."""
    # The rotation is the identity for a volume in FreeSurfer's standard orientation, and a reflection for one of
    # opposite handedness.
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = axes @ SURFACE_AXES.T, c_ras
    return matrix


# FreeSurfer: https://surfer.nmr.mgh.harvard.edu/fswiki/FileFormats, and mrisurf_io.cpp in its source

_TRIANGLES, _QUADS = b"\xff\xff\xfe", {b"\xff\xff\xff": ">i2", b"\xff\xff\xfd": ">f4"}
_USES_SCANNER, _GEOMETRY = 2, 20  # tags behind the faces


def read_freesurfer(content: bytes, c_ras: tuple[float, float, float] | None) -> Stored:
    """A surface of FreeSurfer, of triangles or in one of the two older formats of quadrangles."""
    if content[:3] == _TRIANGLES:
        stored, rest = _freesurfer_triangles(content)
    elif content[:3] in _QUADS:
        stored, rest = _freesurfer_quads(content)
    else:
        raise ValueError("it does not begin as a surface of FreeSurfer does: is it a label, an annotation or a volume?")
    uses_scanner = False
    if rest[:4] == _USES_SCANNER.to_bytes(4, "big"):
        uses_scanner, rest = int.from_bytes(rest[4:8], "big") == 1, rest[8:]
    said = {}
    if rest[:4] == _GEOMETRY.to_bytes(4, "big"):
        pattern = rb"^(valid|volume|voxelsize|xras|yras|zras|cras) *= *([^\n]*)$"
        said = {key.decode(): value.split() for key, value in re.findall(pattern, rest[4:], re.M)}
    known = said.get("valid", [b"1"])[:1] == [b"1"] and all(f"{key}ras" in said for key in "xyzc")
    given = None if c_ras is None else np.asarray(c_ras, dtype=np.float64)
    if given is not None and (given.shape != (3,) or not np.isfinite(given).all()):
        raise ValueError(f"c_ras is {c_ras!r}; three finite numbers are needed, in mm")
    if known:
        vectors = {key: numbers(said[f"{key}ras"], f"{key}ras") for key in "xyzc"}
        if any(vector.shape != (3,) or not np.isfinite(vector).all() for vector in vectors.values()):
            raise ValueError("its volume information lacks a number: xras, yras, zras and cras have three each")
        axes = np.stack([vectors[key] for key in "xyz"], axis=1)
        if abs(abs(np.linalg.det(axes)) - 1) > 1e-2:
            raise ValueError("the axes of its volume information (xras, yras, zras) are not orthogonal unit vectors")
        matrix, centre = _to_scanner(axes, vectors["c"]), vectors["c"]
    if uses_scanner:
        stored.space, stored.said_by = _SCANNER, "useRealRAS (tag 2) is 1: the coordinates are unchanged"
        return stored
    if not known and given is None:
        raise ValueError(
            "it does not specify its position in the scanner; pass c_ras, or (0, 0, 0) to keep surface RAS"
        )
    if not known:
        stored.space, stored.said_by = _SCANNER, f"c_ras as given, {_vector(given)}; the file has no volume information"
        stored.to_scanner = _to_scanner(SURFACE_AXES, given)
        return stored
    stored.space = _SCANNER
    stored.said_by = f"its volume information: surface RAS was moved by cras = {_vector(centre)}"
    if not np.allclose(matrix[:3, :3], np.eye(3), atol=1e-3):
        stored.said_by += " and turned by xras, yras, zras"
    if given is not None and np.abs(given - centre).max() > _APART_MM:
        stored.faults.append(
            f"c_ras is given as {_vector(given)}, and its volume information says {_vector(centre)}, which is used"
        )
    stored.to_scanner = matrix
    return stored


def _freesurfer_triangles(content: bytes) -> tuple[Stored, bytes]:
    # One line of text, and an empty one, which some programs leave out; others write two lines.
    first = content.find(b"\n", 3) + 1
    starts = [first + 1 if content[first : first + 1] == b"\n" else first, content.find(b"\n", first) + 1]
    n_vertices = n_faces = 0
    for start in starts:
        n_vertices, n_faces = np.frombuffer(content[start : start + 8].ljust(8, b"\0"), ">i4").tolist()
        end = start + 8 + 12 * (n_vertices + n_faces)
        if first > 0 and start > 0 and min(n_vertices, n_faces) > 0 and end <= len(content):
            vertices = np.frombuffer(content, ">f4", 3 * n_vertices, start + 8).reshape(-1, 3)
            faces = np.frombuffer(content, ">i4", 3 * n_faces, start + 8 + 12 * n_vertices).reshape(-1, 3)
            return Stored(vertices.astype(np.float64), faces.astype(np.int64), "FreeSurfer, triangles"), content[end:]
    n_vertices, n_faces = np.frombuffer(content[starts[0] : starts[0] + 8].ljust(8, b"\0"), ">i4").tolist()
    raise ValueError(f"it declares {n_vertices} vertices and {n_faces} faces, but has {len(content)} bytes")


def _freesurfer_quads(content: bytes) -> tuple[Stored, bytes]:
    n_values = int.from_bytes(content[3:7], "big")
    if len(content) == 15 + 4 * n_values and content[:3] == b"\xff\xff\xff":
        raise ValueError(f"it holds a number for each of {n_values} vertices, such as curvature, and no surface")
    n_vertices, n_faces = (int.from_bytes(content[k : k + 3], "big") for k in (3, 6))
    kind = np.dtype(_QUADS[content[:3]])
    start = 9 + 3 * kind.itemsize * n_vertices
    end = start + 12 * n_faces
    if min(n_vertices, n_faces) < 1 or end > len(content):
        raise ValueError(f"it declares {n_vertices} vertices and {n_faces} faces, but has {len(content)} bytes")
    vertices = np.frombuffer(content, kind, 3 * n_vertices, 9).reshape(-1, 3).astype(np.float64)
    parts = np.frombuffer(content, np.uint8, 12 * n_faces, start).reshape(-1, 4, 3).astype(np.int64)
    a, b, c, d = (parts @ np.array([1 << 16, 1 << 8, 1])).T
    # FreeSurfer's rule: the diagonal alternates with the first corner.
    even = (a % 2 == 0)[:, None]
    faces = np.concatenate(
        [
            np.where(even, np.stack([a, b, d], 1), np.stack([a, b, c], 1))[:, None],
            np.where(even, np.stack([c, d, b], 1), np.stack([a, c, d], 1))[:, None],
        ],
        axis=1,
    ).reshape(-1, 3)
    return Stored(vertices / (100 if kind.kind == "i" else 1), faces, "FreeSurfer, quadrangles"), content[end:]


def _vector(values: Array) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"


# GIfTI: https://www.nitrc.org/projects/gifti, version 1.0

_GIFTI_TYPES = {f"NIFTI_TYPE_{kind.upper()}": kind for kind in (
    "uint8", "int8", "uint16", "int16", "uint32", "int32", "uint64", "int64", "float32", "float64",
)}  # fmt: skip
_GIFTI_CODES = {"0": "UNKNOWN", "1": "SCANNER_ANAT", "2": "ALIGNED_ANAT", "3": "TALAIRACH", "4": "MNI_152"}


class _GiftiParser:
    """Handlers of the XML parser: the data arrays with their attributes, metadata, coordinate systems and text."""

    def __init__(self, content: bytes):
        self.arrays: list[dict] = []
        self._names: list[str] = []
        self._text: list[str] = []
        self._key = ""
        parser = xml.parsers.expat.ParserCreate()
        parser.buffer_text = True
        parser.StartElementHandler, parser.EndElementHandler = self._start, self._end
        parser.CharacterDataHandler, parser.EntityDeclHandler = self._text_part, self._entity
        try:
            parser.Parse(content, True)
        except xml.parsers.expat.ExpatError as error:
            raise ValueError(f"it is no whole XML: {error}") from error

    def _entity(self, *_: object) -> None:
        raise ValueError("it defines entities of XML, which a surface does not need")

    def _text_part(self, text: str) -> None:
        self._text.append(text)

    def _start(self, name: str, given: dict[str, str]) -> None:
        self._names.append(name)
        self._text = []
        if name == "DataArray":
            self.arrays.append({"given": given, "meta": {}, "systems": [], "data": ""})
        elif name == "CoordinateSystemTransformMatrix" and self.arrays:
            self.arrays[-1]["systems"].append({})

    def _end(self, name: str) -> None:
        self._names.pop()
        text, self._text = "".join(self._text), []
        if "DataArray" not in self._names:
            return
        array = self.arrays[-1]
        if name == "Name":
            self._key = text.strip()
        elif name == "Value":
            array["meta"][self._key] = text.strip()
        elif name in ("DataSpace", "TransformedSpace", "MatrixData") and array["systems"]:
            array["systems"][-1][name] = text.strip()
        elif name == "Data":
            array["data"] = text


def read_gifti(content: bytes, folder: Path) -> Stored:
    """A GIfTI surface: its set of points and its set of triangles. Arrays may stand in a file of the same folder."""
    arrays = _GiftiParser(content).arrays
    found = {}
    for intent in ("POINTSET", "TRIANGLE"):
        found[intent] = [array for array in arrays if array["given"].get("Intent") == f"NIFTI_INTENT_{intent}"]
    if not len(found["POINTSET"]) == len(found["TRIANGLE"]) == 1:
        raise ValueError(
            f"it holds {len(found['POINTSET'])} point sets and {len(found['TRIANGLE'])} triangle sets; one of each is "
            "needed"
        )
    (points,), (triangles,) = found["POINTSET"], found["TRIANGLE"]
    vertices, faces = _gifti_array(points, folder).astype(np.float64), _gifti_array(triangles, folder)
    for name, array in (("points", vertices), ("triangles", faces)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise ValueError(f"its {name} have the shape {array.shape}; three columns are needed")
    if faces.dtype.kind not in "iu":
        raise ValueError(f"its triangles are {faces.dtype} numbers; integers are needed")
    stored = Stored(vertices, faces.astype(np.int64), f"GIfTI, {points['given'].get('Encoding', '')}")
    data = stored.vertex_data
    for array in arrays:
        if array is points or array is triangles:
            continue
        intent = array["given"].get("Intent", "no intent").removeprefix("NIFTI_INTENT_").lower()
        name = array["meta"].get("Name") or intent
        name = next(n for n in itertools.chain([name], (f"{name}_{k}" for k in itertools.count(2))) if n not in data)
        try:
            values = _gifti_array(array, folder)
        except ValueError as error:
            stored.not_read.append(f"an array of {intent}: {error}")
            continue
        if name.lower() in NORMALS or values.shape[:1] != (len(vertices),) or values.ndim > 2:
            stored.not_read.append(f"an array of {intent}")
        else:
            data[name] = values
        if intent == "label":
            stored.not_read.append("the names of labels")
    names = [value for key, value in points["meta"].items() if key.startswith("AnatomicalStructure")]
    stored.not_read += [f"the names {', '.join(names)}"] if names else []
    _gifti_space(points, stored)
    return stored


def _gifti_array(array: dict, folder: Path) -> Array:
    given = array["given"]
    axes = given.get("Dimensionality", "0")
    if not axes.isdigit() or not 1 <= int(axes) <= 6:
        raise ValueError(f"Dimensionality is {axes}; 1 to 6 is needed")
    texts = [given.get(f"Dim{axis}", "") for axis in range(int(axes))]
    if not all(text.isdigit() for text in texts):
        raise ValueError(f"an array has the size {texts}; sizes must be >= 0")
    shape = [int(text) for text in texts]
    if given.get("DataType") not in _GIFTI_TYPES:
        raise ValueError(f"the type of an array is {given.get('DataType')!r}; a type of NIfTI is needed")
    order = {"LittleEndian": "<", "BigEndian": ">"}.get(given.get("Endian", "LittleEndian"), "<")
    kind = np.dtype(_GIFTI_TYPES[given["DataType"]]).newbyteorder(order)
    n_values, encoding = math.prod(shape), given.get("Encoding", "ASCII")
    if encoding == "ASCII":
        values = numbers(array["data"].split(), "an array")
        held = len(values)
        if held == n_values and kind.kind in "iu":
            if not (np.isfinite(values).all() and (values == np.rint(values)).all() and (abs(values) < 2**53).all()):
                raise ValueError("an array of whole numbers holds others")
            values = values.astype(np.int64)
    else:
        if encoding == "ExternalFileBinary":
            data = _external(given, folder)
        else:
            try:
                data = b64decode("".join(array["data"].split()), validate=True)
            except (binascii.Error, ValueError):
                raise ValueError("an array is no whole text in base 64: it is cut short or damaged") from None
        data = _inflated(data) if encoding == "GZipBase64Binary" else data
        held = len(data) // kind.itemsize
        values = np.frombuffer(data, kind, n_values) if held >= n_values else None
    if held < n_values:
        raise ValueError(f"an array declares {n_values} values, but holds {held}")
    if held > n_values:
        raise ValueError(f"an array declares {n_values} values ({' × '.join(texts)}), but holds {held}")
    columns_first = given.get("ArrayIndexingOrder") == "ColumnMajorOrder"
    return values.reshape(shape, order="F" if columns_first else "C")


def _external(given: dict[str, str], folder: Path) -> bytes:
    name, offset = given.get("ExternalFileName", ""), given.get("ExternalFileOffset", "0") or "0"
    if not name or Path(name).name != name or not offset.isdigit() or not (folder / name).is_file():
        raise ValueError(f"its numbers are in the file {name!r}, which is not beside it: put it there")
    n_bytes = math.prod(int(given[f"Dim{k}"]) for k in range(int(given["Dimensionality"])))
    n_bytes *= np.dtype(_GIFTI_TYPES[given["DataType"]]).itemsize
    with (folder / name).open("rb") as file:
        file.seek(int(offset))
        return file.read(min(n_bytes, (folder / name).stat().st_size))


def _inflated(data: bytes) -> bytes:
    stream = zlib.decompressobj(wbits=47)  # of zlib, as the format asks, or of gzip
    try:
        whole = stream.decompress(data, LARGEST_BYTES + 1)
    except zlib.error:
        raise ValueError("a compressed array is damaged") from None
    if len(whole) > LARGEST_BYTES:
        raise ValueError(f"an array holds more than {LARGEST_BYTES >> 20} MiB unpacked; at most so much is read")
    if not stream.eof:
        raise ValueError("a compressed array is cut short")
    return whole


def _gifti_space(points: dict, stored: Stored) -> None:
    """Which space the points are in: by the coordinate systems, and by the fields VolGeom that FreeSurfer adds."""
    matrices, spaces = [], set()
    for system in points["systems"]:
        start, end = (
            _GIFTI_CODES.get(system.get(key, "0"), system.get(key, "").removeprefix("NIFTI_XFORM_"))
            for key in ("DataSpace", "TransformedSpace")
        )
        spaces.add(start)
        if start != "SCANNER_ANAT" and end == "SCANNER_ANAT":
            values = numbers(system.get("MatrixData", "").split(), "a matrix")
            if values.shape != (16,) or not np.isfinite(values).all():
                raise ValueError(f"a matrix of its coordinate systems has {len(values)} numbers; 16 are needed")
            matrix = values.reshape(4, 4)
            if not np.array_equal(matrix[3], [0, 0, 0, 1]) or abs(np.linalg.det(matrix[:3, :3])) < 1e-9:
                raise ValueError("a matrix of its coordinate systems is singular, or does not end in 0 0 0 1")
            matrices.append((start, matrix))
    if len(spaces) > 1:
        stored.faults.append(f"its coordinate systems start from different spaces: {', '.join(sorted(spaces))}")
    geometry = _volume_geometry(points["meta"])
    if "SCANNER_ANAT" in spaces:
        stored.space, stored.said_by = _SCANNER, "its DataSpace, scanner: the coordinates are unchanged"
        return
    name = next(iter(sorted(spaces)), "UNKNOWN")
    if matrices:
        start, matrix = matrices[0]
        stored.space, stored.to_scanner = _SCANNER, matrix
        stored.said_by = f"its TransformedSpace, scanner: the matrix from {start.lower()} was applied"
        if geometry is not None and start == "UNKNOWN" and np.abs(geometry - matrix).max() > _APART_MM:
            stored.faults.append(
                f"its matrix moves the points by {_vector(matrix[:3, 3])} to the scanner, and VolGeomC_R, _A, _S say "
                f"{_vector(geometry[:3, 3])}; the matrix is used"
            )
        return
    if geometry is not None and name == "UNKNOWN":
        stored.space, stored.to_scanner = _SCANNER, geometry
        stored.said_by = (
            f"VolGeomC_R, _A, _S: surface RAS was moved by {_vector(geometry[:3, 3])}; mris_convert up to 7.3 leaves "
            "that to the reader"
        )
        return
    if name == "UNKNOWN":
        return
    stored.space = f"{name.lower()}, in mm"
    stored.said_by = "its DataSpace: the coordinates are unchanged"
    if geometry is not None and not np.allclose(geometry, np.eye(4), atol=_APART_MM):
        stored.faults.append(
            f"its DataSpace is {name.lower()}, and VolGeomC_R, _A, _S say that surface RAS is to be moved by "
            f"{_vector(geometry[:3, 3])}: it is not; compare it with the scan"
        )


def _volume_geometry(meta: dict[str, str]) -> Float[Array, "4 4"] | None:
    """The matrix from surface RAS to the scanner, from the fields that FreeSurfer writes into the metadata."""
    try:
        centre = np.array([float(meta[f"VolGeomC_{axis}"]) for axis in "RAS"])
        keys = [[f"VolGeom{voxel}_{axis}" for voxel in "XYZ"] for axis in "RAS"]
        axes = SURFACE_AXES
        if all(key in meta for row in keys for key in row):
            axes = np.array([[float(meta[key]) for key in row] for row in keys])
    except (KeyError, ValueError):
        return None
    known = np.isfinite(centre).all() and np.isfinite(axes).all() and abs(abs(np.linalg.det(axes)) - 1) < 1e-2
    return _to_scanner(axes, centre) if known else None
