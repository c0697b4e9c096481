"""The rows of measured surfaces as a table in a CSV file."""

import csv
from pathlib import Path

from meshot.files import whole_file
from meshot.provenance import rounded

#: The columns of texts.
TEXTS = {"cohort", "side", "subject", "session", "kind", "arm", "budget", "failed", "commit", "protocol", "which"}


def write_rows(path: Path, rows: list[dict]) -> None:
    """Write rows, with a column for every name that occurs. Missing values and None are empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, names, restval="", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rounded(rows))


def read_rows(path: Path) -> list[dict]:
    """Read rows. Empty values are None."""
    if not path.is_file():
        raise ValueError(f"{path} does not exist; measure the trained systems with run.py")
    with path.open(encoding="utf-8", newline="") as file:
        names, *lines = [line for line in csv.reader(file) if line] or [[]]

    def row(line: list[str]) -> dict:
        if len(line) != len(names):
            raise ValueError(f"a line has {len(line)} columns, and the first line {len(names)}: {','.join(line)[:60]}")
        return {name: _value(name, text) for name, text in zip(names, line, strict=True)}

    try:
        return [row(line) for line in lines]
    except ValueError as error:
        raise ValueError(f"{path} is damaged ({error}); take the committed file, or run run.py again") from error


def _value(name: str, text: str) -> str | int | float | None:
    if text == "":
        return None
    if name in TEXTS:
        return text
    return int(text) if text.lstrip("-").isdigit() else float(text)
