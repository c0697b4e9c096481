"""A closed surface of genus 0 from a tissue probability: the initial surface of a flow."""

import dataclasses

import scipy.ndimage

from meshot.mesh import Mesh
from meshot.mesh.editing import decimated, taubin_smoothing
from meshot.mesh.topology import SPHERE, self_intersecting_faces, topology
from meshot.volume import Volume
from meshot.volume.surfaces import filled_cavities, genus_zero, isosurface, largest_component, separated_field

SMOOTHING_STEPS = (5, 10, 20)
DEPTH_WEIGHT = 0.02  # of probability, per voxel


@dataclasses.dataclass(frozen=True, eq=False)
class TissueSurface:
    """A tissue surface, and intermediate results of its computation.

    Parameters
    ----------
    mesh : Mesh
        Closed, oriented outwards, χ = 2, without non-manifold edges and self-intersections; in mm.
    mask : Volume
        Boolean: the largest component of the tissue above ½, with cavities filled.
    genus_zero_mask : Volume
        Boolean: the part of it that has the topology of a ball.
    """

    mesh: Mesh
    mask: Volume
    genus_zero_mask: Volume


def tissue_surface(probability: Volume, n_faces: int = 80_000) -> TissueSurface:
    """The surface where a tissue probability is ½, with the topology of a sphere.

    Steps: threshold, largest component, filled cavities, genus-0 correction (voxels of low probability are removed
    first), marching cubes at subvoxel accuracy, light smoothing, decimation.

    Parameters
    ----------
    probability : Volume
        In [0, 1], already restricted to the region that the surface may enclose.
    n_faces : int
        Approximate maximum number of faces.

    Raises
    ------
    ValueError
        If no voxel, or every voxel, is above ½.
    """
    mask = filled_cavities(largest_component(probability.data > 0.5))
    # Among equal probabilities, depth decides. Otherwise fronts would meet inside white matter and leave wide cuts.
    depth = scipy.ndimage.distance_transform_edt(mask)
    ball = genus_zero(mask, probability.data + DEPTH_WEIGHT * depth)
    mesh = sphere_like_mesh(isosurface(separated_field(probability, ball)), n_faces)
    return TissueSurface(mesh, probability.with_data(mask), probability.with_data(ball))


def sphere_like_mesh(mesh: Mesh, n_faces: int) -> Mesh:
    """The mesh after smoothing and decimation, with as few smoothing steps as give no self-intersections.

    If every number of steps that is tried gives self-intersections, the mesh is returned unchanged.

    Raises
    ------
    ValueError
        If the mesh is not a topological sphere.
    """
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
