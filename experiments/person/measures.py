"""Measures of white surfaces against an estimate: distances, areas by region, and what the topology step took."""

import numpy as np
import scipy.ndimage
import torch
from estimate import Estimate, border_squares, square_centres
from regions import CORTEX, NAMES, labels_at

from meshot.mesh import Mesh, face_areas, face_barycentres
from meshot.metrics import Surface, SurfaceSample
from meshot.types import Array, Bool, Float
from meshot.volume import Volume, voxel_to_mm


def joined(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    counts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + int(start) for mesh, start in zip(meshes, counts[:-1], strict=True)]
    return Mesh(torch.cat([mesh.vertices.double() for mesh in meshes]), torch.cat(faces))


def border_distances(mesh: Mesh, estimate: Estimate, labels: Volume, n_points: int, seed: int) -> dict:
    """Distances in mm from the border of the estimate to the mesh and back, and the floor: the same for the surface of
    the estimate itself.

    ``there`` is measured from the centres of the border's squares, ``back`` from random points of the mesh to the
    squares. Only points with the label CORTEX count.
    """
    squares = border_squares(estimate)
    centres = square_centres(squares)
    chosen = labels_at(labels, centres) == CORTEX
    border = Surface(squares)
    own = estimate.white_surface()
    found = {"n_squares": len(centres), "share_left_out": float(1 - chosen.mean())}
    for name, surface in (("surface", Surface(mesh)), ("floor", Surface(own))):
        points = surface.sample(n_points, seed).points
        kept = points[labels_at(labels, points) == CORTEX]
        found[name] = {"there": spread(_from(centres[chosen], surface)), "back": spread(_from(kept, border))}
    return found


def _from(points: Float[Array, "n 3"], surface: Surface) -> Float[Array, " n"]:
    return surface.offsets(SurfaceSample(points, np.zeros_like(points))).distances


def spread(distances: Float[Array, " n"]) -> dict:
    """Number, median, mean and 95th percentile of distances."""
    if not len(distances):
        raise ValueError("no point lies beside the cortex; is the estimate that of this scan?")
    return {
        "n": len(distances),
        "median": float(np.median(distances)),
        "mean": float(distances.mean()),
        "percentile_95": float(np.percentile(distances, 95)),
    }


def areas_by_region(mesh: Mesh, labels: Volume) -> dict[str, float]:
    """The area in cm² of the faces whose centre has each label."""
    areas = face_areas(mesh).double().numpy() / 100
    there = labels_at(labels, face_barycentres(mesh).double().numpy())
    sums = np.bincount(there, weights=areas, minlength=len(NAMES))
    return dict(zip(NAMES, sums.tolist(), strict=True))


def compared_areas(mesh: Mesh, estimate: Estimate, labels: Volume) -> dict:
    """The areas of the mesh and of the estimate's own surface by region, and what is asked of them."""
    ours, own = (areas_by_region(each, labels) for each in (mesh, estimate.white_surface()))
    return {
        "surface_cm2": ours,
        "estimate_cm2": own,
        "share_in_hindbrain": ours["hindbrain"] / sum(ours.values()),
        "excess_at_cortex": ours["cortex"] / own["cortex"] - 1,
    }


def given_up(mask: Volume, ball: Volume, labels: Volume, from_mask: Array, n_clusters: int) -> dict:
    """The voxels that the topology step took from a mask of white matter, how many, and where.

    Volumes are in mm³ of the scan, centres in mm of the space of the mask, which is MNI152 after a reconstruction.

    ``mask`` and ``ball`` are before and after the step. ``from_mask`` is the affine from their space to scanner RAS of
    the scan. Voxels are of one cluster if they share a corner.
    """
    lost = mask.data & ~ball.data
    there, places = _labels_of(mask, np.argwhere(lost), labels, from_mask)
    inside, _ = _labels_of(mask, np.argwhere(mask.data), labels, from_mask)
    voxel = abs(float(np.linalg.det(from_mask @ mask.affine)))  # in mm³ of the scan
    return {
        "cm3": float(lost.sum()) * voxel / 1000,
        "share": float(lost.sum() / mask.data.sum()),
        "share_at_cortex": float((there == CORTEX).sum() / max((inside == CORTEX).sum(), 1)),
        "cm3_by_region": {name: float((there == k).sum()) * voxel / 1000 for k, name in enumerate(NAMES)},
        "largest_clusters": _clusters(lost, there, places, voxel, n_clusters),
    }


def _labels_of(grid: Volume, places: Array, labels: Volume, to_scanner: Array) -> tuple[Array, Array]:
    """The label of voxels of the grid, and their centres in mm of the grid's space."""
    centres = voxel_to_mm(grid, torch.from_numpy(places.astype(np.float64))).numpy()
    return labels_at(labels, centres @ to_scanner[:3, :3].T + to_scanner[:3, 3]), centres


def _clusters(lost: Bool[Array, "X Y Z"], there: Array, places: Array, voxel: float, n_clusters: int) -> list[dict]:
    numbers = scipy.ndimage.label(lost, np.ones((3, 3, 3)))[0][lost]
    sizes = np.bincount(numbers, minlength=1)
    largest = [k for k in np.argsort(-sizes, kind="stable") if k > 0 and sizes[k]][:n_clusters]
    return [
        {
            "mm3": float(sizes[k]) * voxel,
            "centre_mm_of_mask": places[numbers == k].mean(axis=0).round(1).tolist(),
            "region": NAMES[int(np.bincount(there[numbers == k]).argmax())],
        }
        for k in largest
    ]
