"""A student's record of all exercises that were tried: a file to hand in, and a line for the lecturer's table."""

import csv
import dataclasses
import io
import json
import re
from pathlib import Path

from meshot.files import write_whole
from meshot_book.exercises.verdict import RECORDS, Record


def report(student: str, folder: Path | str = ".") -> Path:
    """Write what the checkers found in this notebook, and print it as one line of CSV.

    The line holds the student, the points, the points that could be had, and the points of each exercise by its name.
    A record of the same student in the folder is added to, so that one file serves all chapters. It can be edited:
    ``python -m meshot_book.marks`` runs the answers again.

    Parameters
    ----------
    student : str
        Letters, digits, ``.``, ``-`` and ``_``: it becomes the name of two files, ``STUDENT.json`` and ``STUDENT.csv``.
    folder : path

    Returns
    -------
    pathlib.Path
        The JSON file.

    Raises
    ------
    ValueError
        If the name cannot be that of a file, no checker has run, or the record in the folder cannot be read.
    """
    if not re.fullmatch(r"[\w-][\w.-]*", student):
        raise ValueError(f"{student!r} cannot be the name of a file; letters, digits, '.', '-' and '_' are allowed")
    if not RECORDS:
        raise ValueError("no checker has run in this notebook; run the cells with check.NAME(...) first")
    file = Path(folder) / f"{student}.json"
    records = (read_report(file) if file.is_file() else {}) | RECORDS
    text = {"student": student, "records": [dataclasses.asdict(record) for record in records.values()]}
    line = io.StringIO()
    each = [f"{record.exercise}={record.points}" for record in records.values()]
    totals = [sum(record.points for record in records.values()), sum(record.of for record in records.values())]
    csv.writer(line, lineterminator="\n").writerow([student, *totals, *each])
    write_whole(file, json.dumps(text, indent=1) + "\n")
    write_whole(file.with_name(f"{student}.csv"), line.getvalue())
    print(line.getvalue(), end="")
    return file


def read_report(file: Path) -> dict[str, Record]:
    """Read the records in a file that :func:`report` has written, by exercise.

    Raises
    ------
    ValueError
        If it is no such file.
    """
    try:
        records = [Record(**record) for record in json.loads(file.read_text(encoding="utf-8"))["records"]]
        if not all(isinstance(number, int) for r in records for number in (r.cases, r.passed, r.points, r.of)):
            raise TypeError("a number is not an integer")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"{file} is no record of exercises ({error}); delete it, and run report(...) again") from error
    return {record.exercise: record for record in records}
