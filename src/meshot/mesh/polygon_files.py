"""Readers of PLY, OBJ, OFF and STL: the vertices and polygons of a file as they stand in it, in their order.

Each reader takes the whole content and raises a ``ValueError`` without the name of the file.
"""

import dataclasses
import re
from collections.abc import Iterable, Sequence

import numpy as np

from meshot.types import Array

#: Slicer's note of the space in a comment or title: https://github.com/Slicer/SlicerGitSVNArchive/pull/1309
_SPACE = re.compile(rb"SPACE\s*=\s*(LPS|RAS)\b")
#: Both of ITK's and of DICOM's axes that differ from RAS.
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclasses.dataclass
class Stored:
    """What a mesh file holds, before its polygons are triangles and its vertices in scanner RAS."""

    vertices: Array
    #: An array with a row for each face, or a list of faces with different numbers of corners.
    polygons: Array | list[list[int]]
    format: str
    #: From the stored coordinates to scanner RAS.
    to_scanner: Array | None = None
    space: str = "not said by the file; taken as scanner RAS, in mm"
    said_by: str = "no field"
    faults: list[str] = dataclasses.field(default_factory=list)
    not_read: list[str] = dataclasses.field(default_factory=list)
    #: Numbers of every vertex by name, such as thickness or colours.
    vertex_data: dict[str, Array] = dataclasses.field(default_factory=dict)

    def heed_space(self, text: bytes) -> "Stored":
        """Take the space from the comments or the title of the file, if they state one."""
        found = set(_SPACE.findall(text))
        if len(found) > 1:
            raise ValueError("its comments say SPACE=LPS and SPACE=RAS: keep the right one")
        if found:
            name = found.pop().decode()
            self.space = "scanner RAS, in mm"
            self.said_by = f"SPACE={name} in its comments" + (": x and y were negated" if name == "LPS" else "")
            self.to_scanner = LPS if name == "LPS" else None
        return self


# PLY: http://paulbourke.net/dataformats/ply/

_PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_CORNERS = ("vertex_indices", "vertex_index")
_PLY_FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclasses.dataclass
class _Element:
    name: str
    n_rows: int
    #: Name, type of the values, and type of their number (None for a single value).
    properties: list[tuple[str, str, str | None]]


def read_ply(content: bytes) -> Stored:
    """A PLY file: text or binary, of either byte order, with any properties."""
    head, order, elements, body = _ply_header(content)
    read = _ply_text if order == "" else _ply_binary
    columns, n_left = read(body, elements, order)
    vertex, face = columns.get("vertex", {}), columns.get("face", {})
    if not {"x", "y", "z"} <= vertex.keys():
        raise ValueError("its header declares no vertices with the properties x, y and z")
    corners = next((name for name in _CORNERS if name in face), None)
    stored = Stored(
        np.stack([np.asarray(vertex[axis], np.float64) for axis in "xyz"], axis=1),
        face[corners] if corners else [],
        f"PLY, {'text' if order == '' else 'binary, ' + ('little' if order == '<' else 'big') + ' endian'}",
    ).heed_space(b"\n".join(line for line in head.splitlines() if line.startswith((b"comment", b"obj_info"))))
    used = {"vertex": {"x", "y", "z"}, "face": {corners}}
    for name, kind, count in next(element.properties for element in elements if element.name == "vertex"):
        if name in (*"xyz", *NORMALS) or count is not None:
            continue
        values = numbers(vertex[name], f"the property {name}") if isinstance(vertex[name], list) else vertex[name]
        with np.errstate(invalid="ignore"):
            typed = values.astype(kind)
        # A text may hold numbers beyond the type that it declares.
        exact = kind[0] == "f" or np.array_equal(typed, values)
        stored.vertex_data[name] = typed if exact else np.asarray(values, np.float64)
        used["vertex"].add(name)
    for element in elements:
        names = [name for name, _, _ in element.properties if name not in used.get(element.name, ())]
        if names and element.n_rows:
            stored.not_read.append(f"properties of each {element.name}: {', '.join(names)}")
    stored.not_read += [
        f"texture {name.decode('utf-8', 'replace')}" for name in re.findall(rb"TextureFile\s+(.+)", head)
    ]
    if n_left:
        stored.faults.append(f"{n_left} {'words' if order == '' else 'bytes'} follow the data that its header declares")
    return stored


def _ply_header(content: bytes) -> tuple[bytes, str, list[_Element], bytes]:
    place = content.find(b"end_header")
    if not content.startswith(b"ply") or place < 0:
        raise ValueError("its header does not begin with ply, or does not end with end_header")
    head, rest = content[:place], content[place + len(b"end_header") :]
    # The data begin after one line break, which a byte of the data may follow that looks like another.
    rest = rest.lstrip(b" \t")
    rest = rest[2:] if rest.startswith(b"\r\n") else rest[1:]
    order, elements = None, []
    for words in (line.decode("utf-8", "replace").split() for line in head.splitlines()):
        if words[:1] == ["format"]:
            order = _PLY_FORMATS.get(words[1] if len(words) > 1 else "")
        elif words[:1] == ["element"] and len(words) == 3 and words[2].isdigit():
            elements.append(_Element(words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            kinds = words[2:4] if words[1:2] == ["list"] else words[1:2]
            if len(words) != len(kinds) + (3 if len(kinds) == 2 else 2) or not all(k in _PLY_TYPES for k in kinds):
                raise ValueError(f"a line of its header is {' '.join(words)!r}; a type of PLY and a name are needed")
            types = [_PLY_TYPES[kind] for kind in kinds]
            elements[-1].properties.append((words[-1], types[-1], types[0] if len(types) == 2 else None))
        elif words and words[0] not in ("ply", "comment", "obj_info"):
            raise ValueError(f"a line of its header is {' '.join(words)!r}; format, element or property is needed")
    if order is None:
        raise ValueError("its header names no format: ascii, binary_little_endian or binary_big_endian is needed")
    return head, order, elements, rest


def _ply_text(body: bytes, elements: list[_Element], order: str) -> tuple[dict[str, dict], int]:
    words, place, columns = body.split(), 0, {}
    for element in elements:
        lists = [kind is not None for _, _, kind in element.properties]
        if element.n_rows * len(lists) > len(words) - place:
            raise _cut_short(element, len(words) - place, "words")
        width = _steady(words, place, element, lists)
        if width is not None:
            end = place + element.n_rows * width
            table = numbers(words[place:end], f"an element {element.name}").reshape(element.n_rows, width)
            columns[element.name], at = {}, 0
            for (name, _, _), is_list in zip(element.properties, lists, strict=True):
                n = int(table[0, at]) if is_list and element.n_rows else int(not is_list)
                columns[element.name][name] = _indices(table[:, at + 1 : at + 1 + n]) if is_list else table[:, at]
                at += n + is_list
            place = end
            continue
        rows: dict[str, list] = {name: [] for name, _, _ in element.properties}
        for _ in range(element.n_rows):
            for (name, _, _), is_list in zip(element.properties, lists, strict=True):
                n = _count(words[place : place + 1], element, len(words) - place) if is_list else 1
                place += is_list
                if place + n > len(words):
                    raise _cut_short(element, len(words), "words")
                rows[name].append(words[place : place + n] if is_list else words[place])
                place += n
        for name in rows:
            if name in _CORNERS:
                rows[name] = [[_index(word) for word in row] for row in rows[name]]
            elif name in "xyz":
                rows[name] = numbers(rows[name], "a vertex")
        columns[element.name] = rows
    return columns, len(words) - place


def _steady(words: list[bytes], start: int, element: _Element, lists: list[bool]) -> int | None:
    """The number of words in a row, if all lists are as long as those of the first row."""
    if not element.n_rows:
        return len(lists)
    at, places = start, []
    for is_list in lists:
        if is_list:
            places.append(at - start)
            at += _count(words[at : at + 1], element, len(words) - at)
        at += 1
    width = at - start
    if start + element.n_rows * width > len(words):
        return None
    end = start + element.n_rows * width
    return width if all(len(set(words[start + at : end : width])) == 1 for at in places) else None


def _ply_binary(body: bytes, elements: list[_Element], order: str) -> tuple[dict[str, dict], int]:
    place, columns = 0, {}
    for element in elements:
        least = sum(np.dtype(count or kind).itemsize for _, kind, count in element.properties)
        if element.n_rows * least > len(body) - place:
            raise _cut_short(element, len(body) - place, "bytes")
        columns[element.name] = {}
        if not element.n_rows or not element.properties:
            columns[element.name] = {name: np.empty((0, 3), np.int64) for name, _, _ in element.properties}
            continue
        # First as if all rows were as long as the first one; this holds for triangles.
        fields, at = [], place
        for k, (_, kind, count) in enumerate(element.properties):
            n = 1
            if count is not None:
                n = _binary_count(body, at, order + count, element)
                fields.append((f"count{k}", order + count))
                at += np.dtype(count).itemsize
            fields.append((f"value{k}", order + kind, (n,) if count is not None else ()))
            at += n * np.dtype(kind).itemsize
        row = np.dtype(fields)
        if place + element.n_rows * row.itemsize <= len(body):
            table = np.frombuffer(body, row, element.n_rows, place)
            if all((table[name] == table[name][0]).all() for name in row.names if name.startswith("count")):
                for k, (name, _, count) in enumerate(element.properties):
                    values = table[f"value{k}"]
                    columns[element.name][name] = values if count is None else _indices(values)
                place += element.n_rows * row.itemsize
                continue
        rows: dict[str, list] = {name: [] for name, _, _ in element.properties}
        types = [
            (name, np.dtype(order + kind), order + count if count else None) for name, kind, count in element.properties
        ]
        for _ in range(element.n_rows):
            for name, kind, count in types:
                n = 1
                if count is not None:
                    n = _binary_count(body, place, count, element)
                    place += np.dtype(count).itemsize
                if place + n * kind.itemsize > len(body):
                    raise _cut_short(element, len(body), "bytes")
                values = np.frombuffer(body, kind, n, place)
                rows[name].append(values.tolist() if count is not None else values[0])
                place += n * kind.itemsize
        columns[element.name] = rows
    return columns, len(body[place:].strip(b"\0 \t\r\n"))


def _binary_count(body: bytes, place: int, kind: str, element: _Element) -> int:
    if place + np.dtype(kind).itemsize > len(body):
        raise _cut_short(element, len(body), "bytes")
    n = int(np.frombuffer(body, kind, 1, place)[0])
    if not 0 <= n <= len(body) - place:
        raise ValueError(f"a list of an element {element.name} has {n} entries, and {len(body) - place} bytes are left")
    return n


def _count(words: list[bytes], element: _Element, n_left: int) -> int:
    n = _index(words[0]) if words else -1
    if not 0 <= n < max(n_left, 1):
        raise _cut_short(element, n_left, "words")
    return n


def _cut_short(element: _Element, n_left: int, unit: str) -> ValueError:
    return ValueError(
        f"it declares {element.n_rows} elements {element.name}, and has {n_left} {unit} for them: it is cut short"
    )


# OBJ: http://paulbourke.net/dataformats/obj/

_OBJ_IGNORED = {
    "vt": "texture coordinates", "vn": "normals", "l": "lines", "p": "points", "usemtl": "materials",
    "mtllib": "materials", "o": "names of objects", "g": "names of groups", "vp": "points of curves",
    "curv": "curves", "curv2": "curves", "surf": "curved surfaces",
}  # fmt: skip


def read_obj(content: bytes) -> Stored:
    """An OBJ file. Texture coordinates, normals, groups and materials do not divide vertices."""
    text = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    comments = b"\n".join(re.findall(rb"#(.*)", text))
    lines = re.sub(rb"#.*", b"", text).split(b"\n")
    kinds = [(line.split(None, 1) or [b""])[0] for line in lines]
    vertex_lines = [k for k, kind in enumerate(kinds) if kind == b"v"]
    face_lines = [k for k, kind in enumerate(kinds) if kind in (b"f", b"fo")]
    places, words, widths, sizes = [], [], [], []
    for found, lengths, chosen in ((places, widths, vertex_lines), (words, sizes, face_lines)):
        for k in chosen:
            row = lines[k].split()[1:]
            lengths.append(len(row))
            found += row[:3] if chosen is vertex_lines else row
    short = next((k for k, width in zip(vertex_lines, widths, strict=True) if width < 3), None)
    if short is not None:
        line = lines[short].strip().decode("utf-8", "replace")
        raise ValueError(f"line {short + 1} is {line!r}; three numbers are needed after v")
    vertices = numbers(places, "a vertex").reshape(-1, 3)
    try:
        indices = [word.partition(b"/")[0] for word in words] if b"/" in text else words
        corners = np.array(list(map(int, indices)), np.int64)
    except (ValueError, OverflowError):
        whole = [re.match(rb"[+-]?\d{1,18}(?=/|\Z)", word) for word in words]
        corners = np.array([int(found[0]) if found else 0 for found in whole], np.int64)
    owners = np.repeat(np.array(face_lines, np.int64), sizes)
    for k in np.flatnonzero(corners == 0)[:1]:
        word = words[k].decode("utf-8", "replace")
        raise ValueError(
            f"line {owners[k] + 1} has the corner {word!r}; a number other than 0 is needed, and / behind it"
        )
    above = np.searchsorted(vertex_lines, owners)  # negative numbers count back from the last of these
    for k in np.flatnonzero(corners < -above)[:1]:
        raise ValueError(f"line {owners[k] + 1} counts {-corners[k]} vertices back, and {above[k]} stand above it")
    corners = np.where(corners > 0, corners - 1, above + corners)
    for k in np.flatnonzero(corners >= len(vertices))[:1]:
        raise ValueError(f"line {owners[k] + 1} names vertex {corners[k] + 1}, and there are {len(vertices)}")
    if len(set(sizes)) == 1:
        polygons = corners.reshape(len(sizes), -1)
    else:
        polygons = [part.tolist() for part in np.split(corners, np.cumsum(sizes)[:-1])] if sizes else []
    names = [kind.decode("utf-8", "replace") for kind in dict.fromkeys(kinds)]
    seen = dict.fromkeys(_OBJ_IGNORED[name] for name in names if name in _OBJ_IGNORED)
    if max(widths, default=0) > 5:
        seen["colours of vertices"] = None
    return Stored(vertices, polygons, "OBJ", not_read=list(seen)).heed_space(comments)


# OFF: http://www.geomview.org/docs/html/OFF.html

OFF_HEAD = re.compile(r"((?:ST|[CN4n])*)OFF(\s+BINARY)?", re.IGNORECASE)


def read_off(content: bytes) -> Stored:
    """An OFF file, with any head: OFF, COFF, NOFF, STOFF and their combinations, in small letters or none."""
    text = content.decode("utf-8", "replace")
    lines = [bare for line in text.splitlines() if (bare := line.split("#")[0].strip())]
    found = OFF_HEAD.match(lines[0]) if lines else None
    prefix = found[1] if found else ""
    n_axes_follow = "n" in prefix and found[0] != found[0].lower()  # nOFF, but not noff
    if found and ("4" in prefix or n_axes_follow):
        raise ValueError(f"its head is {found[0]!r}; OFF with three coordinates is read: save it so")
    if found and found[2]:
        return _off_binary(content, prefix.upper())
    if found:
        lines[0] = lines[0][found.end() :].strip()
        lines = lines if lines[0] else lines[1:]
    counts = lines[0].split() if lines else []
    if len(counts) < 2 or not all(word.isdigit() for word in counts):
        raise ValueError(f"the numbers of vertices and faces are needed, and {' '.join(counts)[:60]!r} stands there")
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    rows = lines[1:]
    if len(rows) < n_vertices + n_faces:
        raise ValueError(
            f"it declares {n_vertices} vertices and {n_faces} faces, a line each, and has {len(rows)}: it is cut short"
        )
    split = [line.split() for line in rows[: n_vertices + n_faces]]
    short = next((k for k, words in enumerate(split[:n_vertices]) if len(words) < 3), None)
    if short is not None:
        raise ValueError(f"a vertex is {rows[short]!r}, of which 3 numbers are needed: it is cut short")
    polygons, colours = [], False
    for line, words in zip(rows[n_vertices:], split[n_vertices:], strict=False):
        n = _index(words[0])
        if n < 0 or len(words) < n + 1:
            raise ValueError(f"a face is {line!r}, of which {max(n, 0) + 1} numbers are needed: it is cut short")
        polygons.append([_index(word) for word in words[1 : n + 1]])
        colours |= len(words) > n + 1
    flat = [word for words in split[:n_vertices] for word in words[:3]]
    stored = Stored(numbers(flat, "a vertex").reshape(-1, 3), polygons, f"OFF ({prefix.upper()}OFF)")
    stored.not_read += ["colours of faces"] * colours
    if any(len(words) > 3 for words in split[:n_vertices]):
        names = {"ST": "texture coordinates", "C": "colours", "N": "normals"}
        said = [name for key, name in names.items() if key in prefix.upper()]
        stored.not_read.append(f"{' and '.join(said) or 'further numbers'} of vertices")
    if len(rows) > n_vertices + n_faces:
        n_more = len(rows) - n_vertices - n_faces
        stored.faults.append(f"{n_more} lines follow the faces that its head declares")
    return stored.heed_space(b"\n".join(re.findall(rb"#(.*)", content)))


def _off_binary(content: bytes, prefix: str) -> Stored:
    """An OFF file whose numbers, behind the line of its head, are big-endian of 32 bits each."""
    body = content[content.index(b"\n", content.upper().index(b"BINARY")) + 1 :]
    body = body[: len(body) // 4 * 4]
    integers, floats = np.frombuffer(body, ">i4"), np.frombuffer(body, ">f4")
    n_vertices, n_faces = integers[:2].tolist() if len(integers) > 2 else (-1, -1)
    width = 3 + 3 * ("N" in prefix) + 4 * ("C" in prefix) + 2 * ("ST" in prefix)
    place = 3 + n_vertices * width
    if min(n_vertices, n_faces) < 0 or place + 2 * n_faces > len(integers):
        raise ValueError(
            f"it declares {n_vertices} vertices and {n_faces} faces, and has {len(content)} bytes: it is cut short, or "
            "its numbers are not big-endian"
        )
    stored = Stored(floats[3:place].reshape(-1, width)[:, :3].astype(np.float64), [], f"OFF ({prefix}OFF), binary")
    # Each face is the number of its corners, these, the number of parts of its colour, and these.
    polygons, coloured = [], False
    for _ in range(n_faces):
        n = int(integers[place]) if place < len(integers) else -1
        end = place + n + 2
        n_parts = int(integers[end - 1]) if n >= 0 and end <= len(integers) else -1
        if n_parts < 0 or end + n_parts > len(integers):
            raise ValueError(f"face {len(polygons)} of the {n_faces} that it declares is cut short")
        polygons.append(integers[place + 1 : end - 1].tolist())
        coloured |= n_parts > 0
        place = end + n_parts
    stored.polygons = polygons
    stored.not_read += ["colours of faces"] * coloured
    stored.not_read += ["colours, normals or texture coordinates of vertices"] * (width > 3)
    if place < len(integers):
        stored.faults.append(f"{4 * (len(integers) - place)} bytes follow the faces that its head declares")
    return stored


# STL: http://www.fabbers.com/tech/STL_Format

_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
#: What writers put into the number of triangles that they do not know yet.
_STL_UNKNOWN = (0, 2**32 - 1)


def read_stl(content: bytes) -> Stored:
    """An STL file, text or binary. Corners at the same position become one vertex, in the order of the file."""
    declared = int.from_bytes(content[80:84], "little") if len(content) >= 84 else 0
    n_rows, n_left = divmod(max(len(content) - 84, 0), _STL_ROW.itemsize)
    says_text = content.lstrip()[:5].lower() == b"solid" and re.search(rb"^\s*(facet|endsolid)\b", content, re.M | re.I)
    faults, not_read = [], []
    if says_text and not (declared == n_rows > 0 and n_left == 0):
        corners, kind = _stl_text(content), "STL, text"
        head = content.lstrip().split(b"\n", 1)[0]
    else:
        if len(content) < 84 or (declared > n_rows and declared not in _STL_UNKNOWN):
            raise ValueError(
                f"it declares {declared} triangles of 50 bytes, and has {max(len(content) - 84, 0)} bytes: it is cut "
                "short"
            )
        if declared in _STL_UNKNOWN and n_rows:
            if n_left:
                raise ValueError(f"it declares {declared} triangles, and {n_left} bytes are left over: it is cut short")
            faults.append(
                f"its header declares {declared} triangles, and its length is that of {n_rows}: they are read"
            )
            declared = n_rows
        table = np.frombuffer(content, _STL_ROW, declared, 84)
        if content[84 + declared * 50 :].strip(b"\0 \t\r\n"):
            # Some writers put as many bytes behind each triangle as its attribute says.
            places, at = [], 84
            while len(places) < declared and at + 50 <= len(content):
                places.append(at)
                at += 50 + int.from_bytes(content[at + 48 : at + 50], "little")
            if len(places) == declared and at == len(content):
                table = np.concatenate([np.frombuffer(content, _STL_ROW, 1, place) for place in places])
                not_read.append("bytes behind each triangle")
            else:
                n_more = len(content) - 84 - declared * 50
                faults.append(f"{n_more} bytes follow the triangles that its header declares")
        elif table["attribute"].any():
            not_read.append("attributes (colours) of triangles")
        corners, kind, head = table["corners"].astype(np.float64).reshape(-1, 3), "STL, binary", content[:80]
    vertices, faces = merged(corners, np.arange(len(corners)).reshape(-1, 3))
    return Stored(vertices, faces, kind, faults=faults, not_read=not_read).heed_space(head)


def _stl_text(content: bytes) -> Array:
    lines = [line.split() for line in content.decode("utf-8", "replace").splitlines()]
    kinds = [words[0].lower() for words in lines if words]
    if "endsolid" not in kinds[-3:]:
        raise ValueError("it does not end with endsolid: it is cut short")
    rows = [words[1:] for words in lines if words and words[0].lower() == "vertex"]
    n_facets = kinds.count("facet")
    if len(rows) != 3 * n_facets or any(len(words) < 3 for words in rows):
        raise ValueError(f"it has {n_facets} facets and {len(rows)} vertices; three are needed for each, of 3 numbers")
    return numbers([word for words in rows for word in words[:3]], "a vertex").reshape(-1, 3)


# What readers share.

#: Names of normals of vertices. They are not read: they follow from the surface, and change with it.
NORMALS = ("nx", "ny", "nz", "normals")


def merged(vertices: Array, faces: Array) -> tuple[Array, Array]:
    """The same surface with one vertex for each position, in the order in which positions first appear."""
    _, first, places = np.unique(vertices + 0.0, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return vertices[first[order]], rank[places.reshape(-1)][faces]


def numbers(words: Sequence[str | bytes], owner: str) -> Array:
    """Words as float64."""
    try:
        return np.array(words, dtype=np.float64) if len(words) else np.empty(0)
    except ValueError:
        wrong = next(word for word in words if not _is_number(word))
        text = wrong.decode("utf-8", "replace") if isinstance(wrong, bytes) else wrong
        remedy = ": a decimal point is needed in place of the comma" if re.fullmatch(r"-?\d+,\d+", text) else ""
        raise ValueError(f"{text[:60]!r} stands where a number of {owner} is needed{remedy}") from None


def _is_number(word: str | bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _index(word: str | bytes) -> int:
    try:
        return int(word)
    except ValueError:
        value = numbers([word], "a face")[0]
    if not value.is_integer():
        text = word.decode() if isinstance(word, bytes) else word
        raise ValueError(f"{text!r} stands where the index of a vertex is needed, which is not whole")
    return int(value)


def _indices(values: Array) -> Array:
    """Whole numbers as int64. Lists of other numbers, such as texture coordinates, stay as they are."""
    if values.dtype.kind in "iu":
        return values.astype(np.int64)
    whole = np.isfinite(values).all() and (values == np.rint(values)).all()
    return values.astype(np.int64) if whole and (np.abs(values) < 2**53).all() else values


def without_repeats(polygons: Iterable[Sequence[int]]) -> list[list[int]]:
    """Polygons without corners that follow themselves: a quad with a repeated corner is a triangle."""
    return [[b for a, b in zip([p[-1], *p[:-1]], p, strict=True) if a != b] if len(p) else [] for p in polygons]
