"""The layouts by name."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

from meshot.pipeline import Reconstruction
from meshot.study.layouts import bids_derivatives, flat_folder, freesurfer_subject
from meshot.study.visits import Visit
from meshot.volume import Volume


@dataclasses.dataclass(frozen=True)
class Layout:
    """How one visit becomes a folder.

    Parameters
    ----------
    name : str
    folder : callable
        The folder of a visit, relative to that of the study.
    report_folder : callable
        The folder of the page and of ``report.json``, relative to the folder of the visit.
    arrange : callable
        Writes surfaces, transforms and labels.
    finish : callable
        Writes what needs the report.
    begin : callable
        Writes the files of the whole study.
    """

    name: str
    folder: Callable[[Visit], Path]
    report_folder: Path
    arrange: Callable[[Path, Reconstruction, Volume, Visit], None]
    finish: Callable[[Path, Visit, dict], None]
    begin: Callable[[Path, Path | None], None]


def _layout(name: str, module: object) -> Layout:
    return Layout(
        name, module.folder_of, module.REPORT_FOLDER, module.arrange, module.finish, module.begin
    )  # fmt: skip


LAYOUTS = {
    "flat": _layout("flat", flat_folder),
    "freesurfer": _layout("freesurfer", freesurfer_subject),
    "bids": _layout("bids", bids_derivatives),
}


def layout_named(name: str) -> Layout:
    """A layout by its name.

    Parameters
    ----------
    name : str

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    if name not in LAYOUTS:
        raise ValueError(f"there is no layout {name!r}; known are {', '.join(LAYOUTS)}")
    return LAYOUTS[name]
