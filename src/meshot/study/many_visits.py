"""All visits of a study: in several processes, with failures recorded, and a table at the end."""

import concurrent.futures
import contextlib
import json
import multiprocessing
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from tqdm import tqdm

import meshot
from meshot.errors import require_positive_integer
from meshot.files import printable_name, whole_file
from meshot.pipeline.report import PAGE, REPORT
from meshot.study.json_file import json_of
from meshot.study.layouts import layout_named
from meshot.study.one_visit import StudySettings, reconstruct_visit
from meshot.study.study_log import LOGS, add_to_log, visit_lines, when_written
from meshot.study.subjects_table import numbers_of_report, write_subjects
from meshot.study.visits import Visit
from meshot.workers import begin_worker

#: The table may take this share of the time of a run.
_TABLE_SHARE = 0.05
_Outcome = tuple[Visit, str | None]


def reconstruct_study(
    visits: Sequence[Visit],
    study: Path,
    settings: StudySettings | None = None,
    jobs: int = 1,
    dataset: Path | None = None,
    tell: Callable[[str], None] | None = tqdm.write,
    detail: bool = False,
) -> list[Visit]:
    """Reconstruct visits, each whole or not at all, and write the table of the study.

    What an earlier run finished is kept. A visit that fails does not stop the others: the reason stands in the table
    and in ``logs``, and the next run tries it again. ``logs/meshot.log`` gets a line for each visit, with the seconds
    of its stages.

    Parameters
    ----------
    visits : sequence of Visit
    study : pathlib.Path
        The folder of the study, new or from an earlier run.
    settings : StudySettings, optional
    jobs : int
        Number of processes. In one process, all threads of the processor are used.
    dataset : pathlib.Path, optional
        The BIDS data set that the scans come from.
    tell : callable, optional
        Called with a line of text for each visit. If None, there is no progress bar either.
    detail : bool
        Whether the line has the seconds of each stage.

    Returns
    -------
    list of Visit
        Those that failed.

    Raises
    ------
    ValueError
        If there is no visit, or the folder is the data set itself or cannot be written to.
    """
    settings = settings or StudySettings()
    require_positive_integer(jobs, "jobs")
    if not visits:
        raise ValueError("there is no visit to reconstruct; choose other participants or sessions")
    if dataset is not None and study.resolve() == dataset.resolve():
        raise ValueError(f"{study} is the data set itself; name another folder, such as {study / 'derivatives/meshot'}")
    _require_writable(study)
    layout_named(settings.layout).begin(study, dataset)
    write_table(study)  # what cannot be read is found before the first scan
    add_to_log(study, f"meshot {meshot.__version__}: {len(visits)} visits, layout {settings.layout}, {jobs} processes")
    earlier = {visit.label: when_written(study, visit, settings.layout) for visit in visits}
    failed, spent, started = [], 0.0, time.perf_counter()
    with tqdm(total=len(visits), unit="visit", disable=True if tell is None else None) as bar:
        for visit, error in _outcomes(visits, study, settings, jobs, bar):
            _record(study, visit, error)
            failed += [] if error is None else [visit]
            line, stages = visit_lines(study, visit, settings.layout, error, earlier[visit.label])
            add_to_log(study, line + stages)
            if tell is not None:
                tell(line + stages * detail)
            bar.update()
            if spent <= _TABLE_SHARE * (time.perf_counter() - started):
                before = time.perf_counter()
                write_table(study)
                spent += time.perf_counter() - before
    write_table(study)
    add_to_log(study, f"{len(visits) - len(failed)} done, {len(failed)} failed")
    return failed


def write_table(study: Path) -> list[dict]:
    """Write the table of a study from what stands in its folder, and return its rows.

    Parameters
    ----------
    study : pathlib.Path

    Raises
    ------
    ValueError
        If a report or a record of a failure cannot be read.
    """
    rows = {}
    done = (f"sub-*/{REPORT}", f"sub-*/report/{REPORT}", f"sub-*/ses-*/report/{REPORT}")
    for pattern in (f"{LOGS}/sub-*_error.json", *done):
        for file in sorted(study.glob(pattern)):
            with contextlib.suppress(FileNotFoundError):  # another run may just have replaced it
                row = _row(study, file)
                rows[row["participant_id"], row["session_id"]] = row
    found = list(rows.values())
    write_subjects(study, found)
    return found


def _row(study: Path, file: Path) -> dict:
    report = json_of(file)
    try:
        if file.parent.name == LOGS:
            return {name: report[name] for name in ("participant_id", "session_id", "error", "scans")} | {
                "status": "failed"
            }
        return {
            "participant_id": report["participant_id"],
            "session_id": report["session_id"],
            "status": "done",
            "scans": " ".join(report["scans"]),
            "report": file.with_name(PAGE).relative_to(study).as_posix(),
            "warning_names": " ".join(report["warning_names"]),
        } | numbers_of_report(report)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{file} is no record of a visit (it lacks {error}); remove it, or its folder") from error


def _require_writable(study: Path) -> None:
    try:
        study.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=study):
            pass
    except OSError as error:
        raise ValueError(
            f"{study} cannot be written to ({error.strerror}); choose another folder, or give yourself the permission"
        ) from error


def _record(study: Path, visit: Visit, error: str | None) -> None:
    """Keep the reason of a failure, or remove that of an earlier one."""
    file = study / LOGS / f"{visit.label}_error.json"
    if error is None:
        file.unlink(missing_ok=True)
        return
    record = {
        "participant_id": visit.parts[0],
        "session_id": visit.parts[1] if visit.session else None,
        "error": error,
        "scans": " ".join(printable_name(path.name) for path in visit.scans),
    }
    with whole_file(file) as temporary:
        temporary.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _outcomes(
    visits: Sequence[Visit], study: Path, settings: StudySettings, jobs: int, bar: tqdm
) -> Iterator[_Outcome]:
    """Each visit with the reason of its failure, as they end."""
    if jobs == 1:
        for visit in visits:

            def show(stage: str, n_done: int, n_stages: int, label: str = visit.label) -> None:
                bar.set_description(f"{label}, {stage or 'files'}")

            yield visit, _trial(visit, study, settings, show)
        return
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        processes = _Processes()
        futures = {pool.submit(processes.run, visit, study, settings): visit for visit in visits}
        try:
            for future in concurrent.futures.as_completed(futures):
                yield futures[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)
            processes.end()


class _Processes:
    """A process for each thread, so that a process that is killed takes only its own visit with it."""

    def __init__(self):
        self.own, self.all = threading.local(), []

    def run(self, visit: Visit, study: Path, settings: StudySettings) -> str | None:
        if getattr(self.own, "pool", None) is None:
            context = multiprocessing.get_context("spawn")
            self.own.pool = concurrent.futures.ProcessPoolExecutor(1, context, begin_worker)
            self.all.append(self.own.pool)
        try:
            return self.own.pool.submit(_trial, visit, study, settings).result()
        except BrokenProcessPool:
            self.own.pool = None
            return "its process was ended from outside, perhaps for want of memory; use fewer --jobs"

    def end(self) -> None:
        for pool in self.all:
            pool.shutdown(cancel_futures=True)


def _trial(visit: Visit, study: Path, settings: StudySettings, progress: Callable | None = None) -> str | None:
    """The reason why a visit failed; None if it did not."""
    try:
        reconstruct_visit(visit, study, settings, progress)
    except Exception as error:  # one visit must not stop the others
        known = isinstance(error, ValueError | OSError | ImportError)
        reason = str(error) if known else f"{type(error).__name__}: {error} (process {os.getpid()})"
        # A doubt about the scan may explain the failure.
        return " ".join([reason, *(f"(Warning: {warning})" for warning in visit.warnings)])
    return None
