"""A reconstruction from a scan to a folder: surfaces, transform, numbers and a page to look at."""

import json
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from meshot.anatomy import Hemisphere, mni152_t1
from meshot.files import printable_name, whole_folder
from meshot.mesh import write_mesh
from meshot.metrics import vertex_distances
from meshot.pipeline.networks import TrainedNetworks
from meshot.pipeline.reconstruction import Reconstruction, reconstruct
from meshot.pipeline.report.exchange import itk_transform, lta_transform, white_matter_labels
from meshot.pipeline.report.given_up import given_up_pictures
from meshot.pipeline.report.numbers import numbers_of_scan, numbers_of_surface
from meshot.pipeline.report.page import reconstruction_page
from meshot.pipeline.report.pictures import overview, slice_pictures, surface_view
from meshot.pipeline.stages import StageClock
from meshot.pipeline.warning_table import warning_names
from meshot.provenance import provenance
from meshot.volume import Volume, centre_ras, masked_scan, read_volume, write_volume

REPORT, TIMING, TRANSFORM, PAGE = "report.json", "timing.json", "to_standard.json", "report.html"
#: A small picture of all slices, for a page about many subjects.
OVERVIEW = "slices.webp"
FORMATS = ("", ".surf.gii", ".ply")
SHORT = {"left": "lh", "right": "rh"}
WHITE_MATTER, ITK, LTA = "white_matter.nii.gz", "to_standard.txt", "to_standard.lta"
#: Writes everything but texts and pictures into a folder, and returns the folder for texts and pictures.
Arrange = Callable[[Path, Reconstruction, Volume], Path]


def write_reconstruction(
    path: str | os.PathLike,
    folder: str | os.PathLike,
    networks: TrainedNetworks,
    replace: bool = False,
    template: Volume | None = None,
    *,
    brain_mask: str | os.PathLike | None = None,
    strict: bool = False,
    quiet: bool = False,
    correspondence: bool = False,
) -> dict:
    """Reconstruct the surfaces of a scan and write everything, with a progress bar; whole or not at all.

    Into ``folder`` go, for each side, the surfaces ``white`` and ``initial`` (``pial``, if the system finds it, and
    ``fsaverage5``, if asked for) in scanner RAS, as FreeSurfer, GIfTI and PLY; white matter on the grid of the scan
    (1 left, 2 right); the transform as JSON, for ITK and for FreeSurfer; and ``report.json``, ``timing.json``, the
    picture ``slices.webp``, and ``report.html``, which needs nothing beside it.

    Parameters
    ----------
    path : path
        Of a T1, in any format that nibabel knows.
    folder : path
        New or empty; or an earlier reconstruction, if ``replace``.
    networks : TrainedNetworks
    template : Volume, optional
        As in :func:`meshot.pipeline.reconstruct`.
    replace : bool
    brain_mask : path, optional
        Of a volume on the grid of the scan; what lies where it is zero is left out.
    strict : bool
        As in :func:`meshot.pipeline.reconstruct`.
    quiet : bool
        Whether there is no progress bar.
    correspondence : bool
        As in :func:`meshot.pipeline.reconstruct`.

    Returns
    -------
    dict
        What ``report.json`` holds.

    Raises
    ------
    ValueError
        If the scan, the folder or a number will not do.
    """
    path, folder = Path(path), Path(folder)
    _require_free(folder, replace)
    scan = read_volume(path)
    if brain_mask is not None:
        scan = masked_scan(scan, read_volume(brain_mask))
    with whole_folder(folder, replace) as temporary, tqdm(unit="stage", leave=False, delay=0.1, disable=quiet) as bar:

        def tell(stage: str, n_done: int, n_stages: int) -> None:
            bar.total = n_stages + 2
            bar.set_description(stage or "surfaces, numbers, pictures", refresh=False)
            bar.update(n_done - bar.n)
            bar.refresh()

        found = reconstruct(scan, networks.segmentation, networks.system, tell, template, strict, correspondence)
        masked_by = None if brain_mask is None else printable_name(Path(brain_mask).name)
        return write_found(temporary, found, scan, printable_name(path.name), networks, {"brain_mask": masked_by})


def write_found(
    folder: Path,
    found: Reconstruction,
    scan: Volume,
    name: str,
    networks: TrainedNetworks,
    facts: Mapping | None = None,
    arrange: Arrange | None = None,
) -> dict:
    """Write a reconstruction into a folder that exists: surfaces, transform, labels, numbers and the page.

    Parameters
    ----------
    folder : pathlib.Path
    found : Reconstruction
    scan : Volume
    name : str
        What the page calls the scan.
    networks : TrainedNetworks
    facts : mapping, optional
        More entries of ``report.json``.
    arrange : callable, optional
        Writes surfaces, transform and labels, and returns the folder of the page. By default everything goes into the
        folder itself.

    Returns
    -------
    dict
        What ``report.json`` holds.
    """
    clock = StageClock(2)
    with clock.stage("surfaces and numbers"):
        distances = {side: vertex_distances(s.final, s.initial) for side, s in found.surfaces.items()}
        place = (arrange or write_flat)(folder, found, scan)
        report = _report(found, scan, name, networks, distances) | dict(facts or {})
    with clock.stage("pictures"):
        slices, given_up = slice_pictures(found, scan), given_up_pictures(found, scan)
        view = surface_view(found, distances)
        (place / OVERVIEW).write_bytes(overview(found, scan))
    report["seconds"] = {
        "processor": _rounded(found.cpu_seconds | clock.cpu_seconds),
        "clock": _rounded(found.wall_seconds | clock.wall_seconds),
        "threads": torch.get_num_threads(),
    }
    _write_texts(place, report, reconstruction_page(report, slices, given_up, view))
    return report


def structure_of(side: Hemisphere, name: str) -> tuple[str, str]:
    """The names by which Connectome Workbench knows a surface.

    Parameters
    ----------
    side : str
    name : str
        Such as "white", "initial" or "pial". All but "pial" are white surfaces.
    """
    return f"Cortex{side.capitalize()}", "Pial" if name == "pial" else "GrayWhite"


def _require_free(folder: Path, replace: bool) -> None:
    """Refuse before minutes are spent; and never take away what is no reconstruction."""
    if not folder.is_dir() or not any(folder.iterdir()):
        return
    if not replace:
        raise ValueError(f"{folder} exists and is not empty; choose another folder, or replace it with --overwrite")
    if not (folder / REPORT).is_file() or not (folder / PAGE).is_file():
        raise ValueError(f"{folder} holds no reconstruction, and is not replaced; choose another folder")


def write_flat(folder: Path, found: Reconstruction, scan: Volume) -> Path:
    """Write surfaces, white matter and transforms into a folder, without texts and pictures; returns the folder.

    Parameters
    ----------
    folder : pathlib.Path
    found : Reconstruction
    scan : Volume
    """
    for side, surface in found.surfaces.items():
        for name, mesh in surface.meshes().items():
            for suffix in FORMATS:
                write_mesh(folder / f"{SHORT[side]}.{name}{suffix}", mesh, centre_ras(scan), structure_of(side, name))
    write_volume(folder / WHITE_MATTER, white_matter_labels(found, scan))
    (folder / ITK).write_text(itk_transform(found.registered.to_standard), encoding="utf-8")
    (folder / LTA).write_text(lta_transform(found.registered.to_standard, scan, "scan", mni152_t1()), encoding="utf-8")
    return folder


def _report(
    found: Reconstruction, scan: Volume, name: str, networks: TrainedNetworks, distances: dict[str, np.ndarray]
) -> dict:
    return {
        "scan": numbers_of_scan(scan, name),
        "warnings": list(found.warnings),
        "warning_names": warning_names(found.warnings),
        "surfaces": {side: numbers_of_surface(s, distances[side]) for side, s in found.surfaces.items()},
        "system": found.system,
        "to_standard": found.registered.to_standard.tolist(),
        "weights": networks.records,
    } | provenance()


def _write_texts(folder: Path, report: dict, page: str) -> None:
    transform = {
        "from": f"scanner RAS of {report['scan']['name']}, in mm",
        "to": "MNI152, in mm",
        "matrix": report["to_standard"],
    }
    for name, content in ((REPORT, report), (TIMING, report["seconds"]), (TRANSFORM, transform)):
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        (folder / name).write_text(text + "\n", encoding="utf-8")
    (folder / PAGE).write_text(page, encoding="utf-8")


def _rounded(seconds: dict[str, float]) -> dict[str, float]:
    return {name: round(value, 2) for name, value in seconds.items()}
