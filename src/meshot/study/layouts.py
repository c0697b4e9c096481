"""Where the files of a study stand: flat folders, FreeSurfer's SUBJECTS_DIR, or BIDS derivatives."""

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

import meshot
from meshot.anatomy import HEMISPHERES, mni152_t1
from meshot.files import printable_name, write_whole
from meshot.mesh import write_mesh
from meshot.pipeline import (
    FLAT_REGIONS,
    SHORT,
    TEMPLATE,
    Reconstruction,
    itk_transform,
    lta_transform,
    structure_of,
    white_matter_labels,
    write_flat,
    write_regions,
)
from meshot.study.bids import Visit
from meshot.volume import Volume, centre_ras, resample, write_volume

# The flat layout: a folder for each visit with the files that ``meshot reconstruct SCAN -o OUT`` writes.


def arrange_flat(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write surfaces, transforms and labels, and the scan if it is an average."""
    write_flat(folder, found, scan)
    if len(visit.scans) > 1:
        write_volume(folder / "scan.nii.gz", scan)


# FreeSurfer's SUBJECTS_DIR: ``sub-01/surf/lh.white``, ``mri/orig.mgz``, ``mri/transforms``, ``scripts``.
#
# ``mri/orig.mgz`` is the scan on FreeSurfer's conformed grid: 256 voxels of 1 mm along each axis, 8 bits, around the
# centre of the scan. Surface RAS of this grid is the space of the surfaces. ``mri/rawavg.mgz`` is the scan as it came.

N_VOXELS = 256
#: The values of ``mri/filled.mgz`` for the left and the right hemisphere.
FILLED = (255, 127)
#: The initial surface is called as FreeSurfer calls the surface before it moves.
_NAMES = {"initial": "orig", "fsaverage5": "white.fsaverage5"}
_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def arrange_freesurfer(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write ``surf`` and ``mri``."""
    for side, surface in found.surfaces.items():
        for kind, mesh in surface.meshes().items():
            write_mesh(folder / "surf" / f"{SHORT[side]}.{_NAMES.get(kind, kind)}", mesh, centre_ras(scan))
    conformed = conformed_scan(scan)
    write_volume(folder / "mri" / "rawavg.mgz", scan)
    write_volume(folder / "mri" / "orig.mgz", conformed)
    write_volume(folder / "mri" / "filled.mgz", white_matter_labels(found, conformed, FILLED, genus_zero=True))
    stats = {key: f"stats/{name}" for key, name in FLAT_REGIONS.items()}
    stats |= {"labels": "label/{short}.aparc.annot", "thickness": "surf/{short}.thickness"}
    write_regions(folder, found, stats, visit.label)
    transforms = folder / "mri" / "transforms"
    transforms.mkdir()
    lta = lta_transform(found.registered.to_standard, conformed, "orig.mgz", mni152_t1())
    (transforms / f"orig_to_{TEMPLATE}.lta").write_text(lta, encoding="utf-8")
    (transforms / f"orig_to_{TEMPLATE}.txt").write_text(itk_transform(found.registered.to_standard), encoding="utf-8")


def conformed_scan(scan: Volume) -> Volume:
    """A scan on FreeSurfer's conformed grid, linearly interpolated, with 8 bits."""
    # Its smallest value becomes 0, and the value below which 99.9 % of the voxels lie becomes 255.
    affine = np.eye(4)
    affine[:3, :3] = _AXES
    affine[:3, 3] = centre_ras(scan) - _AXES @ np.full(3, N_VOXELS / 2)
    low, high = float(scan.data.min()), float(np.percentile(scan.data, 99.9))
    image = resample(scan, (N_VOXELS,) * 3, affine, outside="lowest")
    scaled = 255 * (image.data - low) / max(high - low, 1e-12)
    return image.with_data(np.clip(np.rint(scaled), 0, 255).astype(np.uint8))


def finish_freesurfer(folder: Path, visit: Visit, report: dict) -> None:
    """Write the log of the stages into ``scripts``."""
    lines = [f"meshot reconstruct, {report['date']}, commit {report['commit']}"]
    lines += [f"scan {path}" for path in visit.scans] + list(visit.notes)
    seconds = report["seconds"]
    lines += [
        f"{stage}: {seconds['clock'][stage]} s, {seconds['processor'][stage]} s of processor time"
        for stage in seconds["clock"]
    ]
    lines += [f"warning: {warning}" for warning in report["warnings"]]
    scripts = folder / "scripts"
    scripts.mkdir()
    (scripts / "meshot.log").write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")


# BIDS derivatives: ``sub-01/anat/sub-01_hemi-L_white.surf.gii`` with sidecars, and the files of the data set.

VERSION = "1.10.0"
#: What the specification does not describe: pages, tables and logs of the study, transforms, and surfaces.
IGNORED = (
    "*.html",
    "subjects.*",
    "regions.*",
    "verdicts*.tsv",
    "logs/",
    "report",
    "*_xfm.*",
    "*.surf.gii",
    "*_white.json",
    "*_pial.json",
    "*_midthickness.json",
    "*_morph.*",
    "*.label.gii",
    "*.shape.gii",
)
_LABELS = "index\tname\tabbreviation\n1\tLeft cerebral white matter\tlWM\n2\tRight cerebral white matter\trWM\n"


def arrange_bids(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write ``anat``."""
    anat = folder / "anat"
    anat.mkdir()
    facts = {"Sources": [_source(visit, path) for path in visit.scans]}
    for side in HEMISPHERES:
        surface, start = found.surfaces[side], f"{visit.prefix}_hemi-{side[0].upper()}"
        for kind, mesh in surface.meshes().items():
            name = f"{start}_{kind}" if kind in ("white", "pial", "midthickness") else f"{start}_desc-{kind}_white"
            write_mesh(anat / f"{name}.surf.gii", mesh, structure=structure_of(side, kind))
            _write_json(anat / f"{name}.json", facts | {"SpatialReference": "scanner RAS of the T1w image, in mm"})
    atlas = "atlas-DesikanKilliany"
    regions = {
        "table": f"{visit.prefix}_{atlas}_morph",
        "labels": f"{visit.prefix}_hemi-{{side}}_{atlas}_dseg.label.gii",
    }
    regions["thickness"] = f"{visit.prefix}_hemi-{{side}}_thickness.shape.gii"
    write_regions(anat, found, regions, visit.label)
    start = anat / f"{visit.prefix}_desc-whitematter_dseg"
    write_volume(start.with_name(f"{start.name}.nii.gz"), white_matter_labels(found, scan))
    said = {"Description": "White matter, 1 on the left and 2 on the right", "Manual": False}
    grid = {"SpatialReference": facts["Sources"][0]}
    _write_json(start.with_name(f"{start.name}.json"), facts | said | grid)
    start.with_name(f"{start.name}.tsv").write_text(_LABELS, encoding="utf-8")
    if len(visit.scans) > 1:
        write_volume(anat / f"{visit.prefix}_desc-average_T1w.nii.gz", scan)
        said = {"Description": "Average of registered runs, on the grid of the first"}
        said["SkullStripped"] = visit.mask is not None
        _write_json(anat / f"{visit.prefix}_desc-average_T1w.json", facts | said)
    transform = anat / f"{visit.prefix}_from-T1w_to-{TEMPLATE}_mode-image_xfm"
    transform.with_name(f"{transform.name}.txt").write_text(
        itk_transform(found.registered.to_standard), encoding="utf-8"
    )
    lta = lta_transform(found.registered.to_standard, scan, printable_name(visit.scans[0].name), mni152_t1())
    transform.with_name(f"{transform.name}.lta").write_text(lta, encoding="utf-8")


def begin_bids(study: Path, dataset: Path | None) -> None:
    """Write the description of the derivatives, ``.bidsignore`` and a README, unless they are there."""
    description = {
        "Name": "Surfaces of the cortex by meshot"
        + ("" if dataset is None else f" of {printable_name(dataset.resolve().name)}"),
        "BIDSVersion": VERSION,
        "DatasetType": "derivative",
        "GeneratedBy": [{"Name": "meshot", "Version": meshot.__version__}],
    }
    if dataset is not None:
        description["DatasetLinks"] = {"raw": printable_name(os.path.relpath(dataset, study))}
    for name, text in (
        ("dataset_description.json", json.dumps(description, indent=1, ensure_ascii=False) + "\n"),
        (".bidsignore", "\n".join(IGNORED) + "\n"),
        ("README.md", f"# {description['Name']}\n\nWritten by `meshot reconstruct`. Not for clinical use.\n"),
    ):
        if not (study / name).exists():
            write_whole(study / name, text)


def _source(visit: Visit, path: Path) -> str:
    """A BIDS URI of a scan in the raw data set, or the name of a file from elsewhere."""
    there = path.parts[-len(visit.parts) - 2 : -1]
    return f"bids:raw:{'/'.join([*there, path.name])}" if there == (*visit.parts, "anat") else printable_name(path.name)


def _write_json(path: Path, content: dict) -> None:
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


# The layouts by name.


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
        Writes what needs the report; by default nothing.
    begin : callable
        Writes the files of the whole study; by default none.
    """

    name: str
    folder: Callable[[Visit], Path]
    report_folder: Path
    arrange: Callable[[Path, Reconstruction, Volume, Visit], None]
    finish: Callable[[Path, Visit, dict], None] = lambda folder, visit, report: None
    begin: Callable[[Path, Path | None], None] = lambda study, dataset: None


def _by_label(visit: Visit) -> Path:
    """For example ``sub-01_ses-02``."""
    return Path(visit.label)


LAYOUTS = {
    "flat": Layout("flat", _by_label, Path(), arrange_flat),
    "freesurfer": Layout("freesurfer", _by_label, Path("report"), arrange_freesurfer, finish_freesurfer),
    "bids": Layout("bids", lambda visit: Path(*visit.parts), Path("report"), arrange_bids, begin=begin_bids),
}


def layout_named(name: str) -> Layout:
    """A layout by its name.

    Raises
    ------
    ValueError
        If there is none of this name.
    """
    if name not in LAYOUTS:
        raise ValueError(f"there is no layout {name!r}; known are {', '.join(LAYOUTS)}")
    return LAYOUTS[name]
