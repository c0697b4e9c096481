"""White and pial surfaces by CAT's library, a classical peer: ``python benchmarks/cat_surfaces.py SCAN FOLDER``.

CAT (the library of the toolbox CAT12, ``cat-surf`` on PyPI, GPL) is installed by ``make peers`` for this script alone.
Its way is: tissues from grey values, thickness by projection (Dahnke, Yotter, Gaser 2013), the central surface from the
map of positions between both borders, and both surfaces from the central one. The steps and their settings are those of
CAT's own pipeline T1Prep.

Two things CAT does not have without further data: where the brain is, and where the white matter of a side is, with its
ventricles and deep nuclei filled. It is given the white matter that the segmentation network of this package finds. The
brain is what is bright enough, and joined to the white matter within a few millimetres.

``FOLDER`` receives ``lh.white.gii``, ``lh.pial.gii``, the same of the right side, in scanner RAS, and ``cat.json`` with
seconds and memory.
"""

import argparse
import importlib.metadata
import json
import resource
import sys
import time
from pathlib import Path

import numpy as np
import torch
from scipy import ndimage
from skimage.filters import threshold_multiotsu

from meshot.anatomy import HEMISPHERES
from meshot.files import write_whole
from meshot.mesh import Mesh, write_mesh
from meshot.pipeline import load_networks, reconstruct, white_matter_labels
from meshot.volume import Volume, read_volume, resample

sys.path.append(str(Path(__file__).resolve().parent.parent / "build" / "peers"))

SPACING_MM = 0.5
REACH_MM = 6.0  # grey matter lies within this distance of the white matter
RIM_MM = 2.0  # of liquid around the brain, so that partial volumes have both neighbours
LIQUID, GREY, WHITE = 1, 2, 3  # CAT's labels; between them lie partial volumes


def box_of(scan: Volume, labels: Volume, margin_mm: float = 15.0) -> tuple[Volume, np.ndarray]:
    """The scan around the white matter at 0.5 mm, along the scanner's axes, and the labels there."""
    places = np.argwhere(labels.data > 0) @ labels.affine[:3, :3].T + labels.affine[:3, 3]
    low, high = places.min(axis=0) - margin_mm, places.max(axis=0) + margin_mm
    affine = np.diag([SPACING_MM] * 3 + [1.0])
    affine[:3, 3] = low
    shape = tuple(np.ceil((high - low) / SPACING_MM).astype(int))
    nearest = np.linalg.solve(labels.affine, affine)
    there = ndimage.affine_transform(labels.data, nearest[:3, :3], nearest[:3, 3], shape, order=0)
    return resample(scan, shape, affine), there


def tissues(image: np.ndarray, white: np.ndarray) -> np.ndarray:
    """CAT's labels of liquid, grey and white matter, with partial volumes, from 0 outside the brain to 3."""
    import cat_surf

    distance = ndimage.distance_transform_edt(~white, sampling=SPACING_MM)
    near = distance < REACH_MM
    dark, bright = threshold_multiotsu(image[near], classes=3)
    # Grey matter: bright enough, and reached from the white matter without a step through the dark.
    candidates = ndimage.binary_opening(near & (image > dark) & (image < 2 * bright), iterations=1) | white
    parts, _ = ndimage.label(candidates)
    brain = parts == np.bincount(parts[white]).argmax()
    rim = ndimage.distance_transform_edt(~brain, sampling=SPACING_MM) < RIM_MM
    first = np.where(image > bright, WHITE, np.where(image > dark, GREY, LIQUID)) * rim
    first[rim & ~brain] = LIQUID
    first[white] = WHITE
    found, _, _ = cat_surf.vol_amap(
        image.astype(np.float32), first.astype(np.uint8), np.full(3, SPACING_MM), pve=True, weight_mrf=0.0
    )
    # Five classes: liquid, liquid and grey, grey, grey and white, white. Their mean is the label.
    shares = found.astype(np.float32)
    total = shares.sum(axis=-1)
    labels = shares @ np.array([1, 1.5, 2, 2.5, 3], dtype=np.float32) / np.maximum(total, 1)
    labels[~rim | (total == 0)] = 0
    # The deep parts are filled. What is bright beside the white matter, such as the brainstem, is not part of it.
    inner = ndimage.distance_transform_edt(white, sampling=SPACING_MM)
    labels[inner > 1.5] = WHITE
    labels[white] = np.maximum(labels[white], GREY)
    beyond = rim & (distance > 1.5)
    labels[beyond] = np.minimum(labels[beyond], GREY)
    return labels


def surfaces(labels: np.ndarray, affine: np.ndarray) -> tuple[tuple, tuple]:
    """The white and the pial surface of a side: vertices in mm, and faces."""
    import cat_surf

    spacing = np.full(3, SPACING_MM)
    cleaned = cat_surf.vol_blood_vessel_correction(np.asfortranarray(labels, dtype=np.float32), spacing)
    thickness, position, *_ = cat_surf.vol_thickness_pbt(
        cleaned,
        spacing,
        n_avgs=5,
        n_median_filter=2,
        median_subsample=2,
        range_val=0.45,
        sulcal_barrier=True,
        barrier_gmtfactor=1.5,
        barrier_gmtpct=90.0,
        barrier_q=0.7,
        oriented_filter=True,
        correct_thickness=0.0,
        sulcal_width=5.0,
    )
    vertices, faces = cat_surf.vol_marching_cubes(
        (position, affine),
        label=(labels, affine),
        threshold=0.5,
        pre_fwhm=1.0,
        iter_laplacian=50,
        n_median_filter=2,
        strength_gyri_mask=0.1,
        strength_sulci=1.0,
        sulci_sheet_strength=1.0,
        sheet_offset=0.2,
        sulci_sigma_factor=0.9,
        sulci_cutoff=0.2,
    )
    vertices, faces = cat_surf.reduce_mesh(vertices, faces, round(len(faces) / 4), aggressiveness=7.0)
    vertices, faces = cat_surf.surf_deform(
        vertices, faces, (position, affine), w1=0.1, w2=0.1, w3=1.0, iterations=75, remove_intersect=True
    )
    vertices, faces = cat_surf.fix_self_intersect(vertices, faces)
    values, _ = cat_surf.vol2surf(
        (thickness, affine), vertices, faces, grid_start=-0.4, grid_end=0.4, grid_steps=5, map_func="waverage"
    )
    pial, pial_faces, white, white_faces = cat_surf.surf_to_pial_white(
        vertices, faces, values, (labels, affine), method=2, remove_intersect=True
    )
    return (white, white_faces), (pial, pial_faces)


def main(words: list[str] | None = None) -> int:
    """Make the surfaces of a scan, and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scan", type=Path)
    parser.add_argument("folder", type=Path)
    arguments = parser.parse_args(words)
    torch.set_num_threads(1)
    scan = read_volume(arguments.scan)
    networks = load_networks(initial_only=True)
    started = time.perf_counter()
    found = reconstruct(scan, networks.segmentation, None)
    seconds = {"white matter": time.perf_counter() - started}
    started = time.perf_counter()
    box, sides = box_of(scan, white_matter_labels(found, scan))
    labels = tissues(box.data, sides > 0)
    distances = [ndimage.distance_transform_edt(sides != k, sampling=SPACING_MM) for k in (1, 2)]
    seconds["tissues"] = time.perf_counter() - started
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for k, side in enumerate(HEMISPHERES):
        started = time.perf_counter()
        # A voxel belongs to the side whose white matter is nearer. The other side is empty.
        own = np.where(distances[k] <= distances[1 - k], labels, 0)
        for name, (vertices, faces) in zip(("white", "pial"), surfaces(own, box.affine), strict=True):
            mesh = Mesh(torch.as_tensor(vertices), torch.as_tensor(faces, dtype=torch.int64))
            write_mesh(arguments.folder / f"{side[0]}h.{name}.gii", mesh)
        seconds[side] = time.perf_counter() - started
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    record = {"version": importlib.metadata.version("cat-surf"), "seconds": seconds, "peak_mib": peak}
    write_whole(arguments.folder / "cat.json", json.dumps(record, indent=1) + "\n")
    print(record)
    return 0


if __name__ == "__main__":
    sys.exit(main())
