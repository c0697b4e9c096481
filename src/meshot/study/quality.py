"""One HTML page that shows the slices and the numbers of all subjects of a study, for quality control."""

import base64
import csv
import dataclasses
import hashlib
import io
import json
import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from urllib.parse import quote

import numpy as np

from meshot.anatomy import HEMISPHERES
from meshot.files import printable_name, write_whole
from meshot.pipeline import OVERVIEW, PAGE, REPORT, doubts_in_words
from meshot.statistics import OUTLIER_SCORE, robust_scores
from meshot.study.bids import json_of
from meshot.view import filled

# The table of a study, ``subjects.tsv``, and its data dictionary, ``subjects.json``, as BIDS writes tables.

TABLE, DICTIONARY = "subjects.tsv", "subjects.json"
#: How BIDS writes a value that is missing.
MISSING = "n/a"

#: Column, after the side -> where the value is in ``report.json`` (under ``surfaces`` and the side), factor,
#: description, unit. A surface that was not looked for has no values.
_SURFACE_COLUMNS = {
    "white_vertices": (("final", "n_vertices"), 1, "Number of vertices, {side} white surface", None),
    "white_faces": (("final", "n_faces"), 1, "Number of faces, {side} white surface", None),
    "white_euler": (("final", "euler_number"), 1, "Euler number; a sphere has 2, {side} white surface", None),
    "white_self_intersecting_faces": (
        ("final", "n_self_intersecting_faces"),
        1,
        "Number of faces that intersect another face, {side} white surface",
        None,
    ),
    "white_area_mm2": (("final", "area_cm2"), 100, "Area, {side} white surface", "mm^2"),
    "white_volume_mm3": (("final", "volume_cm3"), 1000, "Enclosed volume, {side} white surface", "mm^3"),
    "white_distance_from_initial_mm": (
        ("distance_from_initial_mm", "mean"),
        1,
        "Mean distance of the vertices from the initial surface, {side} white surface",
        "mm",
    ),
    "white_voxels_given_up": (
        ("n_voxels_given_up",),
        1,
        "Voxels of white matter that were left out to give the surface genus 0, {side} white surface",
        None,
    ),
    "pial_area_mm2": (("pial", "area_cm2"), 100, "Area, {side} pial surface", "mm^2"),
    "thickness_mm": (("pial", "mean_thickness_mm"), 1, "Mean thickness of the {side} cortex, by area", "mm"),
    "cortex_volume_mm3": (
        ("pial", "cortex_volume_cm3"),
        1000,
        "Volume between the white and the pial surface, {side}",
        "mm^3",
    ),
}
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
    "doubts": {
        "Description": "Lobes with unusual numbers, and what is unusual: a bias of the intensities, low contrast, "
        "a cut through white matter, a repaired surface, or an unusual shape"
    },
}
_BEFORE, _AFTER = list(_OTHER_COLUMNS)[:6], list(_OTHER_COLUMNS)[6:]


def surface_columns() -> list[str]:
    """The names of the columns with numbers of the surfaces, such as ``left_white_area_mm2``."""
    return [f"{side}_{name}" for side in HEMISPHERES for name in _SURFACE_COLUMNS]


def columns() -> list[str]:
    """The names of all columns, in order."""
    return [*_BEFORE, *surface_columns(), *_AFTER]


def data_dictionary() -> dict[str, dict]:
    """What each column holds, with its unit, as BIDS describes tables."""
    found = dict(_OTHER_COLUMNS)
    for side in HEMISPHERES:
        for name, (_, _, description, unit) in _SURFACE_COLUMNS.items():
            entry = {"Description": description.format(side=side)}
            found[f"{side}_{name}"] = entry | ({"Units": unit} if unit else {})
    return {name: found[name] for name in columns()}


def numbers_of_report(report: Mapping) -> dict[str, float]:
    """The numbers of the surfaces, the time and the warnings of one reconstruction, by column."""
    row = {}
    for side in HEMISPHERES:
        for name, (keys, factor, _, _) in _SURFACE_COLUMNS.items():
            value = report["surfaces"][side]
            for key in keys:
                value = None if value is None else value[key]
            row[f"{side}_{name}"] = value if factor == 1 or value is None else value * factor
    row["seconds"] = round(sum(report["seconds"]["clock"].values()), 2)
    row["warnings"] = len(report["warnings"])
    return row


def row_of_report(study: Path, file: Path, report: Mapping) -> dict:
    """The row of a reconstruction whose ``report.json`` is this file, without participant and session."""
    return {
        "status": "done",
        "report": file.with_name(PAGE).relative_to(study).as_posix(),
        "warning_names": " ".join(report["warning_names"]),
        "doubts": doubts_in_words(report.get("doubts", {})),
    } | numbers_of_report(report)


def _row_of_scan(folder: Path) -> dict | None:
    """The row of the only reconstruction in the folder of one scan; None if the folder is none."""
    file = next((path for path in (folder / REPORT, folder / "report" / REPORT) if path.is_file()), None)
    if file is None or (folder / TABLE).exists():
        return None
    try:
        return {"participant_id": folder.resolve().name} | row_of_report(folder, file, json_of(file))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{file} is no record of a reconstruction (it lacks {error}); reconstruct it again") from error


def write_subjects(folder: str | os.PathLike, rows: Iterable[Mapping]) -> None:
    """Write the table and its data dictionary into the folder of a study, sorted by participant and session.

    The rows are mappings by column. What is missing or None becomes ``n/a``.

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
    write_whole(Path(folder) / TABLE, text.getvalue())
    write_whole(Path(folder) / DICTIONARY, json.dumps(data_dictionary(), indent=1) + "\n")


def read_subjects(folder: str | os.PathLike) -> list[dict]:
    """The rows of the table of a study, from its folder. Numbers are floats; what is missing is None.

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


# The columns of a quality page: the numbers of a study with robust scores.

#: Robust scores are computed if there are at least so many rows: fewer have no reliable median deviation.
FEWEST_SUBJECTS = 5
#: Stands for an infinite score where rows are sorted: JSON has no infinity.
_LARGEST = 1e6
#: Columns with scores. Seconds depend on the machine and its load, and have none.
_SCORED = (*surface_columns(), "warnings")
_THIN_SPACE = "\u202f"
_UNITS = {"mm": "(mm)", "mm2": "(mm²)", "mm3": "(mm³)"}


@dataclasses.dataclass(frozen=True, eq=False)
class QualityColumn:
    """One column: what is shown of every row, what it is sorted by, and its robust scores."""

    label: str
    description: str
    texts: list[str]
    sorted_as: list[float | str | None]  # numbers or strings; None for a missing value
    scores: list[float]  # naN where there is none

    def is_odd(self, row: int) -> bool:
        """Whether the robust score of a row is beyond 3.5."""
        return abs(self.scores[row]) > OUTLIER_SCORE

    def score_text(self, row: int) -> str:
        """The robust score of a row, with its sign. It is infinite if most values of the column are equal."""
        score = self.scores[row]
        text = "∞" if math.isinf(score) else f"{abs(score):.1f}"
        return ("−" if score < 0 else "+") + text


def quality_columns(subjects: list[dict]) -> list[QualityColumn]:
    """All columns of the page: the name, the largest score, status, every number, and the verdict, which is empty."""
    known = data_dictionary()
    numbers = {
        name: np.array([np.nan if row.get(name) is None else row[name] for row in subjects], dtype=np.float64)
        for name in (*surface_columns(), "seconds", "warnings")
        if any(row.get(name) is not None for row in subjects)
    }
    measured, largest = [], np.full(len(subjects), np.nan)
    for name, values in numbers.items():
        scores = np.full(len(values), np.nan)
        if name in _SCORED and np.count_nonzero(~np.isnan(values)) >= FEWEST_SUBJECTS:
            scores = robust_scores(values)
        largest = np.fmax(largest, np.abs(scores))
        *words, unit = name.replace("_white", "").split("_")
        label, entry = " ".join([*words, _UNITS.get(unit, unit)]), known[name]
        description = entry["Description"] + (f" ({entry['Units']})" if "Units" in entry else "")
        plain = [None if np.isnan(value) else float(value) for value in values]
        measured.append(QualityColumn(label, description, [_text(x) for x in plain], plain, scores.tolist()))
    # The largest absolute score of each row, without a mark of its own.
    texts = ["" if np.isnan(value) else "∞" if np.isinf(value) else f"{value:.1f}" for value in largest]
    sorted_as = [None if np.isnan(value) else min(float(value), _LARGEST) for value in largest]
    no_scores = [math.nan] * len(subjects)
    return [
        _words("participant", "Participant and session", [_name(row) for row in subjects]),
        QualityColumn("largest |z|", "The largest robust z of the row", texts, sorted_as, no_scores),
        _words("status", known["status"]["Description"], [row.get("status") or "" for row in subjects]),
        *measured,
        _words("verdict", "Given on this page", [""] * len(subjects)),
    ]


def row_key(subject: dict) -> str:
    """Twelve hexadecimal digits that change if the participant, the session or a number of the surfaces changes."""
    kept = {name: value for name, value in subject.items() if name not in ("seconds", "report")}
    return hashlib.sha256(json.dumps(kept, sort_keys=True).encode()).hexdigest()[:12]


def _words(label: str, description: str, texts: list[str]) -> QualityColumn:
    return QualityColumn(label, description, texts, [text or None for text in texts], [math.nan] * len(texts))


def _text(value: float | None) -> str:
    if value is None:
        return ""
    if float(value).is_integer() or abs(value) >= 1000:
        return f"{round(value):,}".replace(",", _THIN_SPACE).replace("-", "−")
    return f"{value:.3g}".replace("-", "−")


#: The name of the page in the folder of a study.
QUALITY_PAGE = "quality.html"
_UP, _DOWN = "▲", "▼"


def write_quality_page(study: str | os.PathLike, embed: bool = False) -> Path:
    """Write the page ``quality.html`` into the folder of a study.

    It shows the slices of every subject in a mosaic and all numbers in a table, both sorted by any column. Values whose
    robust score is beyond 3.5 are marked, see ``meshot.statistics.robust_scores``. Verdicts are given by keys or
    buttons, kept in the browser, and downloaded as a table. The page needs no network. By default the pictures are
    the files ``slices.webp`` beside the reports.

    Parameters
    ----------
    study : path
        A folder with ``subjects.tsv``, see :func:`meshot.study.read_subjects`; or the folder of one scan.
    embed : bool
        Whether the page holds the pictures, some 25 kB for each subject. It can then be read elsewhere; the links to
        the reports lead to files beside it.


    Raises
    ------
    ValueError
        If the table is missing, cannot be read, or has no rows.
    """
    study = Path(study)
    row = _row_of_scan(study)
    subjects = read_subjects(study) if row is None else [row]
    if not subjects:
        raise ValueError(f"the table of {study} has no rows; reconstruct a subject first: meshot reconstruct")
    columns = quality_columns(subjects)
    failed = sum(_failed(subject) for subject in subjects)
    warned = sum(_warned(subject) for subject in subjects)
    marking = f"Values beyond ±{OUTLIER_SCORE} are marked, compared with this study only."
    n_done = len(subjects) - failed
    if n_done < FEWEST_SUBJECTS:
        marking = f"It is not computed here: {FEWEST_SUBJECTS} rows with surfaces are needed, and there are {n_done}."
    page = filled(
        "meshot/study/assets/quality.html",
        study=printable_name(study.resolve().name),
        summary=f"{len(subjects)} rows: {failed} failed, {warned} with warnings.",
        marking=marking,
        limit=OUTLIER_SCORE,
        columns=columns,
        rows=[_row(study, subject, columns, i, embed) for i, subject in enumerate(subjects)],
        data={
            "subjects": [
                {
                    "name": _name(subject),
                    "participant": subject["participant_id"],
                    "session": subject.get("session_id"),
                    "key": row_key(subject),
                    "odd": any(column.is_odd(i) for column in columns),
                    "warned": _warned(subject),
                    "failed": _failed(subject),
                    "values": [column.sorted_as[i] for column in columns],
                }
                for i, subject in enumerate(subjects)
            ],
            "first": 1,
            "file": "verdicts.tsv",
        },
    )
    path = study / QUALITY_PAGE
    write_whole(path, page)
    return path


def _failed(subject: dict) -> bool:
    return subject.get("status") == "failed"


def _warned(subject: dict) -> bool:
    return (subject.get("warnings") or 0) > 0


def _name(subject: dict) -> str:
    return " ".join(filter(None, (subject["participant_id"], subject.get("session_id"))))


def _row(study: Path, subject: dict, columns: list[QualityColumn], row: int, embed: bool) -> dict:
    """What the template of the page shows of a row."""
    path = study / (subject.get("report") or "")  # a table may name a file outside the study
    report = path if path.is_file() and path.resolve().is_relative_to(study.resolve()) else None
    picture, shown = report and report.parent / OVERVIEW, None
    if picture and picture.is_file():
        data = base64.b64encode(picture.read_bytes()).decode() if embed else None
        shown = f"data:image/webp;base64,{data}" if embed else _address(study, picture)
    reasons = [
        f"{column.label} {column.texts[row]}, robust z {column.score_text(row)}"
        for column in columns
        if column.is_odd(row)
    ]
    if _warned(subject):
        reasons.append(f"warnings: {subject.get('warning_names') or round(subject['warnings'])}")
    return {
        "name": _name(subject),
        "report": report and _address(study, report),
        "picture": shown,
        "error": subject.get("error"),
        "reasons": reasons,
        "cells": [
            {
                "text": column.texts[row],
                "mark": (_UP if column.scores[row] > 0 else _DOWN) if column.is_odd(row) else None,
                "score": column.score_text(row),
            }
            for column in columns[1:]
        ],
    }


def _address(study: Path, path: Path) -> str:
    return quote(os.fsencode(path.relative_to(study).as_posix()))
