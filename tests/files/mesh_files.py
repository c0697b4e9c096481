"""Small mesh files of every format, made byte by byte, each with what it holds or why it is refused.

No reader or writer of the package takes part. The coordinates are halves, so that every format holds them exactly.
"""

import base64
import dataclasses
import gzip
import itertools
import json
import re
import struct
import zlib
from collections.abc import Iterator

import numpy as np

#: An octahedron without symmetry, with outward normals, and a vertex in the middle that no face uses.
VERTICES = np.array(
    [[12.5, 0, 1], [-3, 0, 1], [4, 7, 1], [99, 98, 97], [4, -5, 1], [4, 1, 9], [4, 1, -6]], dtype=np.float64
)
FACES = np.array([[0, 2, 5], [2, 1, 5], [1, 4, 5], [4, 0, 5], [2, 0, 6], [1, 2, 6], [4, 1, 6], [0, 4, 6]])
USED = np.array([0, 1, 2, 4, 5, 6])
#: A prism over an L, whose two ends are not convex: area 14, volume 3.
L = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=np.float64)
PRISM = np.vstack([np.c_[L, np.zeros(6)], np.c_[L, np.ones(6)]])
POLYGONS = [[8, 9, 10, 11, 6, 7], [2, 1, 0, 5, 4, 3], *([i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6))]
C_RAS = (4.5, -17.25, 31.0)


@dataclasses.dataclass(frozen=True)
class Case:
    """A file, and what a reader has to find in it.

    Parameters
    ----------
    name : str
    content : bytes
    refused : str
        A part of the refusal; empty if the file is read.
    vertices, faces : array
        What is read. Without faces, only area and volume are compared.
    fault : str
        A part of the warning.
    about : str
        A part of what the facts say: format, space, the field, or what is not read.
    beside : pairs of name and content
        Further files of the folder.
    c_ras : three numbers, optional
    """

    name: str
    content: bytes
    refused: str = ""
    vertices: np.ndarray = dataclasses.field(default_factory=lambda: VERTICES)
    faces: np.ndarray | None = dataclasses.field(default_factory=lambda: FACES)
    fault: str = ""
    about: str = ""
    beside: tuple[tuple[str, bytes], ...] = ()
    c_ras: tuple[float, float, float] | None = None


def rows(values, form="%g") -> str:
    return "".join(" ".join(form % x for x in row) + "\n" for row in values)


# PLY

_XYZ = [("float", axis) for axis in "xyz"]
_CODES = {
    "float": "f", "double": "d", "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I",
    "float32": "f", "float64": "d", "uint8": "B", "int32": "i",
}  # fmt: skip


def ply(
    form="ascii", vertex=None, columns=None, lists=None, faces=None, comments="", between="", scalars=(), newline="\n",
    vertices=VERTICES,
) -> bytes:  # fmt: skip
    """A PLY file. ``lists``: type of the number, type of the values, name and rows; ``scalars``: type, name, value."""
    order = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    vertex, columns = vertex or _XYZ, vertices if columns is None else columns
    lists = lists or [("uchar", "int", "vertex_indices", FACES if faces is None else faces)]
    n_faces = len(lists[0][3])
    head = f"ply\nformat {form} 1.0\n{comments}element vertex {len(columns)}\n"
    head += "".join(f"property {kind} {name}\n" for kind, name in vertex) + between
    head += f"element face {n_faces}\n" + "".join(f"property {kind} {name}\n" for kind, name, _ in scalars)
    head += "".join(f"property list {count} {kind} {name}\n" for count, kind, name, _ in lists) + "end_header\n"
    head = head.replace("\n", newline)
    if order is None:
        text = rows(columns)
        for k in range(n_faces):
            words = [f"{value:g}" for _, _, value in scalars]
            for _, _, _, table in lists:
                words += [f"{len(table[k])}", *(f"{x:g}" for x in table[k])]
            text += " ".join(words) + "\n"
        return (head + text.replace("\n", newline)).encode()
    whole = head.encode()
    for row in columns:
        whole += b"".join(
            struct.pack(order + _CODES[kind], x if kind in ("float", "double", "float32", "float64") else int(x))
            for (kind, _), x in zip(vertex, row, strict=True)
        )
    for k in range(n_faces):
        whole += b"".join(struct.pack(order + _CODES[kind], value) for kind, _, value in scalars)
        for count, kind, _, table in lists:
            whole += struct.pack(order + _CODES[count], len(table[k]))
            whole += b"".join(struct.pack(order + _CODES[kind], x) for x in table[k])
    return whole


def _ply_cases() -> Iterator[Case]:
    texture = [("uchar", "int", "vertex_indices", FACES), ("uchar", "float", "texcoord", np.full((8, 6), 0.5))]
    uneven = [("uchar", "float", "weights", [[0.5] * (k % 3) for k in range(8)]), texture[0]]
    reordered = [("uchar", "red"), ("double", "z"), ("float", "nx"), ("float", "y"), ("double", "x")]
    columns = np.c_[np.full(7, 9), VERTICES[:, 2], np.zeros(7), VERTICES[:, 1], VERTICES[:, 0]]
    for form, short in (("ascii", "text"), ("binary_little_endian", "little"), ("binary_big_endian", "big")):
        about = "text" if short == "text" else f"binary, {short} endian"
        yield Case(f"plain_{short}.ply", ply(form), about=about)
        yield Case(f"texture_of_faces_{short}.ply", ply(form, lists=texture), about="texcoord")
        yield Case(f"texture_before_corners_{short}.ply", ply(form, lists=texture[::-1]), about="texcoord")
        yield Case(f"lists_of_uneven_length_{short}.ply", ply(form, lists=uneven), about="weights")
        yield Case(f"reordered_properties_{short}.ply", ply(form, reordered, columns), about="data of vertices: red (")
        yield Case(
            f"flags_before_corners_{short}.ply", ply(form, scalars=[("uchar", "flags", 5), ("float", "quality", 0.5)]),
            about="flags, quality",
        )  # fmt: skip
        polygons = ply(form, faces=POLYGONS, vertices=PRISM)
        yield Case(f"polygons_{short}.ply", polygons, vertices=PRISM, faces=None, about="8 faces with more than three")
        mixed = [[0, 2, 5], [1, 4, 0, 2], [5, 4, 1]]
        both = np.array([[0, 2, 5], [1, 4, 0], [1, 0, 2], [5, 4, 1]])
        yield Case(f"triangles_and_quads_{short}.ply", ply(form, faces=mixed), faces=both)
        twice = np.vstack([FACES, [[1, 1, 2]]])
        yield Case(f"a_corner_twice_{short}.ply", ply(form, faces=twice), fault="1 faces name a vertex twice")
        quads = [[0, 0, 2, 5], *FACES[1:].tolist()]
        yield Case(f"a_quad_that_is_a_triangle_{short}.ply", ply(form, faces=quads))
        space = "comment 3D Slicer output. SPACE=LPS\n"
        yield Case(
            f"slicer_lps_{short}.ply", ply(form, comments=space), vertices=VERTICES * [-1, -1, 1], about="SPACE=LPS"
        )
        yield Case(f"slicer_ras_{short}.ply", ply(form, comments=space.replace("LPS", "RAS")), about="SPACE=RAS")
        cut = ply(form).rstrip(b"\n")
        yield Case(f"cut_short_{short}.ply", cut[:-3], refused="it is cut short")
        yield Case(f"cut_in_vertices_{short}.ply", cut[: cut.index(b"end_header") + 40], refused="it is cut short")
        yield Case(f"points_only_{short}.ply", ply(form, faces=[]), refused="7 vertices and no faces")
        yield Case(f"vertex_out_of_range_{short}.ply", ply(form, faces=[[0, 1, 7]]), refused="indices from 0 to 7")
        yield Case(f"crlf_{short}.ply", ply(form, newline="\r\n"))
        more = {"text": b"3 0 1 2\n"}.get(short, b"more")
        yield Case(f"data_behind_the_faces_{short}.ply", ply(form) + more, fault="follow the data that its header")
        nan = VERTICES.copy()
        nan[2, 1] = np.nan
        yield Case(f"not_a_number_{short}.ply", ply(form, columns=nan), refused="NaN or infinite")
    for kind in ("uint", "ushort", "short", "int", "char"):
        little = ply("binary_little_endian", lists=[(kind, "uint", "vertex_index", FACES)])
        yield Case(f"number_of_corners_as_{kind}.ply", little)
    for kind in ("uchar", "short", "ushort", "uint"):
        yield Case(f"corners_as_{kind}.ply", ply("binary_big_endian", lists=[("uchar", kind, "vertex_indices", FACES)]))
    yield Case("a_newline_behind.ply", ply("binary_little_endian") + b"\n")
    yield Case("blank_line_behind_the_header.ply", ply().replace(b"end_header\n", b"end_header\n\n"))
    head, body = ply().split(b"end_header\n")
    yield Case("all_numbers_on_one_line.ply", head + b"end_header\n" + body.replace(b"\n", b" "))
    yield Case("texture_file.ply", ply(comments="comment TextureFile brain map.png\n"), about="texture brain map.png")
    yield Case("tabs.ply", ply().replace(b" ", b"\t"))
    yield Case("an_element_without_rows.ply", ply(between="element edge 0\nproperty int vertex1\n"))
    yield Case("compressed.ply.gz", gzip.compress(ply("binary_little_endian")))
    yield Case("named_as_obj.obj", ply("binary_little_endian"), fault="its name is that of a obj file")
    yield Case("without_format.ply", ply().replace(b"format ascii 1.0\n", b""), refused="names no format")
    yield Case("a_type_of_its_own.ply", ply().replace(b"float x", b"half x"), refused="'property half x'")
    yield Case("without_z.ply", ply().replace(b"float z", b"float height"), refused="properties x, y and z")
    yield Case("without_end.ply", ply().replace(b"end_header", b"ende"), refused="end_header")
    yield Case("decimal_comma.ply", ply().replace(b"12.5", b"12,5"), refused="decimal point is needed")
    yield Case("half_a_corner.ply", ply().replace(b"3 2 1 5", b"3 2 1.5 5"), refused="not whole")
    for element in (b"vertex 7", b"face 8"):
        for form, short in (("ascii", "text"), ("binary_little_endian", "little")):
            more = ply(form).replace(element, element + b"00000000")
            yield Case(f"more_{element[:4].decode()}_than_bytes_{short}.ply", more, refused="it declares")
    both = "comment SPACE=LPS\ncomment SPACE=RAS\n"
    yield Case("two_spaces.ply", ply(comments=both), refused="SPACE=LPS and SPACE=RAS")


# OBJ

_V = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in VERTICES)


def _obj_faces(faces=FACES, form="{}") -> str:
    return "".join("f " + " ".join(form.format(i + 1) for i in face) + "\n" for face in faces)


def _obj_cases() -> Iterator[Case]:
    whole = _V + _obj_faces()
    yield Case("plain.obj", whole.encode(), about="OBJ")
    coordinates = "".join(f"vt {k / 24:g} .5\n" for k in range(24))
    seams = "".join(
        "f " + " ".join(f"{i + 1}/{3 * k + j + 1}/{k + 1}" for j, i in enumerate(face)) + "\n"
        for k, face in enumerate(FACES)
    )
    yield Case("seams.obj", (_V + coordinates + "vn 0 0 1\n" * 8 + seams).encode(), about="texture coordinates")
    normals = "".join("f " + " ".join(f"{i + 1}//{k + 1}" for i in f) + "\n" for k, f in enumerate(FACES))
    yield Case("normals.obj", (_V + "vn 0 0 1\n" * 8 + normals).encode(), about="normals")
    groups = _V + "mtllib a.mtl\nusemtl a\n" + _obj_faces(FACES[:4]) + "usemtl b\n" + _obj_faces(FACES[4:])
    yield Case("materials.obj", groups.encode(), about="materials")
    objects = "o one\n" + _V + "g a\ns 1\n" + _obj_faces(FACES[:4]) + "g b\ns off\n" + _obj_faces(FACES[4:])
    yield Case("groups.obj", objects.encode(), about="names of groups")
    block = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nv {0} 0 1\nf -4 -2 -3\nf -4 -3 -1\nf -4 -1 -2\nf -3 -2 -1\n"
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    yield Case(
        "counting_back.obj", (block.format(0, 1) + block.format(5, 6)).encode(),
        vertices=np.vstack([corners, corners + np.array([5, 0, 0])]), faces=np.vstack([tetrahedron, tetrahedron + 4]),
    )  # fmt: skip
    yield Case(
        "counting_back_from_the_end.obj", (_V + "".join(f"f {i - 7} {j - 7} {k - 7}\n" for i, j, k in FACES)).encode()
    )
    yield Case("tabs.obj", whole.replace(" ", "\t").encode())
    yield Case("comment_behind_a_face.obj", whole.replace("f 3 2 6", "f 3 2 6 # lateral").encode())
    yield Case("continued_line.obj", whole.replace("f 3 2 6", "f 3 \\\n2 6").encode())
    yield Case("continued_line_crlf.obj", whole.replace("f 3 2 6", "f 3 \\\n2 6").replace("\n", "\r\n").encode())
    yield Case("crlf.obj", whole.replace("\n", "\r\n").encode())
    yield Case("old_mac.obj", whole.replace("\n", "\r").encode())
    yield Case("byte_order_mark.obj", b"\xef\xbb\xbf" + whole.encode())
    yield Case("faces_first.obj", (_obj_faces() + _V).encode())
    yield Case(
        "colours.obj",
        ("".join(f"v {x:g} {y:g} {z:g} 1 0 .5\n" for x, y, z in VERTICES) + _obj_faces()).encode(),
        about="colours",
    )
    yield Case("weights.obj", (_V.replace("\n", " 1.0\n") + _obj_faces()).encode())
    yield Case("lines_and_points.obj", (whole + "l 1 2 3\np 1\n").encode(), about="lines, points")
    yield Case("latin_comment.obj", b"# G\xe4nge\n" + whole.encode())
    polygons = "".join(f"v {x:g} {y:g} {z:g}\n" for x, y, z in PRISM) + _obj_faces(POLYGONS)
    yield Case("polygons.obj", polygons.encode(), vertices=PRISM, faces=None, about="8 faces with more than three")
    yield Case("slicer_lps.obj", ("# 3D Slicer output. SPACE=LPS\n" + whole).encode(), vertices=VERTICES * [-1, -1, 1])
    yield Case("compressed.obj.gz", gzip.compress(whole.encode()))
    yield Case("a_corner_twice.obj", (whole + "f 1 1 2\n").encode(), fault="1 faces name a vertex twice")
    yield Case("two_corners.obj", (whole + "f 1 2\n").encode(), fault="fewer than three corners")
    yield Case("index_0.obj", whole.replace("f 3 2 6", "f 0 2 6").encode(), refused="corner '0'")
    yield Case("too_far_back.obj", whole.replace("f 3 2 6", "f -8 2 6").encode(), refused="counts 8 vertices back")
    yield Case("vertex_out_of_range.obj", whole.replace("f 3 2 6", "f 3 2 8").encode(), refused="names vertex 8")
    yield Case("two_numbers.obj", whole.replace("v 4 7 1", "v 4 7").encode(), refused="three numbers are needed")
    yield Case("decimal_comma.obj", whole.replace("12.5", "12,5").encode(), refused="decimal point")
    yield Case("points_only.obj", _V.encode(), refused="7 vertices and no faces")


# OFF


def off(head="OFF\n", more="", faces=None, vertices=VERTICES) -> str:
    faces = FACES.tolist() if faces is None else faces
    text = rows(vertices).replace("\n", more + "\n")
    return f"{head}{len(vertices)} {len(faces)} 0\n{text}" + "".join(
        f"{len(face)} {' '.join(map(str, face))}\n" for face in faces
    )


def off_binary(head="OFF", more=(), polygons=None, vertices=VERTICES, colour=()) -> bytes:
    """By the page of Geomview: numbers of 32 bits, big-endian; behind each face the parts of its colour."""
    polygons = FACES.tolist() if polygons is None else polygons
    content = f"{head} BINARY\n".encode() + struct.pack(">3i", len(vertices), len(polygons), 0)
    content += b"".join(struct.pack(f">{3 + len(more)}f", *place, *more) for place in vertices)
    for face in polygons:
        content += struct.pack(f">{len(face) + 2}i", len(face), *face, len(colour))
        content += struct.pack(f">{len(colour)}f", *colour)
    return content


def off_binary_cases() -> Iterator[Case]:
    yield Case("binary.off", off_binary(), about="OFF (OFF), binary")
    for head, n_more in (("COFF", 4), ("NOFF", 3), ("STOFF", 2), ("STCNOFF", 9)):
        yield Case(f"binary_{head}.off", off_binary(head, [0.5] * n_more), about="colours, normals or texture")
    yield Case("binary_colours.off", off_binary(colour=(1, 0, 0.5, 1)), about="colours of faces")
    yield Case("binary_polygons.off", off_binary(polygons=POLYGONS, vertices=PRISM), vertices=PRISM, faces=None)
    yield Case("binary_behind.off", off_binary() + bytes(8), fault="8 bytes follow the faces")
    little = np.frombuffer(off_binary()[11:], ">i4").astype("<i4").tobytes()
    yield Case("binary_little.off", b"OFF BINARY\n" + little, refused="its numbers are not big-endian")
    yield Case("binary_cut_short.off", off_binary()[:-70], refused="is cut short")
    yield Case("binary_cut_in_a_face.off", off_binary()[:-4], refused="face 7 of the 8 that it declares is cut short")
    yield Case("binary_head_only.off", b"OFF BINARY\n" + bytes(4), refused="it declares -1 vertices")


def _off_cases() -> Iterator[Case]:
    yield Case("plain.off", off().encode(), about="OFF")
    for head, more in (
        ("COFF", " 255 0 0 255"), ("NOFF", " 0 0 1"), ("STOFF", " .5 .5"), ("CNOFF", " 0 0 1 1 0 0 1"),
        ("STCNOFF", " 0 0 1 1 0 0 1 .5 .5"), ("off", ""), ("noff", " 0 0 1"), ("Coff", " 1 0 0 1"),
    ):  # fmt: skip
        yield Case(f"head_{head}.off", off(f"{head}\n", more).encode())
    yield Case("counts_beside_the_head.off", off("OFF ").encode())
    yield Case("counts_joined_to_the_head.off", off("OFF").encode())
    yield Case("without_head.off", off("").encode())
    yield Case("two_counts.off", off().replace("7 8 0", "7 8").encode())
    yield Case("comments.off", ("# by hand\n" + off().replace("7 8 0", "# counts\n\n7 8 0 # here")).encode())
    coloured = off("OFF\n").replace("\n3 2 1 5\n", "\n3 2 1 5 255 0 0\n").replace("\n3 1 4 5\n", "\n3 1 4 5  1\n")
    yield Case("colours_of_faces.off", coloured.encode(), about="colours of faces")
    yield Case("crlf.off", off().replace("\n", "\r\n").encode())
    yield Case("polygons.off", off(faces=POLYGONS, vertices=PRISM).encode(), vertices=PRISM, faces=None)
    triangle_and_pentagon = off(faces=[[0, 2, 5], [0, 1, 2, 3, 4]], vertices=np.c_[L[:5], np.zeros(5)])
    yield Case("triangle_and_pentagon.off", triangle_and_pentagon.encode(), refused="indices start at 0")
    yield Case("colours_without_the_head.off", off(more=" 255 0 0 255").encode(), about="further numbers of vertices")
    yield Case("compressed.off.gz", gzip.compress(off().encode()))
    yield Case("lines_behind.off", (off() + "3 0 1 2\n").encode(), fault="1 lines follow")
    yield Case("four_axes.off", off("4OFF\n", " 1").encode(), refused="OFF with three coordinates")
    yield Case("any_axes.off", off("nOFF\n3\n").encode(), refused="OFF with three coordinates")
    yield from off_binary_cases()
    yield Case("cut_short.off", off()[:-8].encode(), refused="it is cut short")
    yield Case("cut_in_a_face.off", off()[:-3].encode(), refused="it is cut short")
    yield Case("more_faces_than_lines.off", off().replace("7 8 0", "7 800 0").encode(), refused="it declares")
    yield Case("a_corner_cut_off.off", off()[:-2].encode(), refused="a face is '3 0 4', of which 4 numbers are needed")
    yield Case("vertex_out_of_range.off", off().replace("3 2 1 5", "3 2 1 7").encode(), refused="indices from 0 to 7")
    yield Case("a_word.off", off().replace("12.5", "twelve").encode(), refused="'twelve' stands where")


# STL

_SOUP = VERTICES[FACES]
#: In the order in which the positions first appear.
_FIRST = list(dict.fromkeys(FACES.ravel().tolist()))
_STL = {"vertices": VERTICES[_FIRST], "faces": np.array([[_FIRST.index(i) for i in face] for face in FACES])}


def stl(head=b"", declared=None, attribute=0, soup=_SOUP) -> bytes:
    whole = head.ljust(80)[:80] + struct.pack("<I", len(soup) if declared is None else declared)
    return whole + b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), attribute) for triangle in soup)


def stl_text(name="a", soup=_SOUP) -> str:
    facets = "".join(
        "  facet normal 0 0 0\n    outer loop\n" + "".join(f"      vertex {x:g} {y:g} {z:g}\n" for x, y, z in triangle)
        + "    endloop\n  endfacet\n" for triangle in soup
    )  # fmt: skip
    return f"solid {name}\n{facets}endsolid {name}\n"


def _stl_cases() -> Iterator[Case]:
    yield Case("plain_binary.stl", stl(), about="STL, binary", **_STL)
    yield Case("plain_text.stl", stl_text().encode(), about="STL, text", **_STL)
    yield Case("binary_that_says_solid.stl", stl(b"solid a"), **_STL)
    yield Case("binary_that_says_solid_facet.stl", stl(b"solid facet count 8"), **_STL)
    yield Case("vertex_in_the_name.stl", stl_text("my vertex set").encode(), **_STL)
    yield Case("facet_in_the_name.stl", stl_text("facet\tvertex").encode(), **_STL)
    yield Case("capitals.stl", stl_text().upper().replace("E+", "e+").encode(), **_STL)
    yield Case("crlf.stl", stl_text().replace("\n", "\r\n").encode(), **_STL)
    yield Case("two_solids.stl", (stl_text("a", _SOUP[:4]) + stl_text("b", _SOUP[4:])).encode(), **_STL)
    yield Case("declares_0.stl", stl(declared=0), fault="declares 0 triangles, and its length is that of 8", **_STL)
    yield Case("declares_all.stl", stl(declared=2**32 - 1), fault="its length is that of 8", **_STL)
    yield Case("bytes_behind.stl", stl() + b"COLOR=..", fault="8 bytes follow the triangles", **_STL)
    yield Case("attributes.stl", stl(attribute=31), about="attributes", **_STL)
    payload = b"".join(stl(soup=_SOUP[k : k + 1], attribute=k)[84:] + bytes(range(k)) for k in range(8))
    yield Case("attributes_that_count_bytes.stl", stl()[:84] + payload, about="bytes behind each triangle", **_STL)
    large = np.tile(_SOUP, (832, 1, 1))
    many = {"vertices": _STL["vertices"], "faces": np.tile(_STL["faces"], (832, 1))}
    yield Case("a_count_that_looks_like_text.stl", stl(soup=large), **many)
    yield Case("compressed.stl.gz", gzip.compress(stl()), **_STL)
    lps = {"vertices": _STL["vertices"] * [-1, -1, 1], "faces": _STL["faces"]}
    yield Case("slicer_lps_binary.stl", stl(b"3D Slicer output. SPACE=LPS"), **lps)
    yield Case("slicer_lps_text.stl", stl_text("3D Slicer output. SPACE=LPS").encode(), **lps)
    needle = np.concatenate([_SOUP, [[VERTICES[0], VERTICES[0], VERTICES[1]]]])
    yield Case("a_facet_without_area.stl", stl(soup=needle), fault="1 faces name a vertex twice", **_STL)
    zeros = np.where(_SOUP == 0, -0.0, _SOUP)
    zeros[::2] = _SOUP[::2]
    yield Case("zeros_of_both_signs.stl", stl(soup=zeros), **_STL)
    yield Case("cut_short_binary.stl", stl()[:-20], refused="it is cut short")
    yield Case("declares_too_many.stl", stl(declared=9), refused="it is cut short")
    yield Case("cut_short_text.stl", stl_text()[:-60].encode(), refused="it is cut short")
    yield Case(
        "two_vertices_in_a_facet.stl",
        stl_text().replace("      vertex 4 7 1\n", "", 1).encode(),
        refused="three are needed for each",
    )
    yield Case("empty.stl", b"solid a\nendsolid a\n", refused="no faces")


# GIfTI

_SURFACE_RAS = VERTICES - C_RAS
_IDENTITY = "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"
_MOVE = "1 0 0 4.5 0 1 0 -17.25 0 0 1 31 0 0 0 1"
_GEOMETRY = {f"VolGeomC_{axis}": x for axis, x in zip("RAS", C_RAS, strict=True)}
for _voxel, _row in zip("XYZ", ((-1, 0, 0), (0, 0, -1), (0, 1, 0)), strict=True):
    _GEOMETRY |= {f"VolGeom{_voxel}_{axis}": x for axis, x in zip("RAS", _row, strict=True)}


def system(start="UNKNOWN", end="SCANNER_ANAT", matrix=_IDENTITY) -> str:
    return (
        f"<CoordinateSystemTransformMatrix><DataSpace><![CDATA[NIFTI_XFORM_{start}]]></DataSpace><TransformedSpace>"
        f"<![CDATA[NIFTI_XFORM_{end}]]></TransformedSpace><MatrixData>{matrix}</MatrixData>"
        "</CoordinateSystemTransformMatrix>"
    )


def array(
    values, intent, kind, encoding="GZipBase64Binary", systems="", meta=None, order="<", by_column=False, more=""
):
    values = np.asarray(values, {"FLOAT32": "f4", "INT32": "i4", "FLOAT64": "f8", "UINT8": "u1"}[kind])
    laid = values.T if by_column else values
    data = laid.astype(values.dtype.newbyteorder(order)).tobytes()
    text = {
        "ASCII": " ".join(f"{x:g}" for x in laid.ravel()),
        "Base64Binary": base64.b64encode(data).decode(),
        "GZipBase64Binary": base64.b64encode(zlib.compress(data)).decode(),
        "ExternalFileBinary": "",
    }[encoding]
    fields = "".join(
        f"<MD><Name><![CDATA[{k}]]></Name><Value><![CDATA[{v}]]></Value></MD>" for k, v in (meta or {}).items()
    )
    sizes = " ".join(f'Dim{k}="{n}"' for k, n in enumerate(values.shape))
    return (
        f'<DataArray Intent="NIFTI_INTENT_{intent}" DataType="NIFTI_TYPE_{kind}" ArrayIndexingOrder='
        f'"{"Column" if by_column else "Row"}MajorOrder" Dimensionality="{values.ndim}" {sizes} Encoding="{encoding}" '
        f'Endian="{"Little" if order == "<" else "Big"}Endian" {more}><MetaData>{fields}</MetaData>{systems}'
        f"<Data>{text}</Data></DataArray>"
    )


def gifti(*arrays: str, head='<?xml version="1.0" encoding="UTF-8"?>\n') -> bytes:
    doctype = '<!DOCTYPE GIFTI SYSTEM "http://www.nitrc.org/frs/download.php/115/gifti.dtd">\n'
    root = f'<GIFTI Version="1.0" NumberOfDataArrays="{len(arrays)}"><MetaData/><LabelTable/>'
    return f"{head}{doctype}{root}{''.join(arrays)}</GIFTI>".encode()


def gifti_of(points=VERTICES, systems="", meta=None, faces=FACES) -> bytes:
    return gifti(array(points, "POINTSET", "FLOAT32", systems=systems, meta=meta), array(faces, "TRIANGLE", "INT32"))


def _gifti_cases() -> Iterator[Case]:
    triangles = array(FACES, "TRIANGLE", "INT32")
    for encoding, order, by_column in itertools.product(
        ("ASCII", "Base64Binary", "GZipBase64Binary"), "<>", (False, True)
    ):
        how = (encoding, "", None, order, by_column)
        name = f"{encoding}_{'little' if order == '<' else 'big'}_{'columns' if by_column else 'rows'}.surf.gii"
        yield Case(
            name,
            gifti(array(VERTICES, "POINTSET", "FLOAT32", *how), array(FACES, "TRIANGLE", "INT32", *how)),
            about=encoding,
        )
    outside = 'ExternalFileName="points.bin" ExternalFileOffset="8"'
    points = array(VERTICES, "POINTSET", "FLOAT32", "ExternalFileBinary", more=outside)
    binary = bytes(8) + VERTICES.astype("<f4").tobytes()
    yield Case("numbers_in_another_file.surf.gii", gifti(points, triangles), beside=(("points.bin", binary),))
    yield Case(
        "numbers_in_a_lost_file.surf.gii", gifti(points, triangles), refused="'points.bin', which is not beside it"
    )
    away = points.replace("points.bin", "../points.bin")
    yield Case("numbers_in_another_folder.surf.gii", gifti(away, triangles), refused="which is not beside it")
    yield Case("doubles.surf.gii", gifti(array(VERTICES, "POINTSET", "FLOAT64"), triangles))
    yield Case("triangles_first.surf.gii", gifti(triangles, array(VERTICES, "POINTSET", "FLOAT32")))
    values = array(np.zeros(7), "SHAPE", "FLOAT32")
    yield Case(
        "with_values.surf.gii",
        gifti(array(VERTICES, "POINTSET", "FLOAT32"), triangles, values),
        about="data of vertices: shape (float32)",
    )
    yield Case("compressed.surf.gii.gz", gzip.compress(gifti_of()))
    members = gzip.compress(gifti_of()[:500]) + gzip.compress(gifti_of()[500:])
    yield Case("several_members.surf.gii.gz", members)
    yield Case("scanner.surf.gii", gifti_of(systems=system("SCANNER_ANAT", "TALAIRACH", _MOVE)), about="its DataSpace")
    lines = "\n1 0 0 4.5\n0 1 0 -17.25\n0 0 1 31\n0 0 0 1\n"
    for form, matrix in (("one_line", _MOVE), ("lines", lines), ("exponents", _MOVE.replace("31", "3.1e+1"))):
        moved = gifti_of(_SURFACE_RAS, system("UNKNOWN", "SCANNER_ANAT", matrix))
        yield Case(f"matrix_in_{form}.surf.gii", moved, about="its TransformedSpace")
    aligned = gifti_of(_SURFACE_RAS, system("ALIGNED_ANAT", "SCANNER_ANAT", _MOVE))
    yield Case("aligned_to_scanner.surf.gii", aligned, about="the matrix from aligned_anat")
    two = system("UNKNOWN", "SCANNER_ANAT", _MOVE) + system("UNKNOWN", "TALAIRACH", _IDENTITY)
    yield Case("scanner_is_the_first_of_two.surf.gii", gifti_of(_SURFACE_RAS, two))
    turn = "0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1"
    turned = VERTICES[:, [1, 0, 2]] * [-1, 1, 1] + [5, 6, 7]
    yield Case("matrix_that_turns.surf.gii", gifti_of(systems=system(matrix=turn)), vertices=turned)
    for end in ("TALAIRACH", "MNI_152", "UNKNOWN"):
        yield Case(f"to_{end}.surf.gii", gifti_of(systems=system("UNKNOWN", end, turn)), about="not said")
    twice = gifti_of(systems=system("SCANNER_ANAT", "SCANNER_ANAT", turn))
    yield Case("scanner_to_scanner.surf.gii", twice, about="its DataSpace, scanner")
    yield Case("in_mni152.surf.gii", gifti_of(systems=system("MNI_152", "MNI_152")), about="mni_152, in mm")
    yield Case("without_space.surf.gii", gifti_of(), about="not said by the file")
    old = system("UNKNOWN", "TALAIRACH", _IDENTITY)
    yield Case("freesurfer_up_to_7_3.surf.gii", gifti_of(_SURFACE_RAS, old, _GEOMETRY), about="VolGeomC_R, _A, _S")
    yield Case("freesurfer_without_system.surf.gii", gifti_of(_SURFACE_RAS, "", _GEOMETRY), about="VolGeomC_R")
    only_c = {key: value for key, value in _GEOMETRY.items() if "VolGeomC" in key}
    yield Case("freesurfer_without_axes.surf.gii", gifti_of(_SURFACE_RAS, old, only_c), about="VolGeomC_R")
    new = system("UNKNOWN", "SCANNER_ANAT", _MOVE)
    yield Case("freesurfer_from_7_4.surf.gii", gifti_of(_SURFACE_RAS, new, _GEOMETRY), about="its TransformedSpace")
    other = _GEOMETRY | {"VolGeomC_R": 40.5}
    yield Case(
        "matrix_against_volgeom.surf.gii", gifti_of(_SURFACE_RAS, new, other), fault="VolGeomC_R, _A, _S say (40.5"
    )
    scanner = gifti_of(systems=system("SCANNER_ANAT", "SCANNER_ANAT"), meta=_GEOMETRY)
    yield Case("freesurfer_to_scanner.surf.gii", scanner, about="its DataSpace, scanner")
    hcp = gifti_of(systems=system("TALAIRACH", "TALAIRACH"), meta=_GEOMETRY)
    yield Case("talairach_against_volgeom.surf.gii", hcp, fault="its DataSpace is talairach, and VolGeomC_R")
    zeros = gifti_of(systems=system("ALIGNED_ANAT", "ALIGNED_ANAT"), meta=_GEOMETRY | dict.fromkeys(only_c, 0))
    yield Case("volgeom_set_to_zero.surf.gii", zeros, about="aligned_anat, in mm")
    apart = gifti_of(_SURFACE_RAS, new + system("TALAIRACH", "MNI_152"))
    yield Case("two_data_spaces.surf.gii", apart, fault="start from different spaces: TALAIRACH, UNKNOWN")
    mirror = gifti_of(VERTICES * [-1, 1, 1], system("UNKNOWN", "SCANNER_ANAT", "-1" + _IDENTITY[1:]))
    yield Case("matrix_that_reflects.surf.gii", mirror, faces=FACES[:, ::-1])
    side = gifti_of(
        np.stack([-VERTICES[:, 0], VERTICES[:, 2], -VERTICES[:, 1]], axis=1) + 0.0,
        "",
        dict.fromkeys(only_c, 0)
        | {f"VolGeom{v}_{a}": float(v + a in ("XR", "YA", "ZS")) for v in "XYZ" for a in "RAS"},
    )
    yield Case("volgeom_of_other_axes.surf.gii", side, faces=FACES[:, ::-1])
    yield Case(
        "matrix_of_12.surf.gii",
        gifti_of(systems=system(matrix="1 2 3 4 5 6 7 8 9 10 11 12")),
        refused="12 numbers; 16 are needed",
    )
    yield Case("singular_matrix.surf.gii", gifti_of(systems=system(matrix="0 " * 15 + "1")), refused="is singular")
    yield Case("cut_short.surf.gii", gifti_of()[:-200], refused="no whole XML")
    yield Case("cut_short.surf.gii.gz", gzip.compress(gifti_of())[:-20], refused="cut short or damaged")
    for size, said in (
        ('Dim0="9"', "declares 27 values, but holds 21"),
        ('Dim0="1000000000"', "declares 3000000000 values, but holds 21"),
        ('Dim0="-7"', "sizes must be >= 0"),
        ('Dimensionality="1000000000"', "Dimensionality is 1000000000"),
        ('Dimensionality="-1"', "Dimensionality is -1"),
    ):
        content = re.sub(rf'{size.partition("=")[0]}="\d"', size, gifti_of().decode(), count=1).encode()
        yield Case(f"{size.replace(chr(34), '')}.surf.gii", content, refused=said)
    yield Case("points_only.surf.gii", gifti(array(VERTICES, "POINTSET", "FLOAT32")), refused="0 triangle sets")
    yield Case("values_only.func.gii", gifti(values), refused="0 point sets and 0 triangle sets")
    yield Case("vertex_out_of_range.surf.gii", gifti_of(faces=[[0, 1, 7]]), refused="indices from 0 to 7")
    yield Case("a_corner_twice.surf.gii", gifti_of(faces=np.vstack([FACES, [[1, 1, 2]]])), fault="1 faces name")
    yield Case(
        "triangles_as_numbers.surf.gii",
        gifti(array(VERTICES, "POINTSET", "FLOAT32"), array(FACES, "TRIANGLE", "FLOAT32")),
        refused="integers are needed",
    )
    yield Case(
        "two_columns.surf.gii", gifti(array(VERTICES[:, :2], "POINTSET", "FLOAT32"), triangles), refused="three columns"
    )
    damaged = gifti_of().replace(b"<Data>eJ", b"<Data>eK", 1)
    yield Case("damaged_array.surf.gii", damaged, refused="a compressed array is damaged")
    entity = gifti_of().replace(b'gifti.dtd">', b'gifti.dtd" [<!ENTITY a "b">]>')
    yield Case("entities.surf.gii", entity, refused="defines entities")


# FreeSurfer


def geometry(
    c_ras=C_RAS, valid=1, axes=((-1, 0, 0), (0, 0, -1), (0, 1, 0)), head=(2, 0, 20), filename="x.mgz"
) -> bytes:
    lines = [f"valid = {valid}  # volume info {'valid' if valid else 'invalid'}", f"filename = {filename}"]
    lines += ["volume = 256 256 256", "voxelsize = 1.0000e+00 1.0000e+00 1.0000e+00"]
    for name, vector in zip(("xras  ", "yras  ", "zras  ", "cras  "), (*axes, c_ras), strict=True):
        lines.append(f"{name} = " + " ".join(f"{x:.15e}" for x in vector))
    return struct.pack(f">{len(head)}i", *head) + "\n".join(lines).encode() + b"\n"


def freesurfer(points=_SURFACE_RAS, stamp=b"created by nobody\n\n", tail=None, faces=FACES) -> bytes:
    whole = b"\xff\xff\xfe" + stamp + struct.pack(">2i", len(points), len(faces))
    whole += points.astype(">f4").tobytes() + faces.astype(">i4").tobytes()
    return whole + (geometry() if tail is None else tail)


def _freesurfer_cases() -> Iterator[Case]:
    yield Case("lh.white", freesurfer(), about="cras = (4.5, -17.25, 31)")
    yield Case("lh.one_newline", freesurfer(stamp=b"created by mri_watershed\n"))
    yield Case("lh.two_lines_of_text", freesurfer(stamp=b"created by nobody\non a day\n"))
    yield Case("lh.empty_stamp", freesurfer(stamp=b"\n\n"))
    yield Case("rh.pial.gz", gzip.compress(freesurfer()))
    yield Case("surface_without_a_name", freesurfer())
    yield Case("lh.tag_20_first", freesurfer(tail=geometry(head=(20,))))
    command = struct.pack(">iq", 3, 12) + b"mris_smooth \n"
    yield Case("lh.tags_behind", freesurfer(tail=geometry() + command))
    yield Case("lh.equals_sign_in_filename", freesurfer(tail=geometry(filename="/a=b/cras = 1 2 3/x.mgz")))
    real = geometry(head=(2, 1, 20))
    yield Case("lh.uses_scanner_ras", freesurfer(VERTICES, tail=real), about="useRealRAS (tag 2) is 1")
    yield Case("lh.no_information", freesurfer(tail=b""), refused="pass c_ras")
    yield Case("lh.no_information_but_c_ras", freesurfer(tail=b""), c_ras=C_RAS, about="c_ras as given")
    yield Case("lh.invalid_information", freesurfer(tail=geometry(valid=0)), refused="pass c_ras")
    yield Case("lh.invalid_information_but_c_ras", freesurfer(tail=geometry(valid=0)), c_ras=C_RAS)
    yield Case("lh.two_c_ras", freesurfer(), c_ras=(1.0, 2.0, 3.0), fault="c_ras is given as (1, 2, 3)")
    yield Case("lh.same_c_ras", freesurfer(), c_ras=C_RAS)
    plain = geometry((0, 0, 0), axes=np.eye(3))
    turned = np.stack([-VERTICES[:, 0], VERTICES[:, 2], -VERTICES[:, 1]], axis=1)
    yield Case("lh.other_handedness", freesurfer(turned, tail=plain), faces=FACES[:, ::-1])
    yield Case("lh.singular_axes", freesurfer(tail=geometry(axes=np.ones((3, 3)))), refused="not orthogonal unit")
    yield Case("lh.nan_c_ras", freesurfer(tail=geometry((np.nan, 0, 0))), refused="lacks a number")
    quads = np.array([[0, 2, 1, 4], [1, 2, 0, 5]])
    split = np.array([[0, 2, 4], [1, 4, 2], [1, 2, 0], [1, 0, 5]])
    three = b"".join(int(i).to_bytes(3, "big") for i in quads.ravel())
    counts = (7).to_bytes(3, "big") + (2).to_bytes(3, "big")
    old = b"\xff\xff\xff" + counts + (VERTICES * 100).astype(">i2").tobytes() + three
    yield Case("lh.old_quads", old, faces=split, c_ras=(0.0, 0.0, 0.0), about="quadrangles")
    new = b"\xff\xff\xfd" + counts + VERTICES.astype(">f4").tobytes() + three
    yield Case("lh.new_quads", new, faces=split, c_ras=(0.0, 0.0, 0.0), about="quadrangles")
    yield Case("lh.old_quads_cut", old[:-1], refused="7 vertices and 2 faces, but has")
    yield Case("lh.curv", b"\xff\xff\xff" + struct.pack(">3i", 7, 8, 1) + bytes(28), refused="such as curvature")
    yield Case("lh.aparc.annot", struct.pack(">i", 7) + bytes(56), refused="a label, an annotation")
    yield Case("lh.cortex.label", b"#!ascii label\n2\n0 1 2 3 0.0\n", refused="a label, an annotation")
    yield Case("lh.cut_short", freesurfer(tail=b"")[:-10], refused="7 vertices and 8 faces, but has")
    for counts in ((2**31 - 1, 2**31 - 1), (7, 2**30), (-5, 10), (0, 0)):
        stamp = b"x\n\n" + struct.pack(">2i", *counts)
        yield Case(f"lh.counts_{counts[0]}", freesurfer(stamp=stamp), refused="but has")
    yield Case("lh.vertex_out_of_range", freesurfer(faces=FACES + 1), refused="indices from 1 to 7")
    yield Case("lh.is_gifti", gifti_of(), fault="its name is that of a freesurfer file, and its content is gifti")


# VTK and GLB


def vtk(title="vtk output", polygons=None, vertices=VERTICES, more="") -> bytes:
    polygons = FACES.tolist() if polygons is None else polygons
    size = sum(len(polygon) + 1 for polygon in polygons)
    return (
        f"# vtk DataFile Version 3.0\n{title}\nASCII\nDATASET POLYDATA\nPOINTS {len(vertices)} float\n{rows(vertices)}"
        f"POLYGONS {len(polygons)} {size}\n" + "".join(f"{len(p)} {' '.join(map(str, p))}\n" for p in polygons) + more
    ).encode()


def vtp(field="", data="", vertices=VERTICES, polygons=None) -> bytes:
    polygons = FACES.tolist() if polygons is None else polygons
    ends = np.cumsum([len(polygon) for polygon in polygons])
    numbers = lambda values: " ".join(f"{x:g}" for x in values)  # noqa: E731
    return (
        '<?xml version="1.0"?><VTKFile type="PolyData" version="0.1" byte_order="LittleEndian"><PolyData>'
        f'{field}<Piece NumberOfPoints="{len(vertices)}" NumberOfVerts="0" NumberOfLines="0" NumberOfStrips="0" '
        f'NumberOfPolys="{len(polygons)}">{data}<Points><DataArray type="Float32" NumberOfComponents="3" '
        f'format="ascii">{numbers(vertices.ravel())}</DataArray></Points><Polys><DataArray type="Int32" '
        f'Name="connectivity" format="ascii">{numbers(itertools.chain(*polygons))}</DataArray><DataArray type="Int32" '
        f'Name="offsets" format="ascii">{numbers(ends)}</DataArray></Polys></Piece></PolyData></VTKFile>'
    ).encode()


def glb(vertices, faces, matrix=None) -> bytes:
    points, corners = vertices.astype("<f4").tobytes(), faces.astype("<u2").tobytes()
    node = {"mesh": 0} | ({"matrix": matrix} if matrix else {})
    about = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [node],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(vertices), "type": "VEC3",
             "min": vertices.min(0).tolist(), "max": vertices.max(0).tolist()},
            {"bufferView": 1, "componentType": 5123, "count": faces.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(corners)},
        ],
        "buffers": [{"byteLength": len(points) + len(corners)}],
    }  # fmt: skip
    text = json.dumps(about).encode()
    text += b" " * (-len(text) % 4)
    data = points + corners
    data += b"\0" * (-len(data) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def _other_cases() -> Iterator[Case]:
    yield Case("plain.vtk", vtk(), about="VTK, legacy")
    yield Case("slicer_lps.vtk", vtk("3D Slicer output. SPACE=LPS"), vertices=VERTICES * [-1, -1, 1], about="SPACE=LPS")
    yield Case("polygons.vtk", vtk(polygons=POLYGONS, vertices=PRISM), vertices=PRISM, faces=None)
    values = "POINT_DATA 7\nSCALARS thickness float 1\nLOOKUP_TABLE default\n" + "1\n" * 7
    yield Case("with_values.vtk", vtk(more=values), about="thickness")
    yield Case("cut_short.vtk", vtk()[:140], refused="cannot be read as a vtk mesh")
    yield Case("plain.vtp", vtp(), about="VTK XML")
    space = '<DataArray type="String" Name="SPACE" NumberOfTuples="1" format="ascii">76 80 83 0</DataArray>'
    space = f"<FieldData>{space}</FieldData>"
    yield Case("slicer_lps.vtp", vtp(space), vertices=VERTICES * [-1, -1, 1], about="SPACE=LPS")
    yield Case("polygons.vtp", vtp(vertices=PRISM, polygons=POLYGONS), vertices=PRISM, faces=None)
    yield Case("compressed.vtp.gz", gzip.compress(vtp()))
    yield Case("cut_short.vtp", vtp()[:-300], refused="cannot be read as a vtp mesh")
    yield Case("plain.glb", glb(VERTICES[_FIRST], _STL["faces"]), about="GLB", **_STL)
    yield Case("seams.glb", glb(_SOUP.reshape(-1, 3), np.arange(24).reshape(-1, 3)), **_STL)
    move = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4.5, -17, 31, 1]
    yield Case(
        "moved.glb",
        glb(VERTICES[_FIRST], _STL["faces"], move),
        vertices=VERTICES[_FIRST] + np.array([4.5, -17, 31]),
        faces=_STL["faces"],
    )
    yield Case("cut_short.glb", glb(VERTICES, FACES)[:-30], refused="cannot be read as a glb mesh")
    yield Case("nothing.ply", b"", refused="header does not begin with ply")
    yield Case("words", b"This is no mesh.\n", refused="is no mesh")


MESHES = [
    *_ply_cases(), *_obj_cases(), *_off_cases(), *_stl_cases(), *_gifti_cases(), *_freesurfer_cases(), *_other_cases()
]  # fmt: skip
