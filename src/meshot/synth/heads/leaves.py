"""Leaves of the cerebellum: thin sheets of grey matter around a core of white matter, with fissures between them."""

import dataclasses

import numpy as np
import scipy.ndimage

from meshot.rng import Generator, numpy_generator
from meshot.types import Array, Float

#: The leaves fan out around a line from left to right through this point of MNI152, near the roof of the fourth
#: ventricle. The brainstem lies in front of it.
FAN_MM = (0.0, -50.0, -32.0)
_OUTER_MM = 32.0  # the distance from that line at which the leaves have their stated width
_BENT = 0.2  # mm of shift per mm from the midline: leaves of the hemispheres are oblique
_WAVES_MM, _WAVE_LENGTH_MM = 2.5, 14.0


@dataclasses.dataclass(frozen=True)
class Leaves:
    """Sizes of the leaves of the cerebellum, in mm.

    Parameters
    ----------
    width : float
        The distance between neighbouring fissures at the outer surface.
    depth : float
        How deep the fissures reach.
    fissure : float
        The width of a fissure.
    cortex : float
        The thickness of the grey matter on either side of a fissure.

    Raises
    ------
    ValueError
        If a size is not positive, or a fissure and its cortex are wider than a leaf.
    """

    width: float = 4.0
    depth: float = 9.0
    fissure: float = 0.5
    cortex: float = 1.0

    def __post_init__(self):
        sizes = dataclasses.astuple(self)
        if not all(np.isfinite(size) and size > 0 for size in sizes) or self.fissure + 2 * self.cortex > self.width:
            raise ValueError(f"{self} is not possible: sizes are > 0, and fissure + 2 cortex at most the width")


def leaf_fractions(
    places: Float[Array, "n 3"], depths: Float[Array, " n"], leaves: Leaves, voxel_mm: float, generator: Generator
) -> tuple[Float[Array, " n"], Float[Array, " n"]]:
    """The shares of fluid and of white matter at positions in the cortex of the cerebellum. The rest is grey.

    Parameters
    ----------
    places : array
        In mm of MNI152.
    depths : array
        The distance to the surface of the hindbrain, in mm.
    leaves : Leaves
    voxel_mm : float
        The width over which borders are blurred, since a voxel may contain several tissues.
    generator : generator or int
        Source of the position of the first fissure, and of the waves of the leaves.
    """
    rng = numpy_generator(generator)
    x, y, z = (places - np.array(FAN_MM)).T
    radius = np.maximum(np.hypot(y, z), 1.0)
    along = _OUTER_MM * np.arctan2(z, -y) + _BENT * np.abs(x) + _waves(places, rng)
    turn = (along / leaves.width + rng.uniform()) % 1.0
    to_fissure = np.minimum(turn, 1 - turn) * leaves.width * radius / _OUTER_MM
    reached = _ramp(leaves.depth - depths, voxel_mm)
    fluid = reached * _ramp(leaves.fissure / 2 - to_fissure, voxel_mm)
    covered = np.minimum(to_fissure - leaves.fissure / 2, depths)  # the distance to the nearest fluid
    white = reached * _ramp(covered - leaves.cortex, voxel_mm)
    return fluid, white * (1 - fluid)


def _ramp(distance: Float[Array, " n"], width: float) -> Float[Array, " n"]:
    """The share of a voxel on the inner side of a border at this signed distance."""
    return np.clip(0.5 + distance / width, 0, 1)


def _waves(places: Float[Array, "n 3"], rng: np.random.Generator) -> Float[Array, " n"]:
    """Smooth random shifts in mm, from random numbers on a coarse grid."""
    if not len(places):
        return np.zeros(0)
    low = places.min(axis=0)
    shape = np.ceil((places.max(axis=0) - low) / _WAVE_LENGTH_MM).astype(int) + 4
    knots = rng.standard_normal(shape)
    return _WAVES_MM * scipy.ndimage.map_coordinates(knots, ((places - low) / _WAVE_LENGTH_MM + 1).T, order=3)
