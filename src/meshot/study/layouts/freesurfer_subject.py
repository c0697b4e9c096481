"""FreeSurfer's SUBJECTS_DIR: ``sub-01/surf/lh.white``, ``mri/orig.mgz``, ``mri/transforms``, ``scripts``.

``mri/orig.mgz`` is the scan on FreeSurfer's conformed grid: 256 voxels of 1 mm along each axis, 8 bits, around the
centre of the scan. Surface RAS of this grid is the space of the surfaces. ``mri/rawavg.mgz`` is the scan as it came.
"""

from pathlib import Path

import numpy as np
from scipy.ndimage import affine_transform

from meshot.anatomy import mni152_t1
from meshot.mesh import write_mesh
from meshot.pipeline import Reconstruction
from meshot.pipeline.report import SHORT, TEMPLATE, itk_transform, lta_transform, white_matter_labels
from meshot.study.visits import Visit
from meshot.volume import Volume, centre_ras, write_volume

REPORT_FOLDER = Path("report")
N_VOXELS = 256
#: The values of ``mri/filled.mgz`` for the left and the right hemisphere.
FILLED = (255, 127)
#: The initial surface is called as FreeSurfer calls the surface before it moves.
_NAMES = {"white": "white", "initial": "orig", "fsaverage5": "white.fsaverage5", "pial": "pial"}
_AXES = np.array([[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def folder_of(visit: Visit) -> Path:
    """For example ``sub-01_ses-02``."""
    return Path(visit.label)


def arrange(folder: Path, found: Reconstruction, scan: Volume, visit: Visit) -> None:
    """Write ``surf`` and ``mri``."""
    for side, surface in found.surfaces.items():
        for kind, mesh in surface.meshes().items():
            write_mesh(folder / "surf" / f"{SHORT[side]}.{_NAMES[kind]}", mesh, centre_ras(scan))
    conformed = conformed_scan(scan)
    write_volume(folder / "mri" / "rawavg.mgz", scan)
    write_volume(folder / "mri" / "orig.mgz", conformed)
    write_volume(folder / "mri" / "filled.mgz", white_matter_labels(found, conformed, FILLED, genus_zero=True))
    transforms = folder / "mri" / "transforms"
    transforms.mkdir()
    lta = lta_transform(found.registered.to_standard, conformed, "orig.mgz", mni152_t1())
    (transforms / f"orig_to_{TEMPLATE}.lta").write_text(lta, encoding="utf-8")
    (transforms / f"orig_to_{TEMPLATE}.txt").write_text(itk_transform(found.registered.to_standard), encoding="utf-8")


def conformed_scan(scan: Volume) -> Volume:
    """A scan on FreeSurfer's conformed grid, linearly interpolated, with 8 bits.

    Its smallest value becomes 0, and the value below which 99.9 % of the voxels lie becomes 255.

    Parameters
    ----------
    scan : Volume
    """
    affine = np.eye(4)
    affine[:3, :3] = _AXES
    affine[:3, 3] = centre_ras(scan) - _AXES @ np.full(3, N_VOXELS / 2)
    to_voxel = np.linalg.inv(scan.affine) @ affine
    low, high = float(scan.data.min()), float(np.percentile(scan.data, 99.9))
    image = affine_transform(
        scan.data.astype(np.float32), to_voxel[:3, :3], to_voxel[:3, 3], (N_VOXELS,) * 3, order=1, cval=low
    )
    scaled = 255 * (image - low) / max(high - low, 1e-12)
    return Volume(np.clip(np.rint(scaled), 0, 255).astype(np.uint8), affine)


def finish(folder: Path, visit: Visit, report: dict) -> None:
    """Write the log of the stages into ``scripts``."""
    lines = [f"meshot reconstruct, {report['date']}, commit {report['commit']}"]
    lines += [f"scan {path}" for path in visit.scans] + list(visit.notes)
    seconds = report["seconds"]
    lines += [f"{stage}: {seconds['clock'][stage]} s, {seconds['processor'][stage]} s of processor time"
              for stage in seconds["clock"]]  # fmt: skip
    lines += [f"warning: {warning}" for warning in report["warnings"]]
    scripts = folder / "scripts"
    scripts.mkdir()
    (scripts / "meshot.log").write_text("\n".join(lines) + "\n", encoding="utf-8", errors="replace")


def begin(study: Path, dataset: Path | None) -> None:
    """The study as a whole has no files of this layout."""
