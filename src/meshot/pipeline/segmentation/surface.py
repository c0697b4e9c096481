"""From the probability of white matter to the surface that a flow starts from."""

import dataclasses

import numpy as np
import torch

from meshot.mesh import Mesh
from meshot.mesh.editing import smooth_crossings, taubin_smoothing
from meshot.mesh.topology import self_intersecting_faces
from meshot.volume import Volume, cropped, voxel_sizes, voxel_to_mm
from meshot.volume.surfaces import (
    filled_cavities,
    genus_zero,
    isosurface,
    largest_component,
    separated_field,
    signed_distance,
)

SMOOTHING_STEPS = 5
# What a probability of 1 is worth, in mm of depth, when it is decided which voxel joins first; see chapter 31.
PROBABILITY_WEIGHT_MM = 12.0
_MARGIN_VOXELS = 0.05


@dataclasses.dataclass(frozen=True, eq=False)
class SegmentedSurface:
    """The initial surface of one hemisphere and the stages it came through; volumes are cropped to the hemisphere.

    Parameters
    ----------
    mesh : Mesh
        Closed, outward, χ = 2, no non-manifold edge, no self-intersecting face; in mm.
    raw_mesh : Mesh
        The same before smoothing.
    distance : Volume
        Signed distance from the ½ of the probability, in mm, negative inside.
    mask : Volume
        Boolean: the largest piece of what is inside, cavities filled.
    genus_zero_mask : Volume
        Boolean: the part of it that has the topology of a ball.
    """

    mesh: Mesh
    raw_mesh: Mesh
    distance: Volume
    mask: Volume
    genus_zero_mask: Volume


def segmented_surface(probability: Volume, n_smoothing: int = SMOOTHING_STEPS) -> SegmentedSurface:
    """The surface where a probability crosses ½, made to have the topology of a sphere.

    Largest piece above ½ → cavities filled → signed distance → genus 0, the doubtful voxels given up first → marching
    cubes on the distance → light smoothing. Doubtful is what lies near the outside or has a low probability. Distance
    knows how thin a bridge is, to a fraction of a voxel, but takes two banks that touch for one thick piece;
    probability sees the seam between them, but is 1 in thin and thick pieces alike.

    Parameters
    ----------
    probability : Volume
        In [0, 1], of one hemisphere; its axes must be orthogonal.
    n_smoothing : int
        Steps of Taubin's smoothing.

    Raises
    ------
    ValueError
        If nothing, or everything, lies above ½, or the axes are not orthogonal.
    """
    places = np.argwhere(largest_component(probability.data > 0.5))
    box = cropped(probability, voxel_to_mm(probability, torch.from_numpy(places).double()))
    mask = filled_cavities(largest_component(box.data > 0.5))
    distance = signed_distance(separated_field(box, mask, margin=0.0))
    ball = genus_zero(mask, PROBABILITY_WEIGHT_MM * box.data - distance.data)
    margin = _MARGIN_VOXELS * float(voxel_sizes(box).min())
    field = separated_field(box.with_data(-distance.data), ball, 0.0, margin)
    raw = isosurface(field, 0.0)
    mesh = _without_crossings(taubin_smoothing(raw, n_smoothing), raw)
    return SegmentedSurface(mesh, raw, distance, box.with_data(mask), box.with_data(ball))


def _without_crossings(smoothed: Mesh, raw: Mesh) -> Mesh:
    """The smoothed mesh, mended where faces cross; if that fails, the raw one, in which none do."""
    try:
        return smooth_crossings(smoothed)
    except ValueError:
        return raw if not len(self_intersecting_faces(raw)) else smooth_crossings(raw)
