"""The table of a study, ``subjects.tsv``, and its data dictionary, ``subjects.json``, as BIDS writes tables."""

import csv
import io
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from meshot.anatomy import HEMISPHERES
from meshot.files import whole_file

TABLE, DICTIONARY = "subjects.tsv", "subjects.json"
#: How BIDS writes a value that is missing.
MISSING = "n/a"

#: Column -> where the value is in ``report.json`` (under ``surfaces`` and the side), factor, description, unit.
_SURFACE_COLUMNS = {
    "vertices": (("final", "n_vertices"), 1, "Number of vertices", None),
    "faces": (("final", "n_faces"), 1, "Number of faces", None),
    "euler": (("final", "euler_number"), 1, "Euler number; a sphere has 2", None),
    "self_intersecting_faces": (
        ("final", "n_self_intersecting_faces"), 1, "Number of faces that intersect another face", None
    ),
    "area_mm2": (("final", "area_cm2"), 100, "Area", "mm^2"),
    "volume_mm3": (("final", "volume_cm3"), 1000, "Enclosed volume", "mm^3"),
    "distance_from_initial_mm": (
        ("distance_from_initial_mm", "mean"), 1, "Mean distance of the vertices from the initial surface", "mm"
    ),
    "voxels_given_up": (
        ("n_voxels_given_up",), 1, "Voxels of white matter that were left out to give the surface genus 0", None
    ),
}  # fmt: skip
_OTHER_COLUMNS = {
    "participant_id": {"Description": "The participant, such as sub-01"},
    "session_id": {"Description": "The session, such as ses-01"},
    "status": {
        "Description": "Whether the surfaces were found",
        "Levels": {"done": "The surfaces are complete", "failed": "There are no surfaces; see the column error"},
    },
    "error": {"Description": "Why there are no surfaces"},
    "scans": {"Description": "The files that were reconstructed, separated by a space"},
    "report": {"Description": "The page of the reconstruction, relative to this table"},
    "seconds": {"Description": "Wall-clock time of the reconstruction", "Units": "s"},
    "warnings": {"Description": "Number of warnings"},
    "warning_names": {"Description": "The names of the warnings, separated by a space"},
}
_BEFORE, _AFTER = list(_OTHER_COLUMNS)[:6], list(_OTHER_COLUMNS)[6:]


def surface_columns() -> list[str]:
    """The names of the columns with numbers of the surfaces, such as ``left_white_area_mm2``."""
    return [f"{side}_white_{name}" for side in HEMISPHERES for name in _SURFACE_COLUMNS]


def columns() -> list[str]:
    """The names of all columns, in order."""
    return [*_BEFORE, *surface_columns(), *_AFTER]


def data_dictionary() -> dict[str, dict]:
    """What each column holds, with its unit, as BIDS describes tables."""
    found = dict(_OTHER_COLUMNS)
    for side in HEMISPHERES:
        for name, (_, _, description, unit) in _SURFACE_COLUMNS.items():
            entry = {"Description": f"{description}, {side} white surface"}
            found[f"{side}_white_{name}"] = entry | ({"Units": unit} if unit else {})
    return {name: found[name] for name in columns()}


def numbers_of_report(report: Mapping) -> dict[str, float]:
    """The numbers of the surfaces, the time and the warnings of one reconstruction, by column.

    Parameters
    ----------
    report : mapping
        What ``report.json`` of the reconstruction holds.
    """
    row = {}
    for side in HEMISPHERES:
        for name, (keys, factor, _, _) in _SURFACE_COLUMNS.items():
            value = report["surfaces"][side]
            for key in keys:
                value = value[key]
            row[f"{side}_white_{name}"] = value if factor == 1 else value * factor
    row["seconds"] = round(sum(report["seconds"]["clock"].values()), 2)
    row["warnings"] = len(report["warnings"])
    return row


def write_subjects(folder: str | os.PathLike, rows: Iterable[Mapping]) -> None:
    """Write the table and its data dictionary, sorted by participant and session.

    Parameters
    ----------
    folder : path
        Of the study.
    rows : iterable of mappings
        By column. What is missing or None becomes ``n/a``.

    Raises
    ------
    ValueError
        If a row has a column that the data dictionary does not describe.
    """
    known, text = columns(), io.StringIO()
    writer = csv.writer(text, dialect="excel-tab", lineterminator="\n")
    writer.writerow(known)
    for row in sorted(rows, key=lambda row: (row["participant_id"], row.get("session_id") or "")):
        if unknown := sorted(set(row) - set(known)):
            raise ValueError(f"a row has the columns {', '.join(unknown)}; the table has only {', '.join(known)}")
        writer.writerow([_cell(row.get(name)) for name in known])
    with whole_file(Path(folder) / TABLE) as temporary:
        temporary.write_text(text.getvalue(), encoding="utf-8")
    with whole_file(Path(folder) / DICTIONARY) as temporary:
        temporary.write_text(json.dumps(data_dictionary(), indent=1) + "\n", encoding="utf-8")


def read_subjects(folder: str | os.PathLike) -> list[dict]:
    """The rows of the table of a study. Numbers are floats; what is missing is None.

    Parameters
    ----------
    folder : path
        Of the study.

    Raises
    ------
    ValueError
        If the table is missing, is not UTF-8, lacks the first column, has a line of another length, or holds a word
        where a number is needed.
    """
    path = Path(folder) / TABLE
    if not path.is_file():
        raise ValueError(f"{path} does not exist; name the folder of a study, as meshot reconstruct writes it")
    try:
        head, *lines = csv.reader(path.read_text(encoding="utf-8").splitlines(), dialect="excel-tab")
    except (UnicodeDecodeError, ValueError, csv.Error) as error:
        raise ValueError(
            f"{path} is no table in UTF-8 ({error}); make it again: meshot reconstruct ... group"
        ) from error
    if head[:1] != ["participant_id"]:
        raise ValueError(f"{path} starts with the column {head[:1]}; participant_id is needed: is it another table?")
    wrong = [number for number, line in enumerate(lines, 2) if len(line) != len(head)]
    if wrong:
        raise ValueError(f"line {wrong[0]} of {path} has not {len(head)} cells, as its first line; mend or remove it")
    numbers = {*surface_columns(), "seconds", "warnings"}
    return [{name: _value(name, cell, numbers, path) for name, cell in zip(head, line)} for line in lines]


def _cell(value: object) -> str:
    if value is None or value == "":
        return MISSING
    if isinstance(value, float):
        return f"{value:.8g}"
    return " ".join(str(value).split())  # no tab and no line break


def _value(name: str, cell: str, numbers: set[str], path: Path) -> str | float | None:
    if cell == MISSING:
        return None
    if name not in numbers:
        return cell
    try:
        return float(cell)
    except ValueError as error:
        raise ValueError(f"{path} holds {cell!r} in the column {name}; a number or {MISSING} is needed") from error
