"""All visits of a study: in several processes, with failures recorded, and a table at the end."""

import concurrent.futures
import contextlib
import csv
import dataclasses
import datetime
import functools
import io
import json
import multiprocessing
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import torch
from tqdm import tqdm

import meshot
from meshot.anatomy import mni152_t1
from meshot.errors import require_positive_integer
from meshot.files import printable_name, whole_folder, write_whole
from meshot.pipeline import (
    REPORT,
    Progress,
    QualityWarning,
    TrainedNetworks,
    average_warnings,
    file_warnings,
    load_networks,
    reconstruct,
    require_no_warnings,
    seconds_by_stage,
    write_found,
)
from meshot.provenance import file_digest
from meshot.study.bids import Visit, json_of
from meshot.study.layouts import Layout, layout_named
from meshot.study.quality import MISSING, data_dictionary, row_of_report, write_subjects
from meshot.volume import Volume, averaged_scan, masked_scan, read_volume_and_facts
from meshot.workers import begin_worker

# One visit of a study: from its scans to its folder, whole or not at all.


@dataclasses.dataclass(frozen=True)
class StudySettings:
    """What is the same for all visits of a study.

    Parameters
    ----------
    layout : str
        "flat", "freesurfer" or "bids".
    system, weights, segmentation, initial_only, white_only
        As :func:`meshot.pipeline.load_networks` takes them.
    strict : bool
        Whether a warning is a failure.
    overwrite : bool
        Whether earlier results of other scans or settings are replaced.
    threads : int, optional
        Of the processor, in each process.
    device : str, optional
        Where the networks compute, see :func:`meshot.pipeline.load_networks`.
    correspondence : bool
        As :func:`meshot.pipeline.reconstruct` takes it.
    """

    layout: str = "flat"
    system: str | None = None
    weights: Path | None = None
    segmentation: Path | None = None
    initial_only: bool = False
    strict: bool = False
    overwrite: bool = False
    threads: int | None = None
    device: str | None = None
    correspondence: bool = False
    white_only: bool = False


@functools.lru_cache(maxsize=1)
def _networks(settings: StudySettings) -> TrainedNetworks:
    names = (settings.system, settings.weights, settings.segmentation)
    return load_networks(*names, settings.initial_only, settings.device, settings.white_only)


def reconstruct_visit(visit: Visit, study: Path, settings: StudySettings, progress: Progress | None = None) -> dict:
    """Reconstruct a visit into its folder, or find that this was done before from the same scans and settings."""
    if visit.trouble or not visit.scans:
        raise ValueError(visit.trouble or f"{visit.label} has no scan; at least one is needed")
    if settings.threads is not None:
        torch.set_num_threads(settings.threads)
    networks, layout = _networks(settings), layout_named(settings.layout)
    folder = study / layout.folder(visit)
    files = {printable_name(path.name): file_digest(_present(path)) for path in visit.scans}
    mask = None if visit.mask is None else {printable_name(visit.mask.name): file_digest(_present(visit.mask))}
    facts = {  # what the result depends on, as report.json keeps it
        "participant_id": visit.parts[0],
        "session_id": visit.parts[1] if visit.session else None,
        "scans": files,
        "mask": mask,
        "notes": list(visit.notes),
        "system": None if networks.system is None else networks.system.name,
        "weights": networks.records,
        "correspondence": settings.correspondence,
    }
    earlier = _earlier_report(folder, layout, facts, settings)
    if earlier is not None:
        return earlier
    warnings, distinct = list(visit.warnings), {}
    for path in visit.scans:
        digest = file_digest(path)
        if digest in distinct:
            text = f"{distinct[digest].name} and {path.name} hold the same scan; it is used once"
            warnings.append(QualityWarning("same_file_twice", text))
        distinct.setdefault(digest, path)
    paths = list(distinct.values())
    scans = []
    for path in [*paths, *([] if visit.mask is None else [visit.mask])]:
        volume, said = read_volume_and_facts(path)
        scans.append(volume)
        warnings += file_warnings(path, said)
    if settings.strict:
        require_no_warnings(warnings)
    scan = averaged_scan(scans[: len(paths)], [path.name for path in paths])
    if visit.mask is not None:
        scan = masked_scan(scan, scans[-1])
    template = mni152_t1()
    found = reconstruct(
        scan, networks.segmentation, networks.system, progress, template, settings.strict, settings.correspondence
    )
    warnings += average_warnings(found.registered, template)
    if settings.strict:
        require_no_warnings(warnings)
    found = dataclasses.replace(found, warnings=(*warnings, *found.warnings))

    def arrange(place: Path, result: object, image: Volume) -> Path:
        layout.arrange(place, result, image, visit)
        (place / layout.report_folder).mkdir(exist_ok=True)
        return place / layout.report_folder

    try:
        with whole_folder(folder, replace=folder.is_dir()) as temporary:
            finish = functools.partial(layout.finish, temporary, visit)
            report = write_found(temporary, found, scan, visit.label, networks, facts, arrange, finish)
    except ValueError:  # another run of the same study may have ended first, with the same result
        earlier = _earlier_report(folder, layout, facts, settings)
        if earlier is None:
            raise
        return earlier
    return report


def _present(path: Path) -> Path:
    if path.is_symlink() and not path.exists():
        raise ValueError(f"{path} is a link to a file that is not here; get it first, for example with datalad get")
    if path.is_file() and not os.access(path, os.R_OK):
        raise ValueError(f"{path} cannot be read (Permission denied); give yourself the permission")
    return path


def _earlier_report(folder: Path, layout: Layout, facts: dict, settings: StudySettings) -> dict | None:
    """The report of an earlier run from the same scans with the same networks; None if there is none."""
    if not folder.is_dir() or not any(folder.iterdir()):
        return None
    file = folder / layout.report_folder / REPORT
    if not file.is_file():
        raise ValueError(f"{folder} holds something else than a reconstruction, and is kept; choose another folder")
    report = json_of(file)
    wanted = json.loads(json.dumps(facts))
    other = [key for key in ("scans", "mask", "system", "weights") if report.get(key) != wanted[key]]
    if wanted["correspondence"] and not report.get("correspondence"):
        other.append("choice of --template")
    if not other:
        if settings.strict:
            texts = zip(report["warning_names"], report["warnings"], strict=True)
            require_no_warnings(QualityWarning(name, text) for name, text in texts)
        return report
    if not settings.overwrite:
        raise ValueError(
            f"{folder} was made before with another {' and another '.join(other)}; choose another folder, or replace "
            "it with --overwrite"
        )
    return None


#: The regions of all visits in the folder of a study.
REGIONS = "regions.tsv"
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
    try:
        study.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=study):
            pass
    except OSError as error:
        raise ValueError(
            f"{study} cannot be written to ({error.strerror}); choose another folder, or give yourself the permission"
        ) from error
    layout_named(settings.layout).begin(study, dataset)
    write_table(study)  # what cannot be read is found before the first scan
    add_to_log(study, f"meshot {meshot.__version__}: {len(visits)} visits, layout {settings.layout}, {jobs} processes")
    earlier = {visit.label: when_written(study, visit, settings.layout) for visit in visits}
    failed, spent, started = [], 0.0, time.perf_counter()
    with tqdm(total=len(visits), unit="visit", disable=True if tell is None else None) as bar:
        for visit, error in _outcomes(visits, study, settings, jobs, bar):
            # Keep the reason of a failure, or remove that of an earlier one.
            file = study / LOGS / f"{visit.label}_error.json"
            if error is None:
                file.unlink(missing_ok=True)
            else:
                failed.append(visit)
                record = {"participant_id": visit.parts[0], "session_id": visit.parts[1] if visit.session else None}
                record |= {"error": error, "scans": " ".join(printable_name(path.name) for path in visit.scans)}
                write_whole(file, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
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
    """Write the tables of a study from what stands in its folder, and return the rows of ``subjects.tsv``.

    ``regions.tsv`` has the regions of all visits, if there are any: a row for each region of each side.

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
    _write_regions_of_all(study, found)
    return found


#: The tables of a visit in all layouts, from the folder of the page.
_REGION_TABLES = ("regions.tsv", "../stats/regions.tsv", "../anat/*_morph.tsv")


def _write_regions_of_all(study: Path, rows: list[dict]) -> None:
    """The regions of all visits in one table, as BIDS writes tables."""
    regions, used, about = [], [], {}
    for row in sorted(rows, key=lambda row: (row["participant_id"], row["session_id"] or "")):
        place = (study / row["report"]).parent if "report" in row else study / LOGS
        for file in (found for pattern in _REGION_TABLES for found in sorted(place.glob(pattern))):
            lines = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines(), dialect="excel-tab"))
            about |= json_of(file.with_suffix(".json"))
            used += [name for name in (lines[0] if lines else ()) if name not in used]
            regions += [
                {name: row[name] or MISSING for name in ("participant_id", "session_id")} | line for line in lines
            ]
    if not regions:
        return
    columns, text = ["participant_id", "session_id", *used], io.StringIO()
    writer = csv.DictWriter(text, columns, restval=MISSING, dialect="excel-tab", lineterminator="\n")
    writer.writeheader()
    writer.writerows(regions)
    described = {name: data_dictionary().get(name) or about[name] for name in columns}
    write_whole(study / REGIONS, text.getvalue())
    write_whole((study / REGIONS).with_suffix(".json"), json.dumps(described, indent=1, ensure_ascii=False) + "\n")


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
            "scans": " ".join(report["scans"]),
        } | row_of_report(study, file, report)
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{file} is no record of a visit (it lacks {error}); remove it, or its folder") from error


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


# The log of a study: a line with the time for each visit, and for the start and the end of each run.

#: The folder of the log and of the records of failures, in the folder of a study.
LOGS = "logs"
LOG = "meshot.log"


def add_to_log(study: Path, text: str) -> None:
    """Append a line with the time (UTC) to the log of a study."""
    # Several processes may append at the same time: each line is written at once.
    place = study / LOGS / LOG
    place.parent.mkdir(exist_ok=True)
    now = datetime.datetime.now(datetime.UTC)
    with place.open("a", encoding="utf-8") as file:
        file.write(f"{now:%Y-%m-%dT%H:%M:%SZ} {' '.join(text.split())}\n")


def when_written(study: Path, visit: Visit, layout: str) -> int | None:
    """When the report of a visit was written, in ns; None if there is none."""
    file = _report_file(study, visit, layout)
    return file.stat().st_mtime_ns if file.is_file() else None


def visit_lines(study: Path, visit: Visit, layout: str, error: str | None, earlier: int | None) -> tuple[str, str]:
    """What became of a visit, and the seconds of its stages if they were run now."""
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
