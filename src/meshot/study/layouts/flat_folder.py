"""The flat layout: a folder for each visit with the files that ``meshot reconstruct SCAN -o OUT`` writes."""

from pathlib import Path

from meshot.pipeline import Reconstruction
from meshot.pipeline.report import write_flat
from meshot.study.visits import Visit
from meshot.volume import Volume, write_volume

REPORT_FOLDER = Path()


def folder_of(visit: Visit) -> Path:
    """For example ``sub-01_ses-02``."""
    return Path(visit.label)


def arrange(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write surfaces, transforms and labels, and the scan if it is an average."""
    write_flat(folder, found, scan)
    if len(visit.scans) > 1:
        write_volume(folder / "scan.nii.gz", scan)


def finish(folder: Path, visit: Visit, report: dict) -> None:
    """Nothing is left to write."""


def begin(study: Path, dataset: Path | None) -> None:
    """The study as a whole has no files of this layout."""
