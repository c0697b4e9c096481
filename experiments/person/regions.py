"""Where in a person's head a point lies: beside the cortex, in the hindbrain, at deep structures or at the medial wall.

The labels come from MNI152, registered to the person. The border of the hindbrain is then moved to the person's own gap
between cerebrum and cerebellum: a watershed on the estimate of the tissue divides what is near the registered border.
"""

import dataclasses
from collections.abc import Mapping

import numpy as np
import scipy.ndimage
import torch

from meshot.anatomy import HEMISPHERES, fsaverage5_surface, mni152_t1
from meshot.synth import TemplateTissue, template_tissue
from meshot.types import Array, Bool, Float
from meshot.volume import (
    Volume,
    mm_to_voxel,
    register_affine,
    resample,
    transform_points,
    voxel_sizes,
    watershed_regions,
)

#: Labels. Results are compared in CORTEX alone.
CORTEX, HINDBRAIN, DEEP, WALL = range(4)
NAMES = ("cortex", "hindbrain", "deep", "medial wall")
_SMOOTHING = 0.7  # voxels, of the tissue before the watershed
_COINCIDE_MM = 0.05  # white and pial surface at the medial wall


@dataclasses.dataclass(frozen=True, eq=False)
class Atlas:
    """What is carried from the template: distances in mm, and points of the white surfaces."""

    hindbrain: Volume  # the signed distance from the border of cerebellum and brainstem, positive inside
    deep: Volume  # the distance from ventricles and deep grey matter, 0 inside
    wall: Float[Array, "n 3"]  # at the medial wall
    cortex: Float[Array, "m 3"]  # elsewhere


def mni152_atlas() -> Atlas:
    """The atlas of MNI152 and fsaverage5."""
    ends: dict[bool, list[Array]] = {True: [], False: []}
    for side in HEMISPHERES:
        white, pial = (fsaverage5_surface(kind, side, "MNI152").vertices.numpy() for kind in ("white", "pial"))
        at_wall = np.linalg.norm(white - pial, axis=1) < _COINCIDE_MM
        for key, points in ends.items():
            points.append(white[at_wall == key])
    hindbrain, deep = tissue_distances(template_tissue())
    return Atlas(hindbrain, deep, np.concatenate(ends[True]), np.concatenate(ends[False]))


def tissue_distances(tissue: TemplateTissue) -> tuple[Volume, Volume]:
    """The two distances of an :class:`Atlas`, from the tissue of the template."""
    distance = scipy.ndimage.distance_transform_edt
    sizes = voxel_sizes(tissue.hindbrain)
    inside = tissue.hindbrain.data > 0.5
    signed = distance(inside, sampling=sizes) - distance(~inside, sampling=sizes)
    deep = (tissue.deep_grey.data > 0.5) | (tissue.ventricles.data > 0)
    return tissue.hindbrain.with_data(signed), tissue.deep_grey.with_data(distance(~deep, sampling=sizes))


def registered_labels(
    scan: Volume, tissue: Float[Array, "X Y Z"], config: Mapping[str, float], seed: int = 0
) -> tuple[Volume, Float[Array, "4 4"]]:
    """The labels of a scan, and the affine from its scanner RAS to MNI152: a registration more thorough than that of a
    reconstruction, and independent of it."""
    to_standard = register_affine(scan, mni152_t1(), seed)
    return region_labels(scan, tissue, mni152_atlas(), to_standard, **config), to_standard


def region_labels(
    grid: Volume,
    tissue: Float[Array, "X Y Z"],
    atlas: Atlas,
    to_standard: Float[Array, "4 4"],
    core_mm: float,
    deep_mm: float,
) -> Volume:
    """The label of every voxel of the estimate's grid.

    ``tissue`` is the part of every voxel that is grey or white matter, and ``to_standard`` leads from scanner RAS to
    the space of the atlas. ``config.yaml`` says what the lengths are.
    """
    depth = _carried(atlas.hindbrain, grid, to_standard)
    labels = np.full(grid.data.shape, CORTEX, dtype=np.int8)
    labels[_nearer_wall(grid, atlas, to_standard)] = WALL
    labels[_carried(atlas.deep, grid, to_standard) < deep_mm] = DEEP
    markers = np.where(depth > core_mm, 2, np.where(depth < -core_mm, 1, 0)).astype(np.int32)
    gaps = np.clip(1 - scipy.ndimage.gaussian_filter(tissue.astype(np.float32), _SMOOTHING), 0, 1)
    labels[watershed_regions(gaps, markers, np.ones(labels.shape, dtype=bool)) == 2] = HINDBRAIN
    return grid.with_data(labels)


def labels_at(labels: Volume, points_mm: Float[Array, "n 3"]) -> Array:
    """The label of the voxel that holds each point; CORTEX beyond the grid."""
    places = np.rint(mm_to_voxel(labels, torch.from_numpy(points_mm)).numpy()).astype(np.int64)
    inside = ((places >= 0) & (places < labels.data.shape)).all(axis=1)
    found = np.full(len(points_mm), CORTEX, dtype=labels.data.dtype)
    found[inside] = labels.data[tuple(places[inside].T)]
    return found


def _carried(volume: Volume, grid: Volume, to_standard: Float[Array, "4 4"]) -> Float[Array, "X Y Z"]:
    """A volume of the template at the voxels of the grid; beyond the template, the value at its border."""
    return resample(volume, grid.data.shape, grid.affine, to_standard, outside="nearest").data


def _nearer_wall(grid: Volume, atlas: Atlas, to_standard: Float[Array, "4 4"]) -> Bool[Array, "X Y Z"]:
    """The voxels whose nearest point of the atlas's white surfaces is at the medial wall."""
    if not len(atlas.wall):
        return np.zeros(grid.data.shape, dtype=bool)
    to_wall, to_cortex = (_distance_to(points, grid, to_standard) for points in (atlas.wall, atlas.cortex))
    return to_wall < to_cortex


def _distance_to(points: Float[Array, "n 3"], grid: Volume, to_standard: Float[Array, "4 4"]) -> Float[Array, "X Y Z"]:
    """The distance of every voxel from the voxels that hold a point, in mm."""
    scanner = transform_points(np.linalg.inv(to_standard), torch.from_numpy(points))
    places = np.rint(mm_to_voxel(grid, scanner).numpy()).astype(np.int64)
    places = places[((places >= 0) & (places < grid.data.shape)).all(axis=1)]
    free = np.ones(grid.data.shape, dtype=bool)
    free[tuple(places.T)] = False
    return scipy.ndimage.distance_transform_edt(free, sampling=voxel_sizes(grid))
