"""From a tissue probability to a closed surface without handles, as every flow needs it to start from."""

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
    """A surface of a tissue and the stages it came through.

    Parameters
    ----------
    mesh : Mesh
        Closed, outward, χ = 2, no non-manifold edge, no self-intersecting face; in mm.
    mask : Volume
        Boolean: the tissue above ½, largest piece, cavities filled.
    genus_zero_mask : Volume
        Boolean: the part of it that has the topology of a ball.
    """

    mesh: Mesh
    mask: Volume
    genus_zero_mask: Volume


def tissue_surface(probability: Volume, n_faces: int = 80_000) -> TissueSurface:
    """The surface where a tissue probability crosses ½, made to have the topology of a sphere.

    Threshold → largest piece → cavities filled → genus 0, voxels of low probability given up first → marching cubes,
    between voxels where the probability says → light smoothing → decimation.

    Parameters
    ----------
    probability : Volume
        In [0, 1]; already restricted to what the surface shall enclose.
    n_faces : int
        About how many faces are wanted at most.

    Raises
    ------
    ValueError
        If nothing, or everything, lies above ½.
    """
    mask = filled_cavities(largest_component(probability.data > 0.5))
    # Where tissue is equally sure, depth decides: else fronts meet in the middle of white matter, and wide cuts stay.
    depth = scipy.ndimage.distance_transform_edt(mask)
    ball = genus_zero(mask, probability.data + DEPTH_WEIGHT * depth)
    mesh = sphere_like_mesh(isosurface(separated_field(probability, ball)), n_faces)
    return TissueSurface(mesh, probability.with_data(mask), probability.with_data(ball))


def sphere_like_mesh(mesh: Mesh, n_faces: int) -> Mesh:
    """A mesh after light smoothing and decimation, smoothed no more than it takes to keep faces from crossing.

    Where no amount that is tried keeps them apart, the mesh is returned as it came.

    Raises
    ------
    ValueError
        If the mesh is no topological sphere.
    """
    found = topology(mesh)
    if found != SPHERE:
        raise ValueError(f"the mesh is not a topological sphere ({found}); correct the mask with genus_zero first")
    for n_steps in SMOOTHING_STEPS:
        smoothed = taubin_smoothing(mesh, n_steps)
        # Rounded, so that the last bit, which differs between CPUs, does not decide which edge is the shortest.
        smoothed = smoothed.with_vertices((smoothed.vertices * 2**20).round() / 2**20)
        candidate = decimated(smoothed, n_faces)
        if topology(candidate) == SPHERE and not len(self_intersecting_faces(candidate)):
            return candidate
    return mesh
