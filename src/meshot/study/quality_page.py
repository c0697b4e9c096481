"""One HTML page that shows the slices and the numbers of all subjects of a study, for quality control."""

import base64
import os
from pathlib import Path
from urllib.parse import quote

from meshot.files import printable_name, whole_file
from meshot.pipeline.report import OVERVIEW
from meshot.statistics import OUTLIER_SCORE
from meshot.study.quality_numbers import FEWEST_SUBJECTS, QualityColumn, quality_columns, row_key
from meshot.study.subjects_table import read_subjects
from meshot.view import filled

#: The name of the page in the folder of a study.
QUALITY_PAGE = "quality.html"
_UP, _DOWN = "▲", "▼"


def write_quality_page(study: str | os.PathLike, embed: bool = False) -> Path:
    """Write the page ``quality.html`` into the folder of a study.

    It shows the slices of every subject in a mosaic and all numbers in a table, both sorted by any column. Values whose
    robust score is beyond 3.5 are marked, see :func:`meshot.statistics.robust_scores`. Verdicts are given by keys or
    buttons, kept in the browser, and downloaded as a table. The page needs no network. By default the pictures are
    the files ``slices.webp`` beside the reports.

    Parameters
    ----------
    study : path
        A folder with ``subjects.tsv``, see :func:`meshot.study.read_subjects`.
    embed : bool
        Whether the page holds the pictures, some 25 kB for each subject. It can then be read elsewhere; the links to
        the reports lead to files beside it.

    Returns
    -------
    pathlib.Path
        The page.

    Raises
    ------
    ValueError
        If the table is missing, cannot be read, or has no rows.
    """
    study = Path(study)
    subjects = read_subjects(study)
    if not subjects:
        raise ValueError(f"the table of {study} has no rows; reconstruct a subject first: meshot reconstruct")
    columns = quality_columns(subjects)
    page = filled(
        "meshot/study/assets/quality.html",
        study=printable_name(study.resolve().name),
        summary=_summary(subjects),
        marking=_marking(sum(not _failed(subject) for subject in subjects)),
        limit=OUTLIER_SCORE,
        columns=columns,
        rows=[_row(study, subject, columns, i, embed) for i, subject in enumerate(subjects)],
        data={
            "subjects": [_subject(subject, columns, i) for i, subject in enumerate(subjects)],
            "first": 1,
            "file": "verdicts.tsv",
        },
    )
    path = study / QUALITY_PAGE
    with whole_file(path) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return path


def _summary(subjects: list[dict]) -> str:
    failed = sum(_failed(subject) for subject in subjects)
    warned = sum(_warned(subject) for subject in subjects)
    return f"{len(subjects)} rows: {failed} failed, {warned} with warnings."


def _marking(n_measured: int) -> str:
    if n_measured < FEWEST_SUBJECTS:
        return f"It is not computed here: {FEWEST_SUBJECTS} rows with surfaces are needed, and there are {n_measured}."
    return f"Values beyond ±{OUTLIER_SCORE} are marked, compared with this study only."


def _failed(subject: dict) -> bool:
    return subject.get("status") == "failed"


def _warned(subject: dict) -> bool:
    return (subject.get("warnings") or 0) > 0


def _name(subject: dict) -> str:
    return " ".join(filter(None, (subject["participant_id"], subject.get("session_id"))))


def _subject(subject: dict, columns: list[QualityColumn], row: int) -> dict:
    """What the script of the page knows of a row."""
    return {
        "name": _name(subject),
        "participant": subject["participant_id"],
        "session": subject.get("session_id"),
        "key": row_key(subject),
        "odd": any(column.is_odd(row) for column in columns),
        "warned": _warned(subject),
        "failed": _failed(subject),
        "values": [column.sorted_as[row] for column in columns],
    }


def _row(study: Path, subject: dict, columns: list[QualityColumn], row: int, embed: bool) -> dict:
    """What the template of the page shows of a row."""
    report = _inside(study, subject.get("report"))
    picture = report and report.parent / OVERVIEW
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
        "picture": _picture(study, picture, embed) if picture and picture.is_file() else None,
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


def _inside(study: Path, name: str | None) -> Path | None:
    """A file that a table names, if it exists and is in the study."""
    path = study / (name or "")
    return path if path.is_file() and path.resolve().is_relative_to(study.resolve()) else None


def _address(study: Path, path: Path) -> str:
    return quote(os.fsencode(path.relative_to(study).as_posix()))


def _picture(study: Path, path: Path, embed: bool) -> str:
    if not embed:
        return _address(study, path)
    return f"data:image/webp;base64,{base64.b64encode(path.read_bytes()).decode()}"
