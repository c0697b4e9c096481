"""The output folder of a reconstruction: surfaces, transform, numbers, pictures, and an HTML page."""

import dataclasses
import json
import math
import os
import re
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import torch
from tqdm import tqdm

from meshot.anatomy import HEMISPHERES, Hemisphere, mni152_t1
from meshot.files import printable_name, whole_folder
from meshot.mesh import Mesh, face_areas, self_intersecting_faces, signed_volume, topology, vertex_areas, write_mesh
from meshot.metrics import corresponds, cortical_thickness, cortical_volumes, vertex_distances
from meshot.pipeline.lobes import doubts_of_lobes, lobe_numbers
from meshot.pipeline.page import given_up_pictures, overview, reconstruction_page, slice_pictures, surface_view
from meshot.pipeline.quality import file_warnings, require_no_warnings, voxels_given_up
from meshot.pipeline.reconstruction import HemisphereSurface, Reconstruction, StageClock, TrainedNetworks, reconstruct
from meshot.pipeline.regions import write_regions
from meshot.provenance import provenance
from meshot.types import Array, Float
from meshot.volume import Volume, centre_ras, masked_scan, read_volume_and_facts, resample, voxel_sizes, write_volume

# A reconstruction from a scan to a folder: surfaces, transform, numbers and a page to look at.

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

    Into ``folder`` go, for each side, the surfaces ``white`` and ``initial`` (``pial`` and ``midthickness``, if the
    system finds pial surfaces, and ``fsaverage5``, if asked for) in scanner RAS, as FreeSurfer, GIfTI and PLY; white
    matter on the grid of the scan (1 left, 2 right); the transform as JSON, for ITK and for FreeSurfer; and
    ``report.json``, ``timing.json``, the
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
    # Refuse before minutes are spent; and never take away what is no reconstruction.
    if folder.is_dir() and any(folder.iterdir()):
        if not replace:
            raise ValueError(f"{folder} exists and is not empty; choose another folder, or replace it with --overwrite")
        if not (folder / REPORT).is_file() or not (folder / PAGE).is_file():
            raise ValueError(f"{folder} holds no reconstruction, and is not replaced; choose another folder")
    scan, facts = read_volume_and_facts(path)
    warnings = file_warnings(path, facts)
    if brain_mask is not None:
        mask, facts = read_volume_and_facts(brain_mask)
        scan, warnings = masked_scan(scan, mask), warnings + file_warnings(Path(brain_mask), facts)
    if strict:
        require_no_warnings(warnings)
    with whole_folder(folder, replace) as temporary, tqdm(unit="stage", leave=False, delay=0.1, disable=quiet) as bar:

        def tell(stage: str, n_done: int, n_stages: int) -> None:
            bar.total = n_stages + 2
            bar.set_description(stage or "surfaces, numbers, pictures", refresh=False)
            bar.update(n_done - bar.n)
            bar.refresh()

        found = reconstruct(scan, networks.segmentation, networks.system, tell, template, strict, correspondence)
        found = dataclasses.replace(found, warnings=(*warnings, *found.warnings))
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
    finish: Callable[[dict], None] | None = None,
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
    finish : callable, optional
        Writes what needs the report, before the page, which lists all files.

    Returns
    -------
    dict
        What ``report.json`` holds.
    """
    clock = StageClock(2)
    with clock.stage("surfaces and numbers"):
        lobes = lobe_numbers(found, scan)
        distances = {side: vertex_distances(s.final, s.initial) for side, s in found.surfaces.items()}
        place = (arrange or write_flat)(folder, found, scan)
        report = {
            "scan": numbers_of_scan(scan, name),
            "warnings": [warning.text for warning in found.warnings],
            "warning_names": [warning.name for warning in found.warnings],
            "warning_values": [warning.value for warning in found.warnings],
            "surfaces": {side: numbers_of_surface(s, distances[side]) for side, s in found.surfaces.items()},
            "lobes": {  # a lobe that no part of the surface is near has no numbers
                side: {lobe: {k: None if math.isnan(v) else v for k, v in row.items()} for lobe, row in rows.items()}
                for side, rows in lobes.items()
            },
            "doubts": doubts_of_lobes(lobes),
            "system": found.system,
            "to_standard": found.registered.to_standard.tolist(),
            "weights": networks.records,
        }
        report |= provenance() | dict(facts or {})
    with clock.stage("pictures"):
        slices, given_up = slice_pictures(found, scan), given_up_pictures(found, scan)
        view = surface_view(found, distances)
        (place / OVERVIEW).write_bytes(overview(found, scan))
    report["seconds"] = {
        "processor": _rounded(found.cpu_seconds | clock.cpu_seconds),
        "clock": _rounded(found.wall_seconds | clock.wall_seconds),
        "threads": torch.get_num_threads(),
    }
    transform = {
        "from": f"scanner RAS of {report['scan']['name']}, in mm",
        "to": "MNI152, in mm",
        "matrix": report["to_standard"],
    }
    for file, content in ((REPORT, report), (TIMING, report["seconds"]), (TRANSFORM, transform)):
        text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
        (place / file).write_text(text + "\n", encoding="utf-8")
    if finish is not None:
        finish(report)
    page = reconstruction_page(report, slices, given_up, view, files_beside(folder, place))
    (place / PAGE).write_text(page, encoding="utf-8")
    return report


#: What the files of all layouts are, by the end of their names; the first that fits counts.
_ABOUT = (
    (
        r"[lr]h\.[\w.]*(white|pial|midthickness|initial|orig|fsaverage5)",
        "surfaces for FreeSurfer, in surface RAS; they say how it leads to the scanner",
    ),
    (r"\.surf\.gii", "surfaces as GIfTI, in scanner RAS"),
    (r"\.ply", "surfaces as PLY, in scanner RAS"),
    (r"(white_matter|_dseg)\.nii\.gz", "white matter on the grid of the scan, 1 on the left and 2 on the right"),
    (r"filled\.mgz", "white matter on the grid of orig.mgz, 255 on the left and 127 on the right"),
    (r"(rawavg\.mgz|scan\.nii\.gz|desc-average_T1w\.nii\.gz)", "the scan"),
    (r"orig\.mgz", "the scan on FreeSurfer's conformed grid"),
    (r"to_standard\.json", "the transform to MNI152"),
    (r"\.lta", "the same transform for FreeSurfer"),
    (r"(to_standard|_xfm|orig_to_\w+)\.txt", "the same transform for ITK"),
    (r"report\.json", "every number"),
    (r"timing\.json", "seconds of each stage"),
    (r"slices\.webp", "the slices above in one small picture"),
    (r"meshot\.log", "the stages, and warnings"),
    (
        r"(regions|_morph)\.(tsv|json)",
        "area, curvature, and with a pial surface thickness and volume, by region of the cortex",
    ),
    (r"aparc\.stats", "the same as FreeSurfer's tables"),
    (r"(aparc\.annot|\.label\.gii)", "the region of every vertex of the white surface"),
    (r"(thickness|\.shape\.gii)", "the thickness at every vertex of the white surface"),
    (r"\.(json|tsv)", "descriptions of the files that have the same name"),
)


def files_beside(folder: Path, place: Path) -> list[tuple[list[str], str]]:
    """The files in a folder, as seen from the folder of the page, with what they are."""
    found: dict[str, list[str]] = {about: [] for _, about in _ABOUT} | {"": []}
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and path.name != PAGE):
        name = printable_name(os.path.relpath(path, place))
        found[next((about for end, about in _ABOUT if re.search(f"{end}$", path.name)), "")].append(name)
    return [(names, about) for about, names in found.items() if names]


#: The files of the regions in the flat layout, see :func:`meshot.pipeline.write_regions`.
FLAT_REGIONS = {
    "table": "regions", "stats": "{short}.aparc.stats", "labels": "{short}.aparc.annot",
    "thickness": "{short}.thickness",
}  # fmt: skip


def structure_of(side: Hemisphere, name: str) -> tuple[str, str]:
    """The names by which Connectome Workbench knows a surface."""
    return f"Cortex{side.capitalize()}", {"pial": "Pial", "midthickness": "MidThickness"}.get(name, "GrayWhite")


def write_flat(folder: Path, found: Reconstruction, scan: Volume) -> Path:
    """Write surfaces, white matter and transforms into a folder, without texts and pictures; returns the folder."""
    for side, surface in found.surfaces.items():
        for name, mesh in surface.meshes().items():
            for suffix in FORMATS:
                write_mesh(folder / f"{SHORT[side]}.{name}{suffix}", mesh, centre_ras(scan), structure_of(side, name))
    write_volume(folder / WHITE_MATTER, white_matter_labels(found, scan))
    (folder / ITK).write_text(itk_transform(found.registered.to_standard), encoding="utf-8")
    (folder / LTA).write_text(lta_transform(found.registered.to_standard, scan, "scan", mni152_t1()), encoding="utf-8")
    write_regions(folder, found, FLAT_REGIONS)
    return folder


def _rounded(seconds: dict[str, float]) -> dict[str, float]:
    return {name: round(value, 2) for name, value in seconds.items()}


# Statistics of a reconstruction that need no ground truth, as plain numbers for JSON.


def numbers_of_scan(scan: Volume, name: str) -> dict:
    """Name, size, value range and affine of a scan."""
    return {
        "name": name,
        "n_voxels": list(scan.data.shape),
        "voxel_mm": voxel_sizes(scan).round(4).tolist(),
        "lowest_value": float(scan.data.min()),
        "highest_value": float(scan.data.max()),
        "affine": scan.affine.tolist(),
    }


def numbers_of_surface(surface: HemisphereSurface, distances: Float[Array, " V"]) -> dict:
    """Statistics of one hemisphere: all meshes, distances between them, and the repair."""
    n_lost, share = voxels_given_up(surface.segmented)
    repaired, carried, pial = surface.repaired, surface.carried, surface.pial
    repair = of_template = of_pial = None
    if pial is not None:
        distances_mm = {"distance_from_white_mm": _of_distances(vertex_distances(pial, surface.final))}
        of_pial = _of_mesh(pial) | distances_mm | {"mean_thickness_mm": None, "cortex_volume_cm3": None}
        if corresponds(surface.final, pial):
            areas = vertex_areas(surface.final).detach().cpu().numpy()
            of_pial["mean_thickness_mm"] = float(np.average(cortical_thickness(surface.final, pial), weights=areas))
            of_pial["cortex_volume_cm3"] = float(cortical_volumes(surface.final, pial).sum()) / 1000
    if carried is not None:
        of_template = {
            "n_vertices": len(carried.mesh.vertices),
            "distance_mm": carried.distance_mm,
            "n_faces_crossing_before": carried.n_crossing_before,
            "n_self_intersecting_faces": carried.n_crossing,
        }
    if repaired is not None:
        repair = {
            "n_faces_crossing_before": repaired.n_crossing,
            "n_backtracks": repaired.n_backtracks,
            "largest_move_mm": repaired.largest_move,
        }
    return {
        "initial": _of_mesh(surface.initial),
        "final": _of_mesh(surface.final),
        "distance_from_initial_mm": _of_distances(distances),
        "pial": of_pial,
        "fsaverage5": of_template,
        "n_voxels_given_up": n_lost,
        "share_of_voxels_given_up": share,
        "repair": repair,
    }


def _of_distances(distances: Float[Array, " V"]) -> dict:
    return {
        "mean": float(distances.mean()),
        "percentile_95": float(np.percentile(distances, 95)),
        "largest": float(distances.max()),
    }


def _of_mesh(mesh: Mesh) -> dict:
    found = topology(mesh)
    return {
        "n_vertices": len(mesh.vertices),
        "n_faces": len(mesh.faces),
        "euler_number": found.euler_number,
        "n_components": found.n_components,
        "n_boundary_edges": found.n_boundary_edges,
        "n_nonmanifold_edges": found.n_nonmanifold_edges,
        "n_self_intersecting_faces": len(self_intersecting_faces(mesh)),
        "volume_cm3": float(signed_volume(mesh)) / 1000,
        "area_cm2": float(face_areas(mesh).sum()) / 100,
    }


def seconds_by_stage(seconds: Mapping[str, float]) -> str:
    """The time of each stage and the total, such as ``registration 3.1 s, white matter 0.4 s, total 3.5 s``."""
    parts = [f"{stage} {value:.1f} s" for stage, value in seconds.items()]
    return ", ".join([*parts, f"total {sum(seconds.values()):.1f} s"])


# What other programs read beside surfaces: the transform for ITK and FreeSurfer, and white matter as labels.

_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])
#: What BIDS and TemplateFlow call the template of :func:`meshot.anatomy.mni152_t1`.
TEMPLATE = "MNI152NLin2009aSym"


def itk_transform(to_standard: Float[Array, "4 4"]) -> str:
    """The text of an ITK transform that resamples the scan to the template, for ANTs, SimpleITK and 3D Slicer.

    ITK counts in LPS, and its transforms take points of the image that is made to points of the image that is read:
    here points of the template to points of the scan. ``to_standard`` takes scanner RAS to the template, in mm.
    """
    matrix = _LPS @ np.linalg.inv(to_standard) @ _LPS
    numbers = " ".join(f"{value:.17g}" for value in [*matrix[:3, :3].ravel(), *matrix[:3, 3]])
    return (
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        f"Parameters: {numbers}\nFixedParameters: 0 0 0\n"
    )


def lta_transform(to_standard: Float[Array, "4 4"], scan: Volume, scan_name: str, template: Volume) -> str:
    """The text of a FreeSurfer transform (LTA, scanner RAS to scanner RAS) from the scan to the template.

    Parameters
    ----------
    to_standard : array
        Takes scanner RAS to the template, in mm.
    scan, template : Volume
        Their grids are written down.
    scan_name : str
        The file of the scan.
    """
    rows = "\n".join(" ".join(f"{value:.15e}" for value in row) for row in to_standard)
    return (
        "type      = 1 # LINEAR_RAS_TO_RAS\nnxforms   = 1\nmean      = 0.0000 0.0000 0.0000\nsigma     = 1.0000\n"
        f"1 4 4\n{rows}\nsrc volume info\n{_grid(scan, scan_name)}dst volume info\n{_grid(template, TEMPLATE)}"
    )


def _grid(volume: Volume, name: str) -> str:
    sizes = voxel_sizes(volume)
    axes = (volume.affine[:3, :3] / sizes).T
    lines = [
        "valid = 1  # volume info valid",
        f"filename = {name}",
        "volume = " + " ".join(map(str, volume.data.shape)),
        "voxelsize = " + " ".join(f"{value:.15e}" for value in sizes),
    ]
    for key, values in zip(("xras", "yras", "zras", "cras"), (*axes, centre_ras(volume)), strict=True):
        lines.append(f"{key}   = " + " ".join(f"{value:.15e}" for value in values))
    return "\n".join(lines) + "\n"


def white_matter_labels(
    found: Reconstruction, grid: Volume, values: tuple[int, int] = (1, 2), genus_zero: bool = False
) -> Volume:
    """White matter on a grid in scanner space: one value for the left, one for the right, 0 elsewhere.

    The segmentation is on the standard grid. It is interpolated linearly, and a voxel is inside above ½.

    Parameters
    ----------
    found : Reconstruction
    grid : Volume
        Its shape and affine count: usually the scan.
    values : two int
        For left and right.
    genus_zero : bool
        Whether to take the part that has the topology of a ball, from which the initial surface is made.
    """
    labels = np.zeros(grid.data.shape, dtype=np.uint8)
    for side, value in zip(HEMISPHERES, values, strict=True):
        segmented = found.surfaces[side].segmented
        mask = segmented.genus_zero_mask if genus_zero else segmented.mask
        inside = resample(mask, grid.data.shape, grid.affine, found.scan.to_standard)
        labels[inside.data > 0.5] = value
    return grid.with_data(labels)
