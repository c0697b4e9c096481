"""The log of a training: a file with one line of JSON per event."""

import json
import os
from pathlib import Path

from meshot.files import naming_a_full_disk, whole_file


class TrainingLog:
    """A file of JSON lines, one for each step and each validation.

    Parameters
    ----------
    path : path, optional
        With None, no file is written.
    lines : list of dict
        The lines of a resumed training. They replace the content of the file.
    """

    def __init__(self, path: Path | None, lines: list[dict]):
        self.path = path
        if path is not None:
            with whole_file(path) as temporary:
                temporary.write_text("".join(json.dumps(line) + "\n" for line in lines), encoding="utf-8")

    def add(self, line: dict) -> None:
        """Append a line to the file immediately."""
        if self.path is not None:
            with naming_a_full_disk(self.path), self.path.open("a", encoding="utf-8") as file:
                file.write(json.dumps(line) + "\n")


def read_log(path: str | os.PathLike) -> list[dict]:
    """The lines of a log. An incomplete last line, left by a killed process, is omitted.

    Raises
    ------
    ValueError
        If the file is missing or an inner line is not JSON.
    """
    path = Path(path)
    if not path.is_file():
        raise ValueError(f"{path} does not exist; a training writes it as it goes")
    text = path.read_text(encoding="utf-8", errors="replace")
    try:
        lines = [json.loads(line) for line in text[: text.rfind("\n") + 1].splitlines()]
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{path} is no log of a training ({error})") from error
    if not all(isinstance(line, dict) for line in lines):
        raise ValueError(f"{path} is no log of a training: a line holds no names and values")
    return lines
