"""The log of a study: a line with the time for each visit, and for the start and the end of each run."""

import datetime
from pathlib import Path

from meshot.pipeline.report import REPORT, seconds_by_stage
from meshot.study.json_file import json_of
from meshot.study.layouts import layout_named
from meshot.study.visits import Visit

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


def when_written(study: Path, visit: Visit, layout: str) -> int | None:
    """When the report of a visit was written, in ns; None if there is none.

    Parameters
    ----------
    study : pathlib.Path
    visit : Visit
    layout : str
        "flat", "freesurfer" or "bids".
    """
    file = _report_file(study, visit, layout)
    return file.stat().st_mtime_ns if file.is_file() else None


def visit_lines(study: Path, visit: Visit, layout: str, error: str | None, earlier: int | None) -> tuple[str, str]:
    """What became of a visit, and the seconds of its stages if they were run now.

    Parameters
    ----------
    study : pathlib.Path
    visit : Visit
    layout : str
        "flat", "freesurfer" or "bids".
    error : str or None
        The reason of a failure.
    earlier : int or None
        What ``when_written`` gave before the run.
    """
    if error is not None:
        return f"{visit.label}: failed: {error}", ""
    if when_written(study, visit, layout) == earlier:
        return f"{visit.label}: done by an earlier run", ""
    report = json_of(_report_file(study, visit, layout))
    warned = f", with warnings: {', '.join(report['warning_names'])}" if report["warning_names"] else ""
    return f"{visit.label}: done{warned}", f" ({seconds_by_stage(report['seconds']['clock'])})"


def _report_file(study: Path, visit: Visit, layout: str) -> Path:
    chosen = layout_named(layout)
    return study / chosen.folder(visit) / chosen.report_folder / REPORT
