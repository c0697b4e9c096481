"""``meshot inspect FILE...``: what files of surfaces and scans say about themselves, and their conversion."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from meshot.cli.common import NOTE, Commands, add_command
from meshot.files import printable_name

if TYPE_CHECKING:  # for annotations only: importing torch would delay --help
    from meshot.mesh import Mesh

#: Files of scans; all others are read as surfaces.
_SCANS = (".nii", ".nii.gz", ".nii.bz2", ".mgh", ".mgz", ".hdr", ".img", ".img.gz", ".mnc", ".head", ".brik", ".par")
Lines = list[tuple[str, str]]


def add_to(commands: Commands) -> None:
    """Add the command ``inspect`` and its arguments to the parser."""
    command = add_command(
        commands,
        "inspect",
        "Say in which format and space a surface or a scan is, and convert it.",
        "The command prints the format of each file, the space of its coordinates and the field that states it, "
        "contradictions between fields, topology and size of a surface or grid and axes of a scan, and what the file "
        f"holds that is not read. Nothing is guessed: a file that does not state its space is called so. {NOTE}",
        """
        meshot inspect lh.white lh.pial.surf.gii T1.nii.gz
        meshot inspect lh.white --to white.ply
        meshot inspect old.nii.gz --strict
        """,
        "Surfaces are PLY, OBJ, OFF, STL, VTP, VTK, GLB, GIfTI or FreeSurfer files; scans are NIfTI, MGH or other "
        "formats of nibabel. The exit status is 0, 2 if a file cannot be read, and 3 if --strict refuses one.",
    )
    command.add_argument("file", type=Path, nargs="+", help="A surface or a scan.")
    command.add_argument(
        "--to",
        type=Path,
        metavar="FILE",
        help="Write the one file that is given to this one, in the format of its name, and say what is lost.",
    )
    command.add_argument(
        "--c-ras",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="The scanner coordinates of the centre of the volume of a FreeSurfer surface: of one that does not "
        "contain them, or of one that is written.",
    )
    command.add_argument("--strict", action="store_true", help="Refuse files that contradict themselves.")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from meshot.file_facts import heed
    from meshot.mesh import read_whole_mesh
    from meshot.volume import read_volume_and_facts, write_volume

    if chosen.to is not None and len(chosen.file) > 1:
        raise ValueError(f"--to {chosen.to} takes one file, and {len(chosen.file)} are given; convert them one by one")
    c_ras = None if chosen.c_ras is None else tuple(chosen.c_ras)
    for path in chosen.file:
        is_scan = path.name.lower().endswith(_SCANS)
        thing, facts, *data = read_volume_and_facts(path) if is_scan else read_whole_mesh(path, c_ras)
        lines = [("format", facts.format), ("space", facts.space), ("stated by", facts.said_by), *facts.numbers]
        lines += [] if is_scan else _about_mesh(thing)
        lines += [("not read", what) for what in facts.not_read] + [("look at this", what) for what in facts.faults]
        if chosen.strict:
            heed(path, facts, strict=True)
        if chosen.to is not None and is_scan:
            write_volume(chosen.to, thing)
            lines.append(("written", printable_name(chosen.to)))
        elif chosen.to is not None:
            lines += _converted(thing, *data, chosen.to, c_ras)
        width = max(len(name) for name, _ in lines)
        print(printable_name(path), *(f"  {name:<{width}}  {value}" for name, value in lines), sep="\n")


def _about_mesh(mesh: "Mesh") -> Lines:
    from meshot.mesh import face_areas, self_intersecting_faces, signed_volume, topology

    found, vertices = topology(mesh), mesh.vertices
    n_unused = len(vertices) - len(mesh.faces.unique())
    closed = found.n_boundary_edges == 0 and found.n_nonmanifold_edges == 0
    holes = f"{found.n_boundary_edges} edges of one face, {found.n_nonmanifold_edges} of more than two"
    volume = float(signed_volume(mesh))
    outward = "normals outwards" if volume > 0 else "normals inwards: the faces are turned around"
    box = ", ".join(f"{a:.4g} to {b:.4g}" for a, b in zip(vertices.amin(0).tolist(), vertices.amax(0).tolist()))
    return [
        ("vertices", f"{len(vertices)}" + (f", {n_unused} of them in no face" if n_unused else "")),
        ("faces", f"{len(mesh.faces)}, {len(self_intersecting_faces(mesh))} of them cross others"),
        ("topology", f"{found.n_components} components, χ = {found.euler_number}; {'closed' if closed else holes}"),
        ("extent", f"x, y, z from {box} mm"),
        ("area", f"{float(face_areas(mesh).sum()) / 100:.4g} cm²"),
        *([("volume", f"{abs(volume) / 1000:.4g} cm³, {outward}")] if closed else []),
    ]


def _converted(mesh: "Mesh", data: dict, path: Path, c_ras: tuple[float, float, float] | None) -> Lines:
    """Write the mesh with the data of its vertices, and compare it with what is then read."""
    from meshot.mesh import holds_vertex_data, read_mesh, write_mesh

    lost = [] if holds_vertex_data(path) else [("lost", f"data of vertices: {', '.join(data)}")] * bool(data)
    write_mesh(path, mesh, *([] if c_ras is None else [c_ras]), vertex_data=None if lost else data)
    again = read_mesh(path)
    if len(again.vertices) != len(mesh.vertices) or not again.faces.equal(mesh.faces):
        corners = (again.vertices[again.faces] - mesh.vertices[mesh.faces]).abs().max()
        what = f"corners within {float(corners):.2g} mm; vertices are numbered anew, {len(again.vertices)} of them"
    else:
        apart = float((again.vertices - mesh.vertices).abs().max())
        what = f"vertices and faces in their order, coordinates within {apart:.2g} mm"
    return [("written", f"{printable_name(path)}: {what}"), *lost]
