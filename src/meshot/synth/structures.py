"""Structures of a head other than its cortex, as ellipsoids: ventricles, deep grey matter, cerebellum, brainstem.

They are deliberately simple and not realistic. They make the inside of the white surface as inhomogeneous as in a
scan, and give the registration structures below the cerebrum.
"""

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np
import scipy.ndimage
import torch

from meshot.mesh import Mesh
from meshot.types import Array, Float, Tensor
from meshot.volume import Volume, mm_to_voxel, voxel_sizes

#: Smallest distance between a structure inside the white surface and this surface, in mm.
DEPTH_MM = 3.0
# Centres: from the midline outwards, from posterior to anterior, from inferior to superior, as fractions of the
# bounding box of one white surface. Half axes as fractions of the same lengths. Measured by eye on MNI152.
_PLACES = {
    "thalamus": ((0.18, 0.50, 0.43), (0.120, 0.083, 0.067)),
    "caudate": ((0.20, 0.68, 0.445), (0.075, 0.054, 0.067)),
    "putamen": ((0.41, 0.63, 0.378), (0.080, 0.090, 0.075)),
    "ventricle": ((0.17, 0.58, 0.51), (0.067, 0.155, 0.050)),
    "posterior horn": ((0.38, 0.36, 0.436), (0.075, 0.077, 0.058)),
    "cerebellum": ((0.36, 0.24, 0.07), (0.370, 0.130, 0.140)),
    "brainstem": ((0.0, 0.444, 0.05), (0.165, 0.065, 0.217)),
}
_VENTRICLES, _BELOW = ("ventricle", "posterior horn"), ("cerebellum", "brainstem")


@dataclasses.dataclass(frozen=True, eq=False)
class Structure:
    """An ellipsoid of tissue.

    Parameters
    ----------
    tissue : str
        "deep grey", "fluid" or "hindbrain".
    centre_mm : array
        In head coordinates.
    axes_mm : array
        The half axes, as columns.
    inside_white : bool
        Whether it lies inside the white surfaces, and is cut off at depth ``DEPTH_MM``. Otherwise it lies outside the
        pial surfaces, and is cut off there.
    """

    tissue: str
    centre_mm: Float[Array, " 3"]
    axes_mm: Float[Array, "3 3"]
    inside_white: bool


def structures_of(white: Mapping[str, Mesh], ventricles: float = 1.0, below: float = 1.0) -> list[Structure]:
    """The structures scaled to the bounding boxes of the two white surfaces, in the order in which they are added.

    Parameters
    ----------
    white : mapping
        By hemisphere, "left" and "right", in head coordinates: x increases from left to right and z upwards.
    ventricles : float
        Half axes of the ventricles, relative to those of a young adult; 0 for none.
    below : float
        The same for cerebellum and brainstem.

    Raises
    ------
    ValueError
        If a factor is negative or above 3.
    """
    if not (0 <= ventricles <= 3 and 0 <= below <= 3):
        raise ValueError(f"ventricles is {ventricles} and below {below}; multiples from 0 (none) to 3 are needed")
    found = []
    for name, (place, half) in _PLACES.items():
        scale = ventricles if name in _VENTRICLES else below if name in _BELOW else 1.0
        for side, mesh in white.items():
            low, high = (getattr(mesh.vertices.detach(), end)(dim=0).values.double().numpy() for end in ("min", "max"))
            length, place_in_box = high - low, np.array(place)
            if side == "left":
                place_in_box = place_in_box * [-1, 1, 1] + [1, 0, 0]
            centre = low + length * place_in_box
            tissue = "fluid" if name in _VENTRICLES else "hindbrain" if name in _BELOW else "deep grey"
            found.append(Structure(tissue, centre, np.diag(scale * length * half), name not in _BELOW))
    return [s for s in found if np.linalg.det(s.axes_mm) > 0]


@dataclasses.dataclass(frozen=True, eq=False)
class Ellipsoids:
    """Simple structures as the inside of a head, see :class:`meshot.synth.imaging.Interior`.

    Parameters
    ----------
    structures : sequence of Structure
        In the order in which they are added.
    """

    structures: Sequence[Structure]

    def ends(self) -> Float[Tensor, "n 3"]:
        """The ends of all half axes, in mm."""
        ends = [s.centre_mm + sign * s.axes_mm.T[k] for s in self.structures for sign in (-1, 1) for k in range(3)]
        return torch.from_numpy(np.array(ends).reshape(-1, 3))

    def added_to(
        self, fractions: Mapping[str, Float[Array, "X Y Z"]], inside_pial: Float[Array, "X Y Z"], grid: Volume
    ) -> dict[str, Float[Array, "X Y Z"]]:
        """Tissue fractions with the structures: see :func:`meshot.synth.structures.add_structures`."""
        return add_structures(fractions, inside_pial, grid, self.structures)


def moved_structure(structure: Structure, affine: Float[Array, "4 4"]) -> Structure:
    """A structure after an affine transform of the whole head."""
    centre = affine[:3, :3] @ structure.centre_mm + affine[:3, 3]
    return dataclasses.replace(structure, centre_mm=centre, axes_mm=affine[:3, :3] @ structure.axes_mm)


def structure_fraction(structure: Structure, grid: Volume) -> tuple[tuple[slice, ...], Float[Array, "x y z"]]:
    """The approximate fraction of each voxel that an ellipsoid fills, in a box of the grid, and the slices of the box.

    The edge is a linear ramp one voxel wide, accurate to a few per cent for ellipsoids that are many voxels thick.
    """
    reach = np.linalg.norm(np.linalg.inv(grid.affine)[:3, :3] @ structure.axes_mm, axis=1)
    centre = mm_to_voxel(grid, torch.from_numpy(structure.centre_mm[None])).numpy()[0]
    low = np.clip(np.floor(centre - reach).astype(int) - 1, 0, grid.data.shape)
    high = np.clip(np.ceil(centre + reach).astype(int) + 2, low, grid.data.shape)
    box = tuple(slice(int(a), int(b)) for a, b in zip(low, high, strict=True))
    places = np.stack(np.meshgrid(*(np.arange(a, b) for a, b in zip(low, high)), indexing="ij"), axis=-1) - centre
    unit = places @ (np.linalg.inv(structure.axes_mm) @ grid.affine[:3, :3]).T
    radius = np.sqrt((unit**2).sum(axis=-1))
    thickness = np.cbrt(np.linalg.det(structure.axes_mm)) / voxel_sizes(grid).mean()
    return box, np.clip(0.5 + (1 - radius) * abs(thickness), 0, 1)


def add_structures(
    fractions: Mapping[str, Float[Array, "X Y Z"]],
    inside_pial: Float[Array, "X Y Z"],
    grid: Volume,
    structures: Sequence[Structure],
) -> dict[str, Float[Array, "X Y Z"]]:
    """Tissue fractions after structures have replaced other tissue, one after another.

    Parameters
    ----------
    fractions : mapping
        Fractions of "white" and "grey".
    inside_pial : array
        The fraction of every voxel inside the pial surfaces.
    grid : Volume
    structures : sequence of Structure
    """
    empty = {tissue: np.zeros(grid.data.shape) for tissue in ("deep grey", "hindbrain", "fluid")}
    fractions = {tissue: values.copy() for tissue, values in fractions.items()} | empty
    depth = white_depth(fractions["white"], voxel_sizes(grid)) if any(s.inside_white for s in structures) else None
    for structure in structures:
        box, part = structure_fraction(structure, grid)
        if structure.inside_white:
            part = part * np.clip(0.5 + (depth[box] - DEPTH_MM) / voxel_sizes(grid).mean(), 0, 1)
        else:
            part = part * (1 - inside_pial[box])
        for tissue, values in fractions.items():
            values[box] += part * ((tissue == structure.tissue) - values[box])
    return fractions


def white_depth(white: Float[Array, "X Y Z"], sizes: Float[Array, " 3"]) -> Float[Array, "X Y Z"]:
    """The depth of each voxel inside white matter, in mm, accurate to about a voxel."""
    inside = white > 0.5
    depth = np.zeros(white.shape)
    found = scipy.ndimage.find_objects(inside.astype(np.uint8))
    if found and found[0] is not None:
        box = tuple(slice(max(s.start - 1, 0), s.stop + 1) for s in found[0])
        depth[box] = scipy.ndimage.distance_transform_edt(inside[box], sampling=sizes.tolist())
    return depth
