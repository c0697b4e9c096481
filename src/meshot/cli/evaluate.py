"""``meshot evaluate PREDICTED TARGET``: two surfaces, two folders of surfaces, or many pairs from a table."""

import argparse
import csv
import io
import json
import sys
import warnings
from pathlib import Path

import meshot
from meshot.cli.common import NOTE, SURFACE, Commands, add_choice, add_command, add_sampling, chosen_emd_points

PAIR, RESIDUE = ("predicted", "target"), "icp_residue_mm"


def add_to(commands: Commands) -> None:
    """Add the command ``evaluate`` and its arguments to the parser."""
    command = add_command(
        commands,
        "evaluate",
        "Compare surfaces with target surfaces.",
        "The command prints distances between the surfaces (EMD, SWD, ASSD, Hausdorff at 90 %), the agreement of their "
        "normals, self-intersections, topology, size and shape of the triangles. Every number has its unit, and its "
        f"value for the target against itself, which is called the floor. {NOTE}",
        """
        meshot evaluate predicted.ply lh.white.surf.gii
        meshot evaluate predicted.ply lh.white.surf.gii --definitions --json results.json
        meshot evaluate build/study SUBJECTS_DIR --tsv results.tsv
        meshot evaluate --pairs pairs.tsv --tsv results.tsv
        """,
        "Meshes are PLY, OBJ, OFF, STL, GIfTI or FreeSurfer files. Both have to be in the same space, in mm. Folders "
        "are FreeSurfer's SUBJECTS_DIR, BIDS derivatives, or folders of results of meshot reconstruct.",
    )
    command.add_argument(
        "predicted", type=Path, nargs="?", help="The surface to evaluate, or a folder with a folder for each subject."
    )
    command.add_argument(
        "target", type=Path, nargs="?", help="The surface that is taken as the truth, or a folder of such surfaces."
    )
    command.add_argument(
        "--pairs",
        type=Path,
        metavar="TSV",
        help="Evaluate all pairs of this table, whose columns are predicted and target, separated by tabs. Paths are "
        "relative to the folder of the table.",
    )
    add_choice(command)
    add_sampling(command)
    command.add_argument(
        "--emd-blur",
        type=float,
        metavar="MM",
        help="Compute the EMD by Sinkhorn's algorithm with this blur, in mm (default: exactly, by a linear program).",
    )
    command.add_argument(
        "--json", metavar="FILE", help="Write all results with inputs and settings to this file; - is standard output."
    )
    command.add_argument(
        "--tsv",
        metavar="FILE",
        help="Write a row for each pair to this file; - is standard output, and the default with many pairs.",
    )
    command.add_argument("--definitions", action="store_true", help="Print the definition of each metric as well.")
    command.set_defaults(run=_run)


def _run(chosen: argparse.Namespace) -> None:
    from tqdm import tqdm

    pairs, many = _pairs(chosen), chosen.pairs is not None or chosen.predicted.is_dir()
    records = []
    for predicted, target in tqdm(pairs, unit="pair", disable=not many):
        try:
            records.append(_record(chosen, predicted, target, quiet=many))
        except ValueError as error:
            if not many:
                raise
            raise ValueError(f"{error} (files {predicted} and {target})") from error
    outputs = {"json": chosen.json, "tsv": chosen.tsv or ("-" if many and chosen.json != "-" else None)}
    if list(outputs.values()).count("-") > 1:
        raise ValueError("--json - and --tsv - would both go to stdout; write one of them to a file")
    if outputs["json"]:
        content = json.dumps(records if many else records[0], indent=1, ensure_ascii=False)
        _write(outputs["json"], content + "\n")
    if outputs["tsv"]:
        _write(outputs["tsv"], _table(records))


def _pairs(chosen: argparse.Namespace) -> list[tuple[Path, Path]]:
    if (chosen.target is None) == (chosen.pairs is None):
        raise ValueError(
            "two surfaces or folders are needed, PREDICTED and TARGET, or a table of pairs: --pairs pairs.tsv"
        )
    if chosen.pairs is None and (chosen.predicted.is_dir() or chosen.target.is_dir()):
        from meshot.study import find_surfaces, paired_surfaces

        found = (find_surfaces(folder, chosen.surface) for folder in (chosen.predicted, chosen.target))
        pairs, lost = paired_surfaces(*found, chosen.common)
        for sentence in lost:
            warnings.warn(f"{sentence}: it is left out", stacklevel=2)
        return list(pairs.values())
    if chosen.common or chosen.surface != SURFACE:
        raise ValueError(
            "--surface and --common choose among the surfaces of two folders, and files are given; leave these options "
            "out, or give two folders"
        )
    if chosen.pairs is None:
        return [(chosen.predicted, chosen.target)]
    with chosen.pairs.open(newline="", encoding="utf-8-sig") as file:
        rows = list(csv.DictReader(file, dialect="excel-tab"))
    if not rows or not all(row.get(name) for row in rows for name in PAIR):
        raise ValueError(
            f"{chosen.pairs} lacks an entry or all rows; the columns predicted and target are needed, with a header, "
            "separated by tabs"
        )
    return [tuple(chosen.pairs.parent / row[name] for name in PAIR) for row in rows]


def _record(chosen: argparse.Namespace, predicted: Path, target: Path, quiet: bool = False) -> dict:
    """The results for one pair, with inputs, settings and version. Prints the table unless it is quiet."""
    from meshot.metrics import rigidly_aligned
    from meshot.provenance import file_digest

    n_emd_points = chosen_emd_points(chosen)
    inputs = {
        name: {"path": str(path), "sha256": file_digest(path)}
        for name, path in zip(PAIR, (predicted, target), strict=True)
    }
    mesh, truth = meshot.read_mesh(predicted), meshot.read_mesh(target)
    moved = rigidly_aligned(mesh, truth, generator=chosen.seed) if chosen.align else None
    found = meshot.evaluate(
        moved.mesh if moved else mesh, truth, chosen.points, chosen.seed, n_emd_points, chosen.emd_blur
    )
    if not quiet and "-" not in (chosen.json, chosen.tsv):
        print(found)
        if moved:
            print(f"aligned by ICP: turned by {moved.turn_degrees:.3g} degrees, residue {moved.residue:.3g} mm")
    if chosen.definitions:
        print(f"\n{found.definitions()}", file=sys.stderr if "-" in (chosen.json, chosen.tsv) else sys.stdout)
        chosen.definitions = False
    settings = {"points": chosen.points, "emd_points": n_emd_points, "emd_blur": chosen.emd_blur, "seed": chosen.seed}
    settings["align"] = chosen.align
    record = {"version": meshot.__version__, "inputs": inputs, "settings": settings, "metrics": found.as_dict()}
    return record | ({RESIDUE: moved.residue} if moved else {})


def _table(records: list[dict]) -> str:
    """The results as tab-separated text: one row per pair, with its paths, then every metric and its floor."""
    text = io.StringIO()
    writer = csv.writer(text, dialect="excel-tab", lineterminator="\n")
    names = [f"{name}{end}" for name in records[0]["metrics"] for end in ("", "_floor")]
    residue = [RESIDUE] if RESIDUE in records[0] else []
    writer.writerow([*PAIR, *residue, *names, "seed", "version"])
    for record in records:
        numbers = [metric[key] for metric in record["metrics"].values() for key in ("value", "floor")]
        paths = [record["inputs"][name]["path"] for name in PAIR]
        residues = [record[name] for name in residue]
        writer.writerow([*paths, *residues, *numbers, record["settings"]["seed"], record["version"]])
    return text.getvalue()


def _write(place: str, text: str) -> None:
    if place == "-":
        print(text, end="")
        return
    from meshot.files import write_whole

    write_whole(place, text)
