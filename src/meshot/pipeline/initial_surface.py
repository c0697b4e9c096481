"""The initial surface of a flow from the probability of white matter."""

import dataclasses

import numpy as np
import torch

from meshot.mesh import Mesh, self_intersecting_faces, smooth_crossings, taubin_smoothing
from meshot.volume import (
    Volume,
    cropped,
    filled_cavities,
    filled_tunnels,
    genus_zero,
    isosurface,
    largest_component,
    separated_field,
    signed_distance,
    voxel_sizes,
    voxel_to_mm,
)

SMOOTHING_STEPS = 5
# Weight of the probability relative to depth in mm, in the order in which voxels are added; see chapter 17.
PROBABILITY_WEIGHT_MM = 12.0
_MARGIN_VOXELS = 0.05
# Chosen on four hemispheres of validation heads of people_like, by the number of voxels on the wrong side of the true
# surface: 9686 with none filled, then (limits of 3, 6, 13 and 26 mm³, and no limit) 9029, 8941, 8913, 8924 and 9110.
LARGEST_FILLING_MM3 = 13.0


@dataclasses.dataclass(frozen=True, eq=False)
class SegmentedSurface:
    """The initial surface of one hemisphere, with intermediate results. Volumes are cropped to the hemisphere."""

    mesh: Mesh  # closed, oriented outwards, χ = 2, without non-manifold edges and self-intersections; in mm
    raw_mesh: Mesh  # the same before smoothing
    distance: Volume  # signed distance from the level set ½ of the probability, in mm, negative inside
    mask: Volume  # boolean: the largest component of the inside, with cavities and small tunnels filled
    genus_zero_mask: Volume  # boolean: the part of it that has the topology of a ball


def segmented_surface(
    probability: Volume,
    n_smoothing: int = SMOOTHING_STEPS,
    largest_filling: float = LARGEST_FILLING_MM3,
    pieces: bool = True,
) -> SegmentedSurface:
    """The surface where a probability is ½, with the topology of a sphere.

    Steps: largest component above ½, filled cavities, filled tunnels, signed distance, genus-0 correction, marching
    cubes on the distance, light smoothing. Small tunnels are filled, since cutting the ring around them would open a
    gyrus. The genus-0 correction first removes voxels that are close to the outside or have a low
    probability. The distance measures the thickness of a bridge to a fraction of a voxel, but does not separate two
    gyri that touch. The probability is lower between such gyri, but is 1 in thin and thick parts alike. It is that of
    one hemisphere, with orthogonal axes; ``n_smoothing`` are the steps of Taubin smoothing, ``largest_filling`` (mm³)
    is an argument of :func:`meshot.volume.filled_tunnels`, and ``pieces`` one of :func:`meshot.volume.genus_zero`.

    Raises
    ------
    ValueError
        If no voxel, or every voxel, is above ½, or the axes are not orthogonal.
    """
    places = np.argwhere(largest_component(probability.data > 0.5))
    box = cropped(probability, voxel_to_mm(probability, torch.from_numpy(places).double()))
    mask = filled_cavities(largest_component(box.data > 0.5))
    mask = filled_tunnels(box, mask, largest_filling)
    distance = signed_distance(separated_field(box, mask, margin=0.0))
    ball = genus_zero(mask, PROBABILITY_WEIGHT_MM * box.data - distance.data, pieces)
    margin = _MARGIN_VOXELS * float(voxel_sizes(box).min())
    field = separated_field(box.with_data(-distance.data), ball, 0.0, margin)
    raw = isosurface(field, 0.0)
    # If the self-intersections of the smoothed mesh cannot be repaired: the raw mesh, repaired if necessary.
    try:
        mesh = smooth_crossings(taubin_smoothing(raw, n_smoothing))
    except ValueError:
        mesh = raw if not len(self_intersecting_faces(raw)) else smooth_crossings(raw)
    return SegmentedSurface(mesh, raw, distance, box.with_data(mask), box.with_data(ball))
