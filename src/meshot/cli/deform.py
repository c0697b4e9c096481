"""``meshot deform SOURCE TARGET -o RESULT``."""

import argparse
import warnings
from pathlib import Path

from meshot.cli.common import COUNT, FILE, Commands, add_command
from meshot.files import printable_name


def add_to(commands: Commands) -> None:
    """Add the command ``deform`` and its arguments to the parser."""
    command = add_command(
        commands,
        "deform",
        "Deform one mesh into another by a smooth flow.",
        "The command moves the vertices of the source so that its surface comes to lie on the target, without crossing "
        "itself. The result has the faces of the source, and its vertices in the same order. It is doubtful, and a "
        "warning says so, if the meshes differ in topology or the result ends far from the target.",
        """
        meshot deform sphere.ply capsule.ply -o fitted.ply
        meshot deform lh.white rh.white.surf.gii -o fitted.surf.gii --iterations 600 --detail 0.04
        """,
        "Meshes are PLY, OBJ, OFF, STL, GLB, VTK, GIfTI or FreeSurfer files, roughly aligned. The result keeps data of "
        "the vertices, such as thickness or colours, if source and result are PLY, VTP, VTK or GIfTI; and colours and "
        "textures if they are PLY, OBJ or GLB. A warning names what is lost.",
    )
    command.add_argument("source", type=Path, help="The mesh that is deformed.")
    command.add_argument("target", type=Path, help="The mesh that it shall become.")
    command.add_argument("-o", "--output", **FILE, required=True, help="Write the result to this file.")
    command.add_argument(
        "--iterations", **COUNT, default=300, help="Minimise the loss in this many iterations (default: %(default)s)."
    )
    command.add_argument(
        "--detail",
        type=float,
        default=0.075,
        metavar="SHARE",
        help="The spacing of the finest grid of the flow, as a share of half the longest side of both meshes. Smaller "
        "values resolve finer folds and need more memory (default: %(default)s).",
    )
    command.add_argument("--seed", **COUNT, default=0, help="Seed of the directions (default: %(default)s).")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    import meshot
    from meshot.file_facts import heed
    from meshot.mesh import holds_vertex_data, read_whole_mesh, write_carried
    from meshot.metrics import Surface, average_surface_distance, offsets_between

    if not chosen.output.parent.is_dir():
        raise ValueError(f"{chosen.output.parent} is no folder; make it first, or choose another output")
    source, facts, data = read_whole_mesh(chosen.source)
    heed(chosen.source, facts, strict=False)
    target = meshot.read_mesh(chosen.target)
    found = meshot.deform(source, target, n_iterations=chosen.iterations, detail=chosen.detail, seed=chosen.seed)
    lost = list(facts.not_read)
    if data and holds_vertex_data(chosen.output):
        meshot.write_mesh(chosen.output, found.mesh, vertex_data=data)
    elif write_carried(chosen.output, chosen.source, source, found.carry):
        names = [name for name in data if name not in ("red", "green", "blue", "alpha")]
        lost = [f"data of vertices: {', '.join(names)}"] if names else []
    else:
        meshot.write_mesh(chosen.output, found.mesh)
        lost += [f"data of vertices: {', '.join(data)}"] if data else []
    if lost:
        said = f"{chosen.output.name} does not hold what {chosen.source.name} has besides: {'; '.join(lost)}"
        warnings.warn(said, stacklevel=1)
    before = average_surface_distance(*offsets_between(Surface(source), Surface(target), 10_000))
    print(f"mean distance from the target: {before:.4g} before, {found.distance:.4g} after")
    print(f"{len(found.mesh.vertices)} vertices in {printable_name(chosen.output)}")
