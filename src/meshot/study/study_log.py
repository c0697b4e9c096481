"""The log of a study: a line with the time for each visit, and for the start and the end of each run."""

import datetime
from pathlib import Path

#: The folder of the log and of the records of failures, in the folder of a study.
LOGS = "logs"
LOG = "meshot.log"


def add_to_log(study: Path, text: str) -> None:
    """Append a line with the time (UTC) to the log of a study.

    Several processes may append at the same time: each line is written at once.

    Parameters
    ----------
    study : pathlib.Path
        The folder of the study.
    text : str
        Line breaks become spaces.
    """
    place = study / LOGS / LOG
    place.parent.mkdir(exist_ok=True)
    now = datetime.datetime.now(datetime.UTC)
    with place.open("a", encoding="utf-8") as file:
        file.write(f"{now:%Y-%m-%dT%H:%M:%SZ} {' '.join(text.split())}\n")
