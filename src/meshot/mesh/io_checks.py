"""Checks of mesh files before their content is used: complete data, and sizes below a limit."""

import math
import xml.parsers.expat
import zlib
from base64 import b64decode

from meshot.types import Array

#: Maximum size of a compressed file, or of one compressed array in it, after decompression, in bytes.
LARGEST_BYTES = 1 << 27
_TRIANGLES, _QUADS = (b"\xff\xff\xfe",), (b"\xff\xff\xff", b"\xff\xff\xfd")
_Property = tuple[str, bool]  # name, and whether it is a list


def require_whole_text(content: bytes, kind: str) -> tuple[int, int] | None:
    """The numbers of vertices and faces that an ASCII PLY or OFF file declares; None for other files.

    Raises
    ------
    ValueError
        If the file has fewer lines than declared, its last line is incomplete, or an ASCII STL has no end.
    """
    if kind == "stl" and content.lstrip()[:5].lower() == b"solid" and b"facet" in content[:1024]:
        if b"endsolid" not in content[-1024:].lower():
            raise ValueError("it does not end with endsolid: it is cut short")
        return None
    if kind not in ("ply", "off") or (kind == "ply" and b"ascii" not in content[: content.find(b"end_header")]):
        return None
    lines = content.decode("utf-8", errors="replace").splitlines()
    return _ply_counts(lines) if kind == "ply" else _off_counts(lines)


def require_all_read(declared: tuple[int, int] | None, vertices: Array, faces: Array) -> None:
    """Check that a file has the declared number of vertices, and at least one triangle for every declared face.

    Raises
    ------
    ValueError
        If some are missing.
    """
    if declared is not None and (len(vertices) != declared[0] or len(faces) < declared[1]):
        raise ValueError(
            f"it declares {declared[0]} vertices and {declared[1]} faces; {len(vertices)} and {len(faces)} are in it"
        )


def require_room_in_freesurfer(content: bytes) -> None:
    """Check that a FreeSurfer surface file is long enough for the vertices and faces it declares.

    Raises
    ------
    ValueError
        If it is not.
    """
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
    """Check that every array of a GIfTI file is as long as declared, and below the maximum size after decompression.

    Raises
    ------
    ValueError
        If one is not, or the file is not XML.
    """
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
        held = _unpacked_length(text) if self.packed else len(text)
        if self.n_values > held:
            raise ValueError(f"an array declares {self.n_values} values, but holds {held} bytes")


def _unpacked_length(text: str) -> int:
    stream = zlib.decompressobj()
    length = len(stream.decompress(b64decode(text), LARGEST_BYTES + 1))
    if length > LARGEST_BYTES:
        raise ValueError(f"an array holds more than {LARGEST_BYTES >> 20} MiB unpacked; at most so much is read")
    if not stream.eof:
        raise ValueError("a compressed array is cut short")
    return length


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
