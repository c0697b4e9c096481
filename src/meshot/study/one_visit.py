"""One visit of a study: from its scans to its folder, whole or not at all."""

import dataclasses
import functools
import json
import os
from pathlib import Path

import torch

from meshot.anatomy import mni152_t1
from meshot.files import printable_name, whole_folder
from meshot.pipeline import Progress, TrainedNetworks, average_warnings, load_networks, reconstruct, warning_names
from meshot.pipeline.report import REPORT, write_found
from meshot.provenance import file_digest
from meshot.study.json_file import json_of
from meshot.study.layouts import Layout, layout_named
from meshot.study.visits import Visit
from meshot.volume import Volume, masked_scan, read_volume
from meshot.volume.averaging import averaged_scan


@dataclasses.dataclass(frozen=True)
class StudySettings:
    """What is the same for all visits of a study.

    Parameters
    ----------
    layout : str
        "flat", "freesurfer" or "bids".
    system, weights, segmentation, initial_only
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


@functools.lru_cache(maxsize=1)
def _networks(settings: StudySettings) -> TrainedNetworks:
    return load_networks(
        settings.system, settings.weights, settings.segmentation, settings.initial_only, settings.device
    )


def reconstruct_visit(visit: Visit, study: Path, settings: StudySettings, progress: Progress | None = None) -> dict:
    """Reconstruct a visit into its folder, or find that this was done before from the same scans and settings.

    Parameters
    ----------
    visit : Visit
    study : pathlib.Path
        The folder of the study.
    settings : StudySettings
    progress : callable, optional
        As in :func:`meshot.pipeline.reconstruct`.

    Returns
    -------
    dict
        What ``report.json`` holds.

    Raises
    ------
    ValueError
        If the visit has no scan, a file cannot be read, the reconstruction fails, or the folder holds something else.
    """
    if visit.trouble or not visit.scans:
        raise ValueError(visit.trouble or f"{visit.label} has no scan; at least one is needed")
    if settings.threads is not None:
        torch.set_num_threads(settings.threads)
    networks, layout = _networks(settings), layout_named(settings.layout)
    folder = study / layout.folder(visit)
    facts = _facts(visit, networks) | {"correspondence": settings.correspondence}
    earlier = _earlier_report(folder, layout, facts, settings)
    if earlier is not None:
        return earlier
    scan, warnings = _scan_of(visit)
    template = mni152_t1()
    found = reconstruct(
        scan, networks.segmentation, networks.system, progress, template, settings.strict, settings.correspondence
    )
    warnings += average_warnings(found.registered, template)
    if settings.strict:
        _require_none(warnings)
    found = dataclasses.replace(found, warnings=(*warnings, *found.warnings))

    def arrange(place: Path, result: object, image: Volume) -> Path:
        layout.arrange(place, result, image, visit)
        (place / layout.report_folder).mkdir(exist_ok=True)
        return place / layout.report_folder

    try:
        with whole_folder(folder, replace=folder.is_dir()) as temporary:
            report = write_found(temporary, found, scan, visit.label, networks, facts, arrange)
            layout.finish(temporary, visit, report)
    except ValueError:  # another run of the same study may have ended first, with the same result
        earlier = _earlier_report(folder, layout, facts, settings)
        if earlier is None:
            raise
        return earlier
    return report


def _facts(visit: Visit, networks: TrainedNetworks) -> dict:
    """What the result depends on, as ``report.json`` keeps it."""
    files = {printable_name(path.name): file_digest(_present(path)) for path in visit.scans}
    mask = None if visit.mask is None else {printable_name(visit.mask.name): file_digest(_present(visit.mask))}
    return {
        "participant_id": visit.parts[0],
        "session_id": visit.parts[1] if visit.session else None,
        "scans": files,
        "mask": mask,
        "notes": list(visit.notes),
        "system": None if networks.system is None else networks.system.name,
        "weights": networks.records,
    }


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
            _require_none(report["warnings"])
        return report
    if not settings.overwrite:
        raise ValueError(
            f"{folder} was made before with another {' and another '.join(other)}; choose another folder, or replace "
            "it with --overwrite"
        )
    return None


def _scan_of(visit: Visit) -> tuple[Volume, list[str]]:
    """The scan, or the average of the scans, inside the brain mask; and warnings."""
    warnings, distinct = list(visit.warnings), {}
    for path in visit.scans:
        digest = file_digest(path)
        if digest in distinct:
            warnings.append(f"{distinct[digest].name} and {path.name} hold the same scan; it is used once")
        distinct.setdefault(digest, path)
    paths = list(distinct.values())
    scan = averaged_scan([read_volume(path) for path in paths], [path.name for path in paths])
    return (scan if visit.mask is None else masked_scan(scan, read_volume(visit.mask))), warnings


def _require_none(warnings: list[str]) -> None:
    if warnings:
        names = ", ".join(warning_names(warnings))
        raise ValueError(f"{'; '.join(warnings)} ({names}). Without --strict this is a warning only")
