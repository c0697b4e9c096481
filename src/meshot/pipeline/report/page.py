"""The HTML page of a reconstruction: one file, usable offline, for light and dark mode and all screen widths."""

from collections.abc import Sequence

from meshot.pipeline.report.pictures import Picture
from meshot.view import filled

Rows = list[tuple]


def reconstruction_page(report: dict, slices: Sequence[Picture], given_up: Sequence[Picture], view: str) -> str:
    """The page as HTML.

    Parameters
    ----------
    report : dict
        As :func:`meshot.pipeline.report.write_reconstruction` writes it to ``report.json``.
    slices, given_up : sequence of Picture
        Of the surfaces, and of the white matter that was given up.
    view : str
        HTML of the surfaces.
    """
    return filled(
        "meshot/pipeline/report/assets/report.html",
        report=report,
        slices=slices,
        given_up=given_up,
        view=view,
        meshes=_mesh_rows(report),
        pial=_has_pial(report),
        moves=_move_rows(report),
        voxel_mm=" × ".join(f"{v:g}" for v in report["scan"]["voxel_mm"]),
        seconds=_second_rows(report["seconds"]),
        matrix="\n".join(" ".join(f"{value:11.6f}" for value in row) for row in report["to_standard"]),
        records="\n".join(f"{name}: {_record(record)}" for name, record in report["weights"].items()),
    )


def _has_pial(report: dict) -> bool:
    return all(numbers.get("pial") for numbers in report["surfaces"].values())


def _mesh_rows(report: dict) -> Rows:
    """The table of the meshes: a header, and a row for each number."""
    surfaces = report["surfaces"]
    meshes = [
        ("vertices", "n_vertices"), ("faces", "n_faces"), ("Euler number χ (a sphere has 2)", "euler_number"),
        ("edges of one face only", "n_boundary_edges"), ("edges of more than two faces", "n_nonmanifold_edges"),
        ("self-intersecting faces", "n_self_intersecting_faces"),
        ("volume inside (cm³)", "volume_cm3"), ("area (cm²)", "area_cm2"),
    ]  # fmt: skip
    stages = (("initial", "final") if report["system"] else ("initial",)) + ("pial",) * _has_pial(report)
    columns = [(side, stage) for side in surfaces for stage in stages]
    rows = [(label, *(_cell(surfaces[side][stage][key]) for side, stage in columns)) for label, key in meshes]
    return [("", *(f"{side}, {stage}" for side, stage in columns)), *rows]


def _move_rows(report: dict) -> Rows:
    """The table of deformation and repair: a header, and a row for each number of a hemisphere."""
    sides = report["surfaces"].values()
    rows = []
    if report["system"]:
        words = {"mean": "mean", "percentile_95": "95 % below", "largest": "largest"}
        rows = [
            (f"distance from the initial surface, {word} (mm)", *(s["distance_from_initial_mm"][key] for s in sides))
            for key, word in words.items()
        ]
    if _has_pial(report):
        away = [s["pial"]["distance_from_white_mm"] for s in sides]
        rows += [("distance of the pial from the final surface, mean (mm)", *(found["mean"] for found in away))]
    repairs = [s["repair"] for s in sides]
    if all(repairs):
        rows += [
            ("faces that crossed after the flow, before the repair", *(m["n_faces_crossing_before"] for m in repairs)),
            ("largest move by the repair (mm)", *(m["largest_move_mm"] for m in repairs)),
        ]
    carried = [s["fsaverage5"] for s in sides]
    if all(carried):
        rows += [
            ("distance of fsaverage5 carried here, mean (mm)", *(c["distance_mm"] for c in carried)),
            ("its faces that crossed before they were smoothed", *(c["n_faces_crossing_before"] for c in carried)),
            ("its self-intersecting faces", *(c["n_self_intersecting_faces"] for c in carried)),
        ]
    rows += [
        ("voxels given up for the topology of a ball", *(s["n_voxels_given_up"] for s in sides)),
        ("these, of the white matter (%)", *(100 * s["share_of_voxels_given_up"] for s in sides)),
    ]
    return [("", *report["surfaces"]), *((label, *map(_cell, values)) for label, *values in rows)]


def _second_rows(seconds: dict) -> Rows:
    """The table of times: a header, a row for each stage, and the total."""
    columns = [seconds["processor"], seconds["clock"]]
    rows = [(stage, *(_cell(column[stage]) for column in columns)) for stage in seconds["processor"]]
    total = ("in all", *(_cell(sum(column.values())) for column in columns))
    return [("stage", "processor (s)", "clock (s)"), *rows, total]


def _record(record: dict) -> str:
    known = [f"{key} {record[key]}" for key in ("commit", "date", "cohorts", "command") if key in record]
    return "; ".join(known) or "no record"


def _cell(value: float) -> str:
    if isinstance(value, float) and not abs(value) >= 1000:
        text = f"{value:.3g}"
        return "0" if float(text) == 0 else text  # never a minus zero
    return f"{round(value):,}".replace(",", "\u202f")
