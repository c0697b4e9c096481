"""A closed surface of genus 0 from a tissue probability inside a region, without a network, as for MNI152.

A reconstruction begins with :func:`meshot.pipeline.segmented_surface`, which needs no region and orders the voxels by
their distance from the outside.
"""

import dataclasses

import numpy as np
import scipy.ndimage
import scipy.spatial
import torch

from meshot.mesh import SPHERE, Mesh, decimated, self_intersecting_faces, taubin_smoothing, topology
from meshot.types import Array
from meshot.volume import (
    Volume,
    cropped,
    filled_cavities,
    genus_zero,
    isosurface,
    largest_component,
    separated_field,
    transform_points,
    voxel_distance,
    voxel_to_mm,
)

SMOOTHING_STEPS = (5, 10, 20)
DEPTH_WEIGHT = 0.02  # of probability, per voxel


@dataclasses.dataclass(frozen=True, eq=False)
class TissueSurface:
    """A tissue surface, and intermediate results of its computation."""

    mesh: Mesh  # closed, oriented outwards, χ = 2, without non-manifold edges and self-intersections; in mm
    mask: Volume  # boolean: the largest component of the tissue above ½, with cavities filled
    genus_zero_mask: Volume  # boolean: the part of it that has the topology of a ball


def tissue_surface(probability: Volume, n_faces: int = 80_000) -> TissueSurface:
    """The surface where a tissue probability is ½, with the topology of a sphere."""
    # Steps: threshold, largest component, filled cavities, genus-0 correction (voxels of low probability are removed
    # first), marching cubes at subvoxel accuracy, light smoothing, decimation.
    # ``probability``: in [0, 1], already restricted to the region that the surface may enclose.
    # ``n_faces``: approximate maximum number of faces.
    mask = filled_cavities(largest_component(probability.data > 0.5))
    # Among equal probabilities, depth decides. Otherwise fronts would meet inside white matter and leave wide cuts.
    depth = scipy.ndimage.distance_transform_edt(mask)
    ball = genus_zero(mask, probability.data + DEPTH_WEIGHT * depth)
    mesh = sphere_like_mesh(isosurface(separated_field(probability, ball)), n_faces)
    return TissueSurface(mesh, probability.with_data(mask), probability.with_data(ball))


def sphere_like_mesh(mesh: Mesh, n_faces: int) -> Mesh:
    """The mesh after smoothing and decimation, with as few smoothing steps as give no self-intersections."""
    # If every number of steps that is tried gives self-intersections, the mesh is returned unchanged.
    found = topology(mesh)
    if found != SPHERE:
        raise ValueError(f"the mesh is not a topological sphere ({found}); correct the mask with genus_zero first")
    for n_steps in SMOOTHING_STEPS:
        smoothed = taubin_smoothing(mesh, n_steps)
        # Rounded, because the last bits differ between CPUs and could change which edge is the shortest.
        smoothed = smoothed.with_vertices((smoothed.vertices * 2**20).round() / 2**20)
        candidate = decimated(smoothed, n_faces)
        if topology(candidate) == SPHERE and not len(self_intersecting_faces(candidate)):
            return candidate
    return mesh


# The region of one cerebral hemisphere in a scan, from a guide surface in the same space.

CROP_VOXELS = 4
_ORIGIN = torch.zeros(1, 3, dtype=torch.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class HemisphereRegion:
    """The region in which white matter of one hemisphere may lie, and the part of it that is always filled."""

    allowed: Volume  # boolean: cerebrum of this side, without cerebellum, brainstem and the other side
    filled: Volume  # boolean: ventricles, thalamus and basal ganglia, which a closed white surface encloses


def hemisphere_region(
    grid: Volume, white: Mesh, pial: Mesh, side: str, margin: float = 1.5, depth: float = 3.0
) -> HemisphereRegion:
    """The region of one hemisphere, from a guide surface that is accurate to a few mm."""
    # The allowed region is inside the guide's pial surface or at most ``margin`` outside, on one side of the plane x =
    # 0. Along the medial wall of the guide, where its white and pial surfaces coincide, there is no margin, so that the
    # brainstem and the other hemisphere are excluded. The filled region is inside the guide's white surface, more than
    # ``depth`` away from its cortical part.
    # ``grid``: any volume of the scan. Its values are not used. The region is cropped to the guide.
    # ``white``, ``pial``: the guide: closed surfaces in mm, with corresponding vertices.
    # ``side``: "left" (x < 0) or "right" (x > 0).
    # ``margin``, ``depth``: in mm.
    if side not in ("left", "right"):
        raise ValueError(f"side is {side!r}; 'left' or 'right' is needed")
    grid = cropped(grid, pial.vertices, CROP_VOXELS)
    wall = np.linalg.norm((pial.vertices - white.vertices).detach().double().numpy(), axis=1) < 0.05
    outside_pial = voxel_distance(pial, grid)
    places = np.argwhere(outside_pial < margin)
    points = voxel_to_mm(grid, pial.vertices.new_tensor(places)).numpy()
    on_side = points[:, 0] < 0 if side == "left" else points[:, 0] > 0
    nearest = scipy.spatial.cKDTree(pial.vertices.numpy()).query(points)[1]
    at_wall = wall[nearest] & (outside_pial[tuple(places.T)] > 0)
    from_cortex = scipy.spatial.cKDTree(white.vertices.numpy()[~wall]).query(points)[0]
    inside_white = voxel_distance(white, grid)[tuple(places.T)] < 0
    return HemisphereRegion(
        _volume_of(grid, places[on_side & ~at_wall]),
        _volume_of(grid, places[on_side & inside_white & (from_cortex > depth)]),
    )


def _volume_of(grid: Volume, places: Array) -> Volume:
    mask = np.zeros(grid.data.shape, dtype=bool)
    mask[tuple(places.T)] = True
    return grid.with_data(mask)


def restricted(probability: Volume, region: HemisphereRegion, blur: float = 0.7) -> Volume:
    """A tissue probability restricted to a region, on the grid of the region; 1 where the region is filled."""
    # ``probability``: in [0, 1], on the grid from which the region was cropped, or on the grid of the region.
    # ``blur``: standard deviation, in voxels, of the Gaussian that smooths the borders of the region. Without it, these
    # artificial borders would give a voxelised surface.
    allowed, filled = (
        scipy.ndimage.gaussian_filter(part.data.astype(np.float32), blur) for part in (region.allowed, region.filled)
    )
    data, grid = probability.data, region.allowed
    offset = transform_points(np.linalg.inv(probability.affine), voxel_to_mm(grid, _ORIGIN)).numpy()[0]
    start = np.rint(offset).astype(int)
    end = start + grid.data.shape
    same_axes = np.allclose(probability.affine[:3, :3], grid.affine[:3, :3], atol=1e-6)
    if not same_axes or np.abs(offset - start).max() > 1e-3 or (start < 0).any() or (end > data.shape).any():
        raise ValueError("the volume and the region do not share a grid; make the region from a volume of this scan")
    part = data[tuple(slice(a, b) for a, b in zip(start, end, strict=True))]
    return grid.with_data(np.maximum(part * allowed, filled))
